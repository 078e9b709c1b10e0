defmodule Swarm.EStop.DatagramsTest do
  # Its nodes are VMs of their own, with names and ports of their own: nothing of this VM is shared.
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Robot.Board
  alias Swarm.MeshNodes
  @moduletag :realtime
  @moduletag :cluster

  defp latched?(node) do
    {:ok, board} = MeshNodes.call(node, Board, :find, [node.name])
    MeshNodes.call(node, Board, :latched?, [board])
  end

  test "a stop that arrives only by datagram holds the robots of all other nodes" do
    [base | robots] = nodes = MeshNodes.start(3, robots: true)
    others = for node <- robots, do: node.name
    hears? = fn node -> map_size(MeshNodes.call(node, Mesh, :robots, [])) == 2 end
    for node <- nodes, do: eventually(fn -> hears?.(node) end)
    assert others -- Map.keys(MeshNodes.call(base, Mesh, :robots, [])) == []

    call = {:estop, {base.node, 1, 1}, 0}
    assert MeshNodes.call(base, Mesh, :broadcast, [:stop, call]) == :ok
    for node <- robots, do: eventually(fn -> latched?(node) end)
    # Their heartbeats inform the sender's own robot, which the sender's datagrams do not reach.
    eventually(fn -> latched?(base) end)
  end
end
