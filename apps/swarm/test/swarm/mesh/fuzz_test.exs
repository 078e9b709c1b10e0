defmodule Swarm.Mesh.FuzzTest do
  # Its node is a VM of its own, with names and ports of its own.
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Swarm.MeshNodes
  alias Swarm.MeshNodes.Fuzz
  @moduletag :realtime

  test "no door of a node ends because of a message, and none is left behind" do
    [node] = MeshNodes.start(1, robots: true)
    doors = MeshNodes.call(node, Fuzz, :doors, [node.name])
    assert length(doors) == 10
    for {name, pid} <- doors, do: assert({name, is_pid(pid)} == {name, true})

    # The first time loads all modules that are needed, and whoever loads one is slow.
    seed = ExUnit.configuration()[:seed]
    loading = MeshNodes.call(node, Fuzz, :pour, [node.name, seed, 500], 60_000)
    assert Enum.reject(loading, &match?({_name, {:long, _messages}}, &1)) == []
    assert MeshNodes.call(node, Fuzz, :pour, [node.name, seed, 1_000], 60_000) == []
    assert MeshNodes.call(node, Fuzz, :doors, [node.name]) == doors

    assert eventually(fn -> MeshNodes.call(node, Swarm, :stop, [node.name]) == :ok end)
    assert eventually(fn -> MeshNodes.call(node, Swarm, :estop, []) == :ok end)
    assert eventually(fn -> MeshNodes.call(node, Swarm, :reset, []) == :ok end)
  end
end
