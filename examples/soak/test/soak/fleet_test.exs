defmodule Soak.FleetTest do
  use ExUnit.Case, async: true
  alias Soak.Fleet
  alias Hal.{Pose, Profile, Twist}
  alias Sim.World
  alias Sim.World.Snapshot

  test "a robot that is switched on again is told a start by which it knows where it stands" do
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    body = %{id: :mag1, profile: Profile.magellan(), pose: Pose.new(-1.7, 0.5, 0.3)}
    begun = World.new!(map: map, robots: [body], landmark: {0.0, 0.0})
    driven = World.drive(begun, :mag1, Twist.new(-0.3, 0.4))
    driven = Enum.reduce(1..100, driven, fn _n, world -> World.step(world, 50) end)
    snapshot = Snapshot.of(driven)
    %{pose: pose, odometry: odometry} = driven.robots.mag1
    assert Pose.distance(pose, Pose.new(-1.7, 0.5)) > 0.3

    assert Snapshot.start(snapshot, begun, :mag1, :zero) == pose
    known = Pose.compose(Snapshot.start(snapshot, begun, :mag1, :on), odometry)
    assert Pose.distance(known, pose) < 1.0e-9
    assert abs(Pose.wrap(known.heading - pose.heading)) < 1.0e-9
    assert Fleet.collisions(snapshot, begun) == {0, []}
  end
end
