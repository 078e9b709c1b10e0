defmodule Swarm.Mesh.CrashesTest do
  # Parts of a node crash, each more often than any supervisor would tolerate. Its nodes are VMs
  # of their own, with names and ports of their own: nothing of this VM is shared.
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Swarm.MeshNodes
  @moduletag :realtime

  @parts [
    Swarm.Blackboard,
    Swarm.Discovery.Presence,
    Swarm.EStop.Broadcaster,
    Swarm.Directory,
    Mesh.CommandRelay,
    Mesh.Dialer,
    Mesh.Server
  ]
  @times 5

  defp whereis(node, part), do: MeshNodes.call(node, Process, :whereis, [part])

  defp kill(node, part) do
    pid = eventually(fn -> whereis(node, part) end)
    MeshNodes.call(node, Process, :exit, [pid, :kill])
    eventually(fn -> whereis(node, part) not in [nil, pid] end)
  end

  defp whole?(one, two) do
    seen = MeshNodes.call(one, Mesh, :view, []).nodes
    match?(%{^two => %{status: :alive, connected: true}}, seen)
  end

  defp pids(%{name: name} = node) do
    for role <- [:robot, :board, :drive, :gate, :executive, :pilot, :estop, :comms],
        do: MeshNodes.call(node, Robot.Names, :whereis, [name, role])
  end

  test "the robot goes on, the emergency stop holds, and everything is as before" do
    [one, two] = MeshNodes.start(2, robots: true)
    assert eventually(fn -> whole?(one, two.node) and whole?(two, one.node) end)
    assert eventually(fn -> MeshNodes.call(two, Swarm, :estop, []) == :ok end)
    # Its comms process enters it there with its next row.
    assert eventually(fn ->
             MeshNodes.call(one, Swarm.Blackboard, :put, [one.name, :door, 0]) == :ok
           end)

    assert :ok = MeshNodes.call(one, Swarm.Blackboard.Hints, :put, [one.name, :hint, 0])
    robot = pids(one)
    board = MeshNodes.call(one, Robot.Board, :find!, [one.name])

    for part <- @parts, _time <- 1..@times do
      kill(one, part)
      assert pids(one) == robot
      assert MeshNodes.call(one, Robot.Board, :latched?, [board])
    end

    assert eventually(fn -> whole?(one, two.node) and whole?(two, one.node) end)

    # What it wrote before its board was lost is still its own, and newer than what others kept of it. The other node
    # may not have met this node's new session yet, and then gets the row by a later comparison.
    assert eventually(fn ->
             MeshNodes.call(one, Swarm.Blackboard, :put, [one.name, :door, 1]) == :ok
           end)

    assert eventually(fn ->
             match?(
               {:ok, 1, _},
               MeshNodes.call(two, Swarm.Blackboard, :get, [one.name, :door, 60_000])
             )
           end)

    assert eventually(fn ->
             match?({:ok, 0, _}, MeshNodes.call(one, Swarm.Blackboard.Hints, :get, [:hint]))
           end)

    assert :ok = MeshNodes.call(one, Swarm.Blackboard.Hints, :put, [one.name, :hint, 1])

    assert eventually(fn ->
             match?({:ok, 1, _}, MeshNodes.call(two, Swarm.Blackboard.Hints, :get, [:hint]))
           end)

    for node <- [one, two],
        id <- [one.name, two.name],
        do:
          assert(
            eventually(fn ->
              match?(%{estop: true, from: :robot}, MeshNodes.call(node, Swarm, :status, [id]))
            end)
          )

    assert eventually(fn -> MeshNodes.call(two, Swarm, :reset, []) == :ok end)
    assert eventually(fn -> not MeshNodes.call(one, Swarm, :status, [one.name]).estop end)
  end
end
