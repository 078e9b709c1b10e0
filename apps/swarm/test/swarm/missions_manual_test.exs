defmodule Swarm.Missions.ManualTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Twist}
  alias Robot.Behaviour.{Follow, Goto}
  alias Robot.Percept
  alias Swarm.Missions.Manual
  doctest Swarm.Missions.Manual

  defp percept(at_ms, peers),
    do: %Percept{robot: :mag1, at_ms: at_ms, profile: Profile.magellan(), peers: peers}

  test "each command is a goal of its own, and its outcome ends it" do
    {:ready, mission, _} = Manual.init(:mag1, [])
    {:goto, mission, effects} = Manual.handle({:command, {:goto, 2.0, 1.0}}, mission)
    assert [{:goal, tag, {Goto, x: 2.0, y: 1.0}}, {:claim, %{phase: :goto}}] = effects

    {:goto, mission, [{:goal, next, _}, _]} =
      Manual.handle({:command, {:goto, 2.0, 1.0}}, mission)

    assert next != tag
    # The outcome of what was replaced is nothing.
    assert {:goto, ^mission, []} = Manual.handle({:outcome, tag, 1}, mission)
    assert {:ready, mission, [{:goal, _, nil}, _]} = Manual.handle({:outcome, next, 1}, mission)
    assert {:ready, _, []} = Manual.handle({:command, :nonsense}, mission)
  end

  test "follows what the other tells, a metre behind, and stands when it falls silent" do
    {:ready, mission, _} = Manual.init(:mag1, [])
    {:follow, mission, _} = Manual.handle({:command, {:follow, :mag2}}, mission)
    peer = %{pose: Pose.new(3, 1, :math.pi() / 2), twist: Twist.new(0.2, 0), at_ms: 500}

    assert {:follow, mission, [{:goal, tag, {Follow, options}}]} =
             Manual.handle({:tick, percept(1_000, %{mag2: peer})}, mission)

    assert Pose.distance(options[:target], {3.0, 0.0}) < 1.0e-9
    assert {_, vy} = options[:velocity]
    assert_in_delta vy, 0.2, 1.0e-9

    assert {:follow, _, [{:goal, ^tag, nil}]} =
             Manual.handle({:tick, percept(1_500, %{mag2: peer})}, mission)
  end
end
