defmodule Swarm.Replacement.DamageTest do
  @moduledoc "Orders that are signed, and whose content is damaged, or larger than it looks."
  use Swarm.Case, async: false
  alias Swarm.{Replacement, StandMission, Versions}
  alias Swarm.Replacement.{ObjectCode, Rehearsal}
  @moduletag :capture_log
  @moduletag :realtime

  @name "Elixir.Swarm.StandMission"

  defp given(id, content) do
    GenServer.cast(Names.whereis(id, :comms), {:stamp, ref = :erlang.alias([:reply])})
    stamp = receive(do: ({^ref, stamp} -> stamp))
    request = Replacement.seal(content, id, stamp)

    GenServer.cast(
      Names.whereis(id, :comms),
      {:command, request, ref = :erlang.alias([:reply]), stamp}
    )

    receive(do: ({^ref, answer} -> answer))
  end

  defp content(id, fields) do
    term =
      {1, :crypto.strong_rand_bytes(16), "base", ["#{id}"], @name, fields[:options] || "",
       fields[:code] || []}

    :erlang.term_to_binary(term, [:compressed])
  end

  defp replaced(id) do
    with {:ok, value, _at_ms} <- Board.fetch(Board.find!(id), :replaced, :infinity), do: value
  end

  defp beam do
    {:ok, StandMission, [{@name, beam}]} = Replacement.Code.read(StandMission)
    beam
  end

  defp flipped(bytes) do
    at = :rand.uniform(byte_size(bytes)) - 1
    <<head::binary-size(at), byte, tail::binary>> = bytes
    <<head::binary, Bitwise.bxor(byte, :rand.uniform(255)), tail::binary>>
  end

  # A compressed list of empty lists: some kilobytes on their way, gigabytes in memory.
  defp bomb(count) do
    nils = [<<108, count::32>>, :binary.copy(<<106>>, count + 1)]
    <<131, 80, count + 6::32, IO.iodata_to_binary(:zlib.compress(nils))::binary>>
  end

  # Packed twice: an order of some 3 kB.
  defp packed(id, count), do: content(id, options: bomb(count))

  test "an order of 3 kB that would take gigabytes is refused, and takes none" do
    id = robot(:dama_bomb, replace: :code)
    standing([id])
    content = packed(id, 100_000_000)
    assert byte_size(content) < 4_000
    server = Process.whereis(Replacement.Server)
    test = self()

    meter =
      spawn_link(fn ->
        send(
          test,
          {:most,
           Enum.max(
             Stream.repeatedly(fn -> :erlang.memory(:total) end)
             |> Stream.take_while(fn _ -> receive(do: (:done -> false), after: (2 -> true)) end)
           )}
        )
      end)

    before = :erlang.memory(:total)
    # Nothing is on a mission, so the options are read at once.
    assert given(id, content) == :ok
    assert given(id, bomb(5_000_000)) == {:error, "#{id}: this order is malformed"}
    eventually(fn -> match?(%{says: "went back from " <> _}, replaced(id)) end)
    assert replaced(id).says =~ "its options have names that its code does not know"
    send(meter, :done)
    assert_receive {:most, most}, 10_000
    assert most - before < 200_000_000
    assert Process.whereis(Replacement.Server) == server
  end

  test "an order that would be refused is not given" do
    id = :dama_large
    deep = Enum.reduce(1..300, [], fn _n, deep -> [deep] end)

    for options <- [
          [pid: self()],
          [fun: fn -> 1 end],
          [list: List.duplicate([], 10_000)],
          [deep: deep]
        ] do
      assert {:error, line} = Replacement.order([id], {:code, StandMission, options})
      assert line == "options: expected data of at most 64 kB, without processes and functions"
    end
  end

  test "code comes only to a robot whose file says so" do
    id = robot(:dama_off, replace: true)
    standing([id])
    code = Versions.code(Ours.Damage1, 1)

    assert order(fn -> Swarm.replace(id, {:code, code}) end) ==
             {:error, "#{id}: it takes no code from others: its file does not say replace: :code"}

    assert order(fn -> Swarm.replace(id, StandMission) end) == :ok
  end

  test "damaged attributes are refused in a line, and the process of the node lives" do
    id = robot(:dama_attr, replace: :code)
    standing([id])
    server = Process.whereis(Replacement.Server)
    beam = beam()
    {at, _length} = :binary.match(beam, "Attr")

    wrong = {:error, "the code of Swarm.StandMission is not the object code of that module"}

    for offset <- 4..30 do
      <<head::binary-size(at + offset), byte, tail::binary>> = beam
      damaged = <<head::binary, Bitwise.bxor(byte, 255), tail::binary>>

      answer = given(id, content(id, code: [{@name, damaged}]))
      assert answer == :ok or match?({:error, <<_::binary>>}, answer)
    end

    attributes = fn term ->
      <<size::32, _::binary>> = binary_part(beam, at + 4, byte_size(beam) - at - 4)
      padded = 4 * div(size + 3, 4)
      <<head::binary-size(at), _::binary-size(8 + padded), tail::binary>> = beam
      zeros = rem(4 - rem(byte_size(term), 4), 4)

      <<"FOR1", _::32, rest::binary>> =
        <<head::binary, "Attr", byte_size(term)::32, term::binary, 0::size(zeros)-unit(8),
          tail::binary>>

      <<"FOR1", byte_size(rest)::32, rest::binary>>
    end

    for term <- [
          "",
          "junk",
          <<131>>,
          :erlang.term_to_binary(7),
          :erlang.term_to_binary([7]),
          :erlang.term_to_binary(behaviour: 7),
          bomb(50_000_000)
        ] do
      damaged = attributes.(term)
      assert {:error, line} = given(id, content(id, code: [{@name, damaged}]))
      assert {term, line =~ "is not "} == {term, true}
    end

    # Packed as a whole, as a file may be.
    assert given(id, content(id, code: [{@name, :zlib.gzip(:binary.copy(<<0>>, 50_000_000))}])) ==
             wrong

    assert Process.whereis(Replacement.Server) == server
  end

  # Functions that it exports begin at labels that it does not have.
  defp without_labels(beam) do
    {at, 4} = :binary.match(beam, "ExpT")

    <<head::binary-size(at + 4), _size::32, count::32, exports::binary-size(12 * count),
      tail::binary>> = beam

    far =
      for <<name::32, arity::32, _label::32 <- exports>>,
        into: <<>>,
        do: <<name::32, arity::32, 0x98_0000::32>>

    <<head::binary, byte_size(far) + 4::32, count::32, far::binary, tail::binary>>
  end

  test "code that ends the VM that loads it does not end this one, and the robot goes on" do
    id = robot(:dama_abort, replace: :code)
    standing([id])
    assert order(fn -> Swarm.start(StandMission, robots: [id]) end) == :ok
    server = Process.whereis(Replacement.Server)
    [{module, beam}] = Versions.code(Ours.Damage2, 1)
    {:ok, ^module, [{_name, beam}]} = Replacement.Code.read([{module, beam}])
    damaged = without_labels(beam)
    assert ObjectCode.read("#{module}", damaged) == {:ok, true}
    assert order(fn -> Swarm.replace(id, {:code, [{module, damaged}]}) end) == :ok
    eventually(fn -> match?(%{says: "went back from " <> _}, replaced(id)) end)
    assert replaced(id).says =~ "cannot be loaded"
    eventually(fn -> match?(%{state: :stand}, Swarm.status(id)) end)
    refute :erlang.module_loaded(module)
    assert Process.whereis(Replacement.Server) == server
  end

  test "of flipped bytes none ends this VM: each is found by its form, or by a VM of its own, or loads" do
    beam = beam()

    for _n <- 1..2_000 do
      assert ObjectCode.read(@name, flipped(beam)) in [:error, {:ok, true}, {:ok, false}]
    end

    assert ObjectCode.read(@name, beam) == {:ok, true}
    assert Rehearsal.load([{StandMission, beam}]) == :ok

    for _n <- 1..10, damaged = flipped(beam), ObjectCode.read(@name, damaged) == {:ok, true} do
      {pid, monitor} =
        spawn_monitor(fn -> exit({:rehearsed, Rehearsal.load([{StandMission, damaged}])}) end)

      assert_receive {:DOWN, ^monitor, :process, ^pid, _loaded_or_not}, 30_000
    end
  end
end
