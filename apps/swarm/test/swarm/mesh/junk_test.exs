defmodule Swarm.Mesh.JunkTest do
  # A connected node can send anything to any process that has a name or is in the directory. Its
  # nodes are VMs of their own, with names and ports of their own: nothing of this VM is shared.
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Swarm.MeshNodes
  alias Swarm.MeshNodes.Junk
  @moduletag :realtime

  test "nothing that is sent to a node crashes anything or makes it grow" do
    [one, two] = MeshNodes.start(2, robots: true)
    assert eventually(fn -> hears?(one, two) end)

    # The first time loads all modules that are needed.
    assert MeshNodes.call(one, Junk, :pour, [one.name], 40_000) == []
    before = grown(one)
    assert MeshNodes.call(one, Junk, :pour, [one.name], 40_000) == []
    assert grown(one) - before < 20_000_000

    assert eventually(fn -> hears?(one, two) and hears?(two, one) end)
    assert eventually(fn -> MeshNodes.call(two, Swarm, :stop, [one.name]) == :ok end)
    assert MeshNodes.call(one, Node, :list, []) == [two.node]
  end

  defp hears?(one, two),
    do: match?(%{status: :alive}, MeshNodes.call(one, Mesh, :view, []).nodes[two.node])

  defp grown(node) do
    for pid <- MeshNodes.call(node, Process, :list, []),
        do: MeshNodes.call(node, :erlang, :garbage_collect, [pid])

    MeshNodes.call(node, :erlang, :memory, [:total])
  end
end
