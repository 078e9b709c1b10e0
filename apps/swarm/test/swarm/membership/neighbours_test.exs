defmodule Swarm.Membership.NeighboursTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Swarm.Membership.Neighbours
  doctest Swarm.Membership.Neighbours

  test "neighbours are those in range, in the order of their names" do
    poses = %{mag2: Pose.new(0, 2), mag1: Pose.new(1, 0), min1: Pose.new(4, 0)}
    near = Neighbours.near(poses, Pose.new(0, 0), 3)
    assert [:mag1, :mag2] = Keyword.keys(near)
    assert_in_delta near[:mag2].bearing, :math.pi() / 2, 0.001
    assert Neighbours.near(poses, nil, 3) == []
    assert Neighbours.reduce([], 7, fn _, _, _ -> 8 end) == 7
  end
end
