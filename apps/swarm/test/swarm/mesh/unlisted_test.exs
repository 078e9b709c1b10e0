defmodule Swarm.Mesh.UnlistedTest do
  @moduledoc "Robots hear those whose names their own configuration lists, as text, and no others."
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Swarm.MeshNodes
  @moduletag :realtime

  defp hears(node), do: MeshNodes.call(node, Swarm, :status, [node.name]).hears

  test "what a robot says that is not listed is dropped and counted" do
    [one, two] = MeshNodes.start(2, robots: true, mesh: [fleet: ["another_robot"]])

    for node <- [one, two] do
      dropped = fn -> MeshNodes.call(node, Mesh, :rejected, [])[:unknown_robot] || 0 end
      assert eventually(fn -> dropped.() > 5 end)
      assert hears(node) == []
    end
  end

  test "one that is listed is heard, whatever it is called, and hears those that it lists" do
    name = "rover_#{System.unique_integer([:positive])}"
    [one] = MeshNodes.start(1, robots: true, mesh: [fleet: [name]])
    rover = MeshNodes.join([one], String.to_atom(name), robots: true)
    assert eventually(fn -> hears(one) == [rover.name] end)
    assert eventually(fn -> MeshNodes.call(rover, Mesh, :rejected, [])[:unknown_robot] != nil end)
    assert hears(rover) == []
  end
end
