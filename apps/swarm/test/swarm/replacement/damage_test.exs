defmodule Swarm.Replacement.DamageTest do
  @moduledoc "Orders that are signed, and whose content is damaged, or larger than it looks."
  use Swarm.Case, async: false
  alias Swarm.Replacement
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
    term = {2, :crypto.strong_rand_bytes(16), "base", ["#{id}"], @name, fields[:options] || ""}

    :erlang.term_to_binary(term, [:compressed])
  end

  defp replaced(id) do
    with {:ok, value, _at_ms} <- Board.fetch(Board.find!(id), :replaced, :infinity), do: value
  end

  # A compressed list of empty lists: some kilobytes on their way, gigabytes in memory.
  defp bomb(count) do
    nils = [<<108, count::32>>, :binary.copy(<<106>>, count + 1)]
    <<131, 80, count + 6::32, IO.iodata_to_binary(:zlib.compress(nils))::binary>>
  end

  # Packed twice: an order of some 3 kB.
  defp packed(id, count), do: content(id, options: bomb(count))

  test "an order of 3 kB that would take gigabytes is refused, and takes none" do
    id = robot(:dama_bomb, replace: true)
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
    assert replaced(id).says =~ "its options have names that this build does not know"
    send(meter, :done)
    assert_receive {:most, most}, 10_000
    assert most - before < 200_000_000
    assert Process.whereis(Replacement.Server) == server
  end
end
