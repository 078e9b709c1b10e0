defmodule Swarm.Mesh.FuzzTest do
  # Its node is a VM of its own, with names and ports of its own.
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Swarm.MeshNodes
  alias Swarm.MeshNodes.Fuzz
  @moduletag :realtime
  @moduletag :tmp_dir

  test "no process of a node ends because of a message, and none is left behind", context do
    [node] = MeshNodes.start(1)
    :ok = MeshNodes.call(node, Fuzz, :robot, [node.name, context.tmp_dir])
    processes = MeshNodes.call(node, Fuzz, :processes, [])
    names = for {{robot, role}, _pid} <- processes, robot == node.name, do: role

    for role <-
          ~w(robot board drive ptz camera blob_detector view saver gate watch executive)a ++
            ~w(pilot estop comms)a,
        do: assert(role in names)

    for name <- [Robot.Names, Robot.Fleet, Swarm.Directory, Swarm.Blackboard, Mesh.Server],
        do: assert(List.keymember?(processes, name, 0))

    # The first time loads all modules that are needed, and whoever loads one is slow.
    seed = ExUnit.configuration()[:seed]
    loading = MeshNodes.call(node, Fuzz, :pour, [node.name, seed, 500], 60_000)
    assert Enum.reject(loading, &match?({_name, {:long, _messages}}, &1)) == []
    assert MeshNodes.call(node, Fuzz, :pour, [node.name, seed, 1_000], 60_000) == []
    assert MeshNodes.call(node, Fuzz, :processes, []) == processes

    assert eventually(fn -> MeshNodes.call(node, Swarm, :stop, [node.name]) == :ok end)
    assert eventually(fn -> MeshNodes.call(node, Swarm, :estop, []) == :ok end)
    assert eventually(fn -> MeshNodes.call(node, Swarm, :reset, []) == :ok end)
  end
end
