defmodule Robot.Behaviour.VelocityTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Twist}
  alias Robot.Percept
  alias Robot.Behaviour.Velocity

  defp wish(velocity, pose) do
    percept = %Percept{robot: :mag1, at_ms: 0, profile: Profile.magellan(), pose: pose}

    {:running, wish, {Velocity, _state}} =
      Robot.Behaviour.tick(Velocity.new(velocity: velocity), percept)

    wish
  end

  test "it drives along the velocity, and turns toward it first" do
    along = wish({0.0, 0.3}, Pose.new(0, 0, :math.pi() / 2))
    assert_in_delta along.twist.linear, 0.3, 1.0e-6
    assert along.velocity == {0.0, 0.3} and along.goal == nil
    aside = wish({0.0, 0.3}, Pose.new(0, 0, 0))
    assert aside.twist.linear == 0.0 and aside.twist.turn > 0.5
  end

  test "a velocity of next to nothing is none, and without a pose it stands" do
    for {velocity, pose} <- [{{0.01, -0.01}, Pose.new(0, 0, 1.0)}, {{0.3, 0.0}, nil}] do
      assert %{twist: %Twist{linear: +0.0, turn: +0.0}, velocity: {+0.0, +0.0}} =
               wish(velocity, pose)
    end
  end

  test "the velocity changes while it runs, and junk is refused" do
    changed = Robot.Behaviour.update(Velocity.new(velocity: {0.1, 0.0}), velocity: {0.2, 0.0})
    assert changed == Velocity.new(velocity: {0.2, 0.0})

    for junk <- [nil, {1, :east}, {1.0e3, 0}, [0, 1]] do
      assert {:error, line} = Robot.Behaviour.check({Velocity, velocity: junk})
      assert line =~ "velocity option velocity: expected"
    end
  end
end
