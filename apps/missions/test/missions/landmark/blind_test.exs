defmodule Missions.Landmark.BlindTest do
  @moduledoc "A robot without pictures among others."
  use ExUnit.Case, async: true
  alias Missions.Landmark.{Group, LandmarkTrack}

  @robots [:mag1, :mag2, :mag3]

  test "it goes to the end of the order, behind whom nobody finds its place by it, and stays there" do
    group =
      Group.new()
      |> Group.join(:mag1, {0, 0}, 0.02)
      |> Group.join(:mag2, {-1, 0}, nil)
      |> Group.join(:mag3, {-2, 0}, nil)

    {true, group} = Group.until(group, 20, &Group.one?(&1, @robots))
    order = fn group -> group.robots.mag1.mission.order end
    group = Group.run(group, 2)
    assert order.(group) == [:mag2, :mag3]

    group = group |> Group.show(:mag2, :dark) |> Group.run(4)
    assert order.(group) == [:mag2, :mag3]
    group = Group.run(group, 2)
    assert group.robots.mag2.claim.blind
    assert order.(group) == [:mag3, :mag2]

    group = group |> Group.show(:mag2, nil) |> Group.run(3)
    refute group.robots.mag2.claim.blind
    assert order.(group) == [:mag3, :mag2]
  end

  test "a camera that is late for less than 5 s is none that is dark" do
    assert [false, false, true] = for(ms <- [0, 4_900, 5_000], do: LandmarkTrack.blind?(0, ms))
    refute LandmarkTrack.blind?(nil, 10_000)
  end
end
