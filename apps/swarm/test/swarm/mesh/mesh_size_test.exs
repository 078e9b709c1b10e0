defmodule Swarm.MeshSizeTest do
  # Larger fleets: real nodes on loopback. Its nodes are VMs of their own, with names and ports of
  # their own: nothing of this VM is shared.
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Swarm.MeshNodes, as: Cluster
  @moduletag :realtime

  defp linked(node), do: Cluster.call(node, Node, :list, [])
  defp full?(nodes), do: Enum.all?(nodes, &(met?(&1, nodes) and joined?(&1, nodes)))
  defp joined?(node, nodes), do: Enum.sort(linked(node)) == others(node, nodes)
  defp others(node, nodes), do: Enum.sort(for n <- nodes, n.node != node.node, do: n.node)

  defp met?(node, nodes) do
    seen = Cluster.call(node, Mesh, :view, []).nodes
    alive = for {other, %{status: :alive}} <- seen, do: other
    Enum.sort(alive) == others(node, nodes)
  end

  test "if not all nodes are connected, commands and their answers travel through the nodes in between" do
    # The second and the fifth are never neighbours, however many there are; the first two would
    # be.
    nodes = Cluster.start(7, robots: true, mesh: [full_mesh: 3, degree: 2], one_by_one: true)
    [_, one, _, _, far | _] = nodes
    assert eventually(fn -> Enum.all?(nodes, &met?(&1, nodes)) end)
    assert eventually(fn -> Enum.all?(nodes, &(length(linked(&1)) >= 2)) end)

    assert eventually(fn ->
             match?(%{state: :idle}, Cluster.call(one, Swarm, :status, [far.name]))
           end)

    # On a busy machine seven nodes may need longer for an answer than the 500 ms that the caller
    # waits.
    assert eventually(fn -> Cluster.call(one, Swarm, :stop, [far.name]) == :ok end)
    assert far.node not in linked(one)
  end

  test "ten nodes form" do
    nodes = Cluster.start(10, robots: true)
    assert eventually(fn -> full?(nodes) end)
  end
end
