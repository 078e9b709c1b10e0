defmodule Swarm.Mesh.AbsurdTest do
  # A robot of the fleet with a bug: what it sends is signed, but makes no sense. Its nodes are
  # VMs of their own, with names and ports of their own: nothing of this VM is shared.
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Swarm.MeshNodes
  @moduletag :realtime

  @parts [
    Mesh.Server,
    Mesh.Dialer,
    Swarm.EStop.Broadcaster,
    Swarm.Blackboard,
    Swarm.Discovery.Presence
  ]

  defp parts(%{name: name} = node) do
    roles = [:comms, :estop, :pilot, :executive, :gate]
    named = for role <- roles, do: MeshNodes.call(node, Robot.Names, :whereis, [name, role])
    named ++ for part <- @parts, do: MeshNodes.call(node, Process, :whereis, [part])
  end

  defp hears?(one, two),
    do: match?(%{status: :alive}, MeshNodes.call(one, Mesh, :view, []).nodes[two.node])

  test "it crashes nothing and moves nobody, and is understood when it makes sense again" do
    [one, two] = MeshNodes.start(2, robots: true)
    assert eventually(fn -> hears?(one, two) and hears?(two, one) end)
    assert eventually(fn -> MeshNodes.call(two, Swarm, :stop, [one.name]) == :ok end)
    # The first time loads all modules that are needed.
    MeshNodes.call(two, Swarm.MeshNodes.Absurd, :send_all, [two.name, 7], 60_000)
    before = parts(one)
    atoms = MeshNodes.call(one, :erlang, :system_info, [:atom_count])
    heard = MeshNodes.call(one, Mesh, :counts, []).heard

    sent = MeshNodes.call(two, Swarm.MeshNodes.Absurd, :send_all, [two.name, 2], 60_000)
    # Terms larger than a datagram are not even sent.
    assert eventually(fn ->
             MeshNodes.call(one, Mesh, :counts, []).heard - heard > sent / 2
           end)

    assert MeshNodes.call(one, Mesh, :rejected, [])[:message] > 100

    assert parts(one) == before
    assert MeshNodes.call(one, :erlang, :system_info, [:atom_count]) - atoms < 10

    assert %{state: :idle, speed: speed} = MeshNodes.call(one, Swarm, :status, [one.name])
    assert speed == 0

    for f <- [:status, :matrix, :find],
        do: assert(is_binary(inspect(MeshNodes.call(one, Swarm, f, []))))

    assert is_map(MeshNodes.call(one, Swarm.Blackboard.Hints, :all, []))
    assert is_map(MeshNodes.call(one, Swarm.Blackboard, :rows, [two.name]))

    assert eventually(fn -> hears?(one, two) and hears?(two, one) end)

    # Sent last, by the same socket: who has read these has read all.
    assert :ok = MeshNodes.call(two, Swarm.Blackboard, :put, [two.name, :door, 1])
    assert :ok = MeshNodes.call(two, Swarm.Blackboard.Hints, :put, [two.name, :hint, 1])

    assert eventually(fn ->
             match?(
               {:ok, 1, _},
               MeshNodes.call(one, Swarm.Blackboard, :get, [two.name, :door, 2_000])
             )
           end)

    assert eventually(fn ->
             match?({:ok, 1, _}, MeshNodes.call(one, Swarm.Blackboard.Hints, :get, [:hint]))
           end)

    # Some of it was a stop, which is not answered.
    assert MeshNodes.call(one, Swarm, :status, [one.name]).estop
    assert eventually(fn -> MeshNodes.call(two, Swarm, :reset, []) == :ok end)
    refute MeshNodes.call(one, Swarm, :status, [one.name]).estop
    assert eventually(fn -> MeshNodes.call(two, Swarm, :estop, []) == :ok end)
    assert eventually(fn -> MeshNodes.call(one, Swarm, :status, [one.name]).estop end)
  end
end
