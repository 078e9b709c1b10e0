defmodule Sim.World.CameraViewTest do
  @moduledoc """
  The parts of a world that are sent give the same pictures, and the same world, as the world
  itself.
  """
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Twist}
  alias Sim.World
  alias Sim.World.{CameraView, Snapshot}

  setup do
    {:ok, map} = Sim.Floorplan.open("hall", 3)
    profiles = [mag1: Profile.magellan(), mag2: Profile.magellan(), min1: Profile.atrv_mini()]

    robots =
      for {{id, profile}, k} <- Enum.with_index(profiles),
          do: %{id: id, profile: profile, pose: Pose.new(-3, k * 1.5 - 1.5, 0.2 * k)}

    world = World.new!(map: map, robots: robots, landmark: {0.0, 0.0}, seed: 5)
    %{begun: world, later: run(world)}
  end

  defp run(world) do
    world = World.move_landmark(world, {1.0, 0.5})

    world =
      for id <- world.order, reduce: world, do: (w -> World.drive(w, id, Twist.new(0.3, 0.1)))

    world = World.look(world, :mag1, 0.4, 0.1)
    Enum.reduce(1..30, world, fn _, w -> World.step(w) end)
  end

  test "a camera paints from ground and moving parts what it would paint in the world", %{
    begun: begun,
    later: later
  } do
    for id <- later.order do
      moving = CameraView.moving(later, CameraView.poses(later), id)
      seen = begun |> CameraView.ground(id) |> CameraView.world(moving, id)
      assert World.frame(seen, id) == World.frame(later, id)
      assert World.detections(seen, id) == World.detections(later, id)
    end
  end

  test "the moving part is small, however large the map", %{later: later} do
    moving = CameraView.moving(later, CameraView.poses(later), :mag1)
    assert byte_size(:erlang.term_to_binary(moving)) < 300
    assert byte_size(:erlang.term_to_binary(Snapshot.of(later))) < 3_000
    assert byte_size(:erlang.term_to_binary(later)) > 80_000
  end

  test "a world that goes on from its snapshot is the same world", %{begun: begun, later: later} do
    again = Snapshot.onto(begun, Snapshot.of(later))
    assert World.step(again) == World.step(later)
    assert run(again) == run(later)

    dead = World.kill(later, :min1)
    refute begun |> Snapshot.onto(Snapshot.of(dead)) |> World.alive?(:min1)
  end
end
