defmodule Missions.WireTest do
  # Its nodes are VMs of their own, with names and ports of their own: nothing of this VM is shared.
  use ExUnit.Case, async: true
  alias Swarm.MeshNodes, as: Cluster

  test "a node that has just started understands all messages of a moving fleet" do
    [one] = Cluster.start(1, robots: true)

    anchor = %Missions.Landmark.Reference{
      leader: one.name,
      epoch: 1,
      sequence: 1,
      pose: {0, 0, 0},
      twist: {0, 0},
      formation: {:diamond, 1.0},
      order: [],
      size: 1,
      places: []
    }

    sight = %{size_ppm: 9_000, distance: 3_000}
    beat = Missions.Landmark.Beat.new(phase: :lead, sight: sight, anchor: anchor)

    letters =
      for phase <- Missions.Landmark.Transitions.phases(),
          do: Swarm.Message.new(one.name, :heartbeat, %{beat | phase: phase})

    place = Missions.Landmark.Beat.pass_on(one.name, %{anchor | landmark: {0, 0}, still: true})

    for message <- [place | letters] do
      payload = Mesh.Protocol.Packet.pack({:all, message})
      assert {:ok, _} = Cluster.call(one, Mesh.Protocol.Packet, :unpack, [payload])
    end
  end
end
