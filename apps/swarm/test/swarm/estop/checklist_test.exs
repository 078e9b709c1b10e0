defmodule Swarm.EStop.ChecklistTest do
  @moduledoc """
  What went wrong with the emergency stops of other fleets: an issuer whose own robot drove on, a second stop that was
  taken for the first, and answers that counted who had not stopped, or had nothing to stop.
  """
  use Swarm.Case, async: false
  alias Mesh.Protocol.Packet
  alias Swarm.Cluster
  alias Swarm.EStop.Broadcaster
  alias Swarm.MeshNodes.Wheels
  alias Swarm.Replacement.Order
  @moduletag :realtime
  @moduletag :capture_log

  defp on(node, m, f, a), do: :erpc.call(node, m, f, a)
  defp held(node, id), do: MapSet.new(entry(node, id, :estop).held)

  # Robots whose wheels report, on nodes of their own, a node without a robot, and one here.
  defp fleet(name) do
    nodes = [observer | with_robots] = Cluster.start_nodes(3)
    far = for {node, n} <- Enum.with_index(with_robots), do: {node, :"#{name}_#{n}"}
    for {node, id} <- far, do: :ok = on(node, Wheels, :robot, [id])
    [here] = standing([robot(:"#{name}_here")])
    all = [{node(), here} | far]

    for node <- nodes,
        do: eventually(fn -> length(on(node, Directory, :members, [:estops])) == 3 end)

    for {node, id} <- far, do: eventually(fn -> entry(node, id, :odometry) end)
    %{observer: observer, here: here, far: far, all: all}
  end

  @tag :cluster
  test "the issuer's own robot stops, whoever issues; who has no robot is neither counted nor missed" do
    %{observer: observer, all: all} = fleet(:own)

    for {issuer, _id} <- [{observer, nil} | all] do
      assert order(fn -> on(issuer, Swarm, :estop, []) end) == :ok

      for {node, id} <- all,
          do: assert(on(node, Board, :latched?, [on(node, Board, :find!, [id])]), "#{id}")

      assert order(fn -> on(issuer, Swarm, :reset, []) end) == :ok
    end
  end

  @tag :cluster
  test "a second stop while all are held is taken and spread, and is no replay of the first" do
    %{observer: observer, far: [{node, id} | _], all: all} = fleet(:second)
    assert order(&Swarm.estop/0) == :ok
    [first] = Enum.uniq(for {node, id} <- all, do: held(node, id))

    assert order(fn -> on(observer, Swarm, :estop, []) end) == :ok

    eventually(fn ->
      Enum.all?(all, fn {node, id} -> not MapSet.subset?(held(node, id), first) end)
    end)

    # One that a person has released is held by the next, at once, though all others still are by the ones before.
    assert order(fn -> Swarm.Commands.tell([id], :reset) end) == :ok
    assert held(node, id) == MapSet.new()
    assert order(&Swarm.estop/0) == :ok
    assert MapSet.size(held(node, id)) >= 1

    # So is the whole fleet within the second in which the one before is still repeated.
    assert order(&Swarm.reset/0) == :ok
    assert order(&Swarm.estop/0) == :ok
    for {node, id} <- all, do: assert(MapSet.size(held(node, id)) >= 1)
    assert order(&Swarm.reset/0) == :ok
  end

  @tag :cluster
  test "a robot that cannot stop is not counted as stopped, and delays no other" do
    %{far: [{node, id} | _], all: all} = fleet(:hangs)
    gate = on(node, Names, :whereis, [id, :gate])
    :ok = on(node, :sys, :suspend, [gate])
    # Once: a gate that hangs is started again after 2 s.
    assert {:error, line} = Swarm.estop()
    assert line =~ "#{id}"

    for {node, other} <- all, other != id do
      assert MapSet.size(held(node, other)) >= 1
      refute line =~ "#{other}"
    end

    # By then it may have been ended.
    on(node, Process, :exit, [gate, :kill])
    eventually(fn -> Swarm.estop() == :ok end)
    assert order(&Swarm.reset/0) == :ok
  end

  @tag :cluster
  test "who is told nobody says so, for every kind of stop" do
    [base] = Cluster.start_nodes(1)

    for {command, arguments} <- [estop: [], stop: [], disarm: [:all], reset: []] do
      assert {:error, line} = on(base, Swarm, command, arguments)
      assert line =~ "no robot"
    end
  end

  test "a robot is stopped by a call from its own node while the directory is gone" do
    id = robot(:own_directory)
    directory = Process.whereis(Directory)
    {:dictionary, dictionary} = Process.info(directory, :dictionary)
    [keeper | _] = dictionary[:"$ancestors"]
    :ok = :sys.suspend(keeper)
    monitor = Process.monitor(directory)
    Process.exit(directory, :kill)
    assert_receive {:DOWN, ^monitor, _, _, :killed}
    :ok = Broadcaster.sound(Broadcaster.call())
    eventually(fn -> Board.latched?(Board.find!(id)) end)
    :ok = :sys.resume(keeper)
    eventually(fn -> Swarm.reset() == :ok end)
  end

  describe "what is signed are the very bytes that are sent" do
    @key "the fleet's key"

    defp packet(payload) do
      %Packet{
        sender: "mag1@lab",
        session: 7,
        sequence: 1,
        time_ms: 99,
        addresses: [{{10, 0, 0, 7}, 4370}],
        kind: :service,
        payload: payload
      }
    end

    test "of a datagram: one that says the same in other bytes is not signed" do
      # 1 as an integer of four bytes, which no node of ours writes.
      other = <<131, 98, 1::32>>
      assert {:ok, 1} = Packet.unpack(other)
      refute Packet.pack(1) == other
      sealed = Packet.seal(packet(other), @key)
      assert {:ok, %{payload: ^other}} = Packet.open(sealed, @key)

      mac = binary_part(sealed, byte_size(sealed), -16)
      usual = Packet.seal(packet(Packet.pack(1)), @key)
      mixed = binary_part(usual, 0, byte_size(usual) - 16) <> mac
      assert Packet.open(mixed, @key) == {:error, :unsigned}
    end

    test "of a datagram: not one bit may differ" do
      sealed = Packet.seal(packet(Packet.pack({:reset, [1, 2]})), @key)

      for bit <- 0..(bit_size(sealed) - 1) do
        <<before::bits-size(bit), one::1, rest::bits>> = sealed
        assert {:error, _why} = Packet.open(<<before::bits, 1 - one::1, rest::bits>>, @key)
      end
    end

    test "of an order that replaces a mission" do
      order = %Order{
        id: <<0::128>>,
        from: "base@lab",
        to: ["mag1"],
        mission: "patrol",
        options: Order.encode_options(period: Enum.to_list(1..200))
      }

      # Which packs what is long.
      {:ok, content} = Order.encode(order)
      other = content |> :erlang.binary_to_term() |> :erlang.term_to_binary()
      assert {Order.decode(content), Order.decode(other)} == {{:ok, order}, {:ok, order}}
      [one, two] = for bytes <- [content, other], do: Order.signed_bytes(:mag1, {1, 2}, bytes)
      refute one == two
    end
  end
end
