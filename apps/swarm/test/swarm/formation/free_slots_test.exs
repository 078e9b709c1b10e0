defmodule Swarm.Formation.FreeSlotsTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Swarm.Formation
  alias Swarm.Formation.{FreeSlots, Trail}

  test "no used slot is near a body, each is used once, and all robots have one" do
    for _ <- 1..100 do
      formation = {Enum.random(Formation.kinds()), 1.0}
      followers = :rand.uniform(8) - 1
      pose = Pose.new(:rand.uniform() * 4, :rand.uniform() * 4, 6 * :rand.uniform())
      bodies = for _ <- 1..3, do: {:rand.uniform() * 6, :rand.uniform() * 6, 0.2}
      {size, places} = FreeSlots.places(formation, followers, pose, 1.6, bodies, 0.2)
      assert length(places) == followers
      assert places == Enum.uniq(places)
      slots = Formation.slots(formation, size, 1.6)

      for place <- places,
          do: assert(FreeSlots.free?(Pose.compose(pose, Enum.at(slots, place - 1)), bodies, 0.2))
    end
  end

  test "if there is no room at all, the shape is used as it is" do
    wall = for x <- -40..40, do: {x * 0.5, 0.0, 5.0}

    assert FreeSlots.places({:column, 1.0}, 2, Pose.new(0, 0), 1.6, wall, 0.2) ==
             FreeSlots.whole(2)
  end

  test "places along a trail lie on it, one behind the other" do
    way = for k <- 0..50, do: Pose.new(k * 0.1, :math.sin(k * 0.1), 0.0)
    trail = Enum.reduce(way, [], &Trail.note(&2, &1))
    pose = List.last(way)

    for back <- [0.5, 1.0, 2.5, 4.0] do
      place = Trail.behind(trail, pose, back)
      assert Enum.any?(way, &(Pose.distance(&1, place) < 0.06))
      assert abs(Pose.wrap(place.heading - :math.atan(:math.cos(place.x)))) < 0.1
    end
  end

  test "a trail is extended straight beyond its end" do
    trail = Enum.reduce(0..999, [], &Trail.note(&2, Pose.new(&1 * 0.2, 0)))
    assert length(trail) == 400
    assert Pose.distance(Trail.behind(trail, Pose.new(199.8, 0), 150.0), {49.8, 0.0}) < 1.0e-6
  end
end
