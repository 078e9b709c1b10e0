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
    {:goto, mission, effects} = Manual.handle({:command, {:goto, 2.0, 1.0, nil}}, mission)
    assert [{:goal, tag, {Goto, x: 2.0, y: 1.0}}, {:claim, %{phase: :goto}}] = effects

    {:goto, mission, [{:goal, next, _}, _]} =
      Manual.handle({:command, {:goto, 2.0, 1.0, nil}}, mission)

    assert next != tag
    # The outcome of what was replaced is nothing.
    assert {:goto, ^mission, []} = Manual.handle({:outcome, tag, 1}, mission)
    assert {:ready, mission, [{:goal, _, nil}, _]} = Manual.handle({:outcome, next, 1}, mission)
    assert {:ready, _, []} = Manual.handle({:command, :nonsense}, mission)
  end

  test "every command that moves a robot is one of its" do
    for text <- ~w(goto:1:2 goto:1:2:3 move:0.1:0 findblob findblob:Red lead follow:1:2:0
          followtheleader:mag2) do
      {:ok, command} = Robot.Command.parse(text, [:mag2])
      assert Manual.command?(command)
      {:ready, mission, _} = Manual.init(:mag1, [])

      assert {_phase, _, [{:goal, tag, goal}, {:claim, _}]} =
               Manual.handle({:command, command}, mission)

      # The options are those of the behaviour.
      with {module, options} <- goal, do: assert({^module, _} = module.new(options))
      assert tag != :ready
    end

    for text <-
          ~w(start stop ping subscribe:mag2 position:1:2:3 blob:1:2:3:0.1:1) do
      {:ok, command} = Robot.Command.parse(text, [:mag2])
      refute Manual.command?(command)
    end
  end

  test "follows what the other tells, a metre behind, and stands when it falls silent" do
    {:ready, mission, _} = Manual.init(:mag1, [])

    {:follow_the_leader, mission, _} =
      Manual.handle({:command, {:follow_the_leader, :mag2}}, mission)

    peer = %{pose: Pose.new(3, 1, :math.pi() / 2), twist: Twist.new(0.2, 0), at_ms: 500}

    assert {:follow_the_leader, mission, [{:goal, tag, {Follow, options}}]} =
             Manual.handle({:tick, percept(1_000, %{mag2: peer})}, mission)

    assert Pose.distance(options[:target], {3.0, 0.0}) < 1.0e-9
    assert {_, vy} = options[:velocity]
    assert_in_delta vy, 0.2, 1.0e-9

    assert {:follow_the_leader, _, [{:goal, ^tag, nil}]} =
             Manual.handle({:tick, percept(1_500, %{mag2: peer})}, mission)
  end
end
