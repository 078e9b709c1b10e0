defmodule Swarm.Mesh.FloodTest do
  # A real socket, a real robot in a VM of its own, and a flood.
  use ExUnit.Case, async: false
  import Swarm.Case, only: [eventually: 1, order: 1]
  alias Swarm.MeshNodes
  alias Mesh.Protocol.Packet
  @moduletag :realtime

  @datagrams 100_000

  setup do
    [one, two] = MeshNodes.start(2, robots: true)
    %{port: port} = MeshNodes.call(one, Mesh, :counts, [])
    {:ok, socket} = :gen_udp.open(0, [:binary, active: false, ip: {127, 0, 0, 1}])
    assert eventually(fn -> hears?(one, two) end)
    {:ok, own_port} = :inet.port(socket)
    send = &:gen_udp.send(socket, {127, 0, 0, 1}, port, &1)
    %{one: one, two: two, send: send, socket: socket, address: {{127, 0, 0, 1}, own_port}}
  end

  defp hears?(one, two) do
    match?(%{status: :alive}, MeshNodes.call(one, Mesh, :view, []).nodes[two.node])
  end

  defp state(node) do
    board = MeshNodes.call(node, Robot.Board, :find!, [node.name])
    {:ok, _doing, at_ms} = MeshNodes.call(node, Robot.Board, :fetch, [board, :doing, :infinity])

    %{
      radio: MeshNodes.call(node, Process, :whereis, [Mesh.Server]),
      atoms: MeshNodes.call(node, :erlang, :system_info, [:atom_count]),
      memory: MeshNodes.call(node, :erlang, :memory, [:total]),
      tick_ms: at_ms
    }
  end

  # How many came back, and the size of the largest.
  defp answers(socket, counted \\ {0, 0}) do
    case :gen_udp.recv(socket, 0, 0) do
      {:ok, {_ip, _port, datagram}} ->
        {count, size} = counted
        answers(socket, {count + 1, max(size, byte_size(datagram))})

      {:error, :timeout} ->
        counted
    end
  end

  test "with garbage, replayed and foreign packets nothing crashes, nothing grows, the robot ticks on",
       %{one: one, two: two, send: send, socket: socket, address: address} do
    recorded = %Packet{
      sender: "#{two.node}",
      session: 7,
      sequence: 7,
      time_ms: 7,
      addresses: [address],
      kind: :beacon,
      payload: Packet.pack({[], [], 0})
    }

    foreign = Packet.seal(recorded, "not this fleet's key")
    # Of an old life of the other node, which had this address then.
    key = MeshNodes.call(one, Application, :get_env, [:swarm, :mesh])[:secret].key
    recorded = Packet.seal(recorded, key)

    flood = fn datagrams ->
      for n <- 1..datagrams do
        case rem(n, 4) do
          0 -> send.(if rem(n, 8) == 0, do: foreign, else: recorded)
          1 -> send.(<<"CVY", 2, 1, 5, "abcde", n::64, n::64, n::64, 0, 0::128, n::128>>)
          _ -> send.(:rand.bytes(1 + rem(n, 700)))
        end
      end

      # During the flood the robot's controller goes on, and people are answered.
      tick_ms = state(one).tick_ms
      assert eventually(fn -> state(one).tick_ms > tick_ms + 500 end)
      assert order(fn -> MeshNodes.call(one, Swarm, :stop, [one.name]) end) == :ok
      assert %{not_ours: _, throttled: _} = MeshNodes.call(one, Mesh, :rejected, [])
      state(one)
    end

    # A module that is loaded brings its own atoms, and memory.
    for app <- [:kernel, :stdlib, :elixir, :hal, :vision, :robot, :mesh, :swarm] do
      modules = MeshNodes.call(one, Application, :spec, [app, :modules])
      MeshNodes.call(one, :code, :ensure_modules_loaded, [modules])
    end

    before = flood.(10_000)
    _few = answers(socket)
    {us, then} = :timer.tc(fn -> flood.(@datagrams) end)
    # Who replays what a node has said gets one small datagram each 20 ms, at most.
    assert {count, 256} = answers(socket)
    assert count in 1..(div(us, 20_000) + 1)
    assert then.radio == before.radio
    assert then.memory - before.memory < 20_000_000
    assert then.atoms - before.atoms < 10
    assert hears?(one, two)
  end
end
