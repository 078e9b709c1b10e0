defmodule Swarm.Replacement.NodesTest do
  @moduledoc "Robots on nodes of their own, and a person on a node without one. Nothing of this VM is shared."
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1, order: 1]
  alias Swarm.{MeshNodes, StandMission, UnfitMission}
  alias Swarm.MeshNodes.Wheels
  @moduletag :realtime
  @moduletag :cluster
  @moduletag :capture_log

  defp start(node, options),
    do: :ok = MeshNodes.call(node, Wheels, :robot, [node.name, [], options])

  defp ask(node, function, arguments), do: MeshNodes.call(node, Swarm, function, arguments)
  defp state(node), do: ask(node, :status, [node.name])

  defp rolls(node), do: eventually(fn -> match?(%{state: :roll}, state(node)) end)

  defp replaced(node, what),
    do:
      eventually(fn ->
        match?(%{replaced: <<^what::binary-size(byte_size(what)), _::binary>>}, state(node))
      end)

  test "a mission reaches all that allow it, a wrong one goes back on each, and who starts again has the release" do
    [base, one, two, shut] = nodes = MeshNodes.start(4)
    for node <- [one, two], do: start(node, replace: true)
    start(shut, [])
    names = for node <- [one, two, shut], do: node.name
    for node <- nodes, do: eventually(fn -> names -- ask(node, :find, []) == [] end)
    assert order(fn -> ask(base, :start, [StandMission, []]) end) == :ok

    refused = "#{shut.name}: its mission cannot be replaced: its file does not say replace: true"

    assert order(fn -> ask(base, :replace, [:all, {UnfitMission, [speed: 0.3]}]) end) ==
             {:error, refused}

    for node <- [one, two], do: rolls(node)
    assert %{replaced: nil, state: :stand} = state(shut)
    for node <- [one, two], do: replaced(node, "keeps Swarm.UnfitMission, given by #{base.node}")

    wrong = {UnfitMission, [does: :crash]}
    assert order(fn -> ask(base, :replace, [[one.name, two.name], wrong]) end) == :ok
    for node <- [one, two], do: replaced(node, "went back from Swarm.UnfitMission")
    for node <- [one, two], do: rolls(node)

    MeshNodes.signal(two, "KILL")
    two = MeshNodes.join(nodes, two.name)
    start(two, replace: true)
    eventually(fn -> two.name in ask(base, :find, []) end)
    assert order(fn -> ask(base, :tell, [two.name, "start"]) end) == :ok

    assert MeshNodes.call(two, Swarm.Case, :entry, [two.node, two.name, :mission]).state ==
             {StandMission, :stand}

    assert %{state: :roll} = state(one)
  end
end

defmodule Swarm.Replacement.KeyTest do
  @moduledoc "A node that is connected, and has a key of its own."
  use Swarm.Case, async: false
  alias Swarm.{Cluster, StandMission}
  @moduletag :realtime
  @moduletag :cluster
  @moduletag :capture_log

  test "a node with another key is refused, although it is connected" do
    # Without a mesh each node has a key of its own.
    [base, there] = Cluster.start_nodes(2)
    id = robot_on(there, :repl_far, replace: true)
    give = fn node -> order(fn -> :erpc.call(node, Swarm, :replace, [id, StandMission]) end) end
    eventually(fn -> :erpc.call(base, Directory, :whereis, [id]) end)
    assert give.(base) == {:error, "repl_far: this order is not signed by its fleet's key"}
    assert entry(there, id, :replaced) == nil
    assert give.(there) == :ok
  end
end
