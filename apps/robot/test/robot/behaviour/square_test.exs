defmodule Robot.Behaviour.SquareTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Robot.Percept
  alias Robot.Behaviour.Square

  defp percept(pose, tick),
    do: %Percept{robot: :mag1, at_ms: tick * 100, profile: Profile.magellan(), pose: pose}

  # 100 ms a tick, on wheels that do at once what they are told.
  defp drive(behaviour, pose, way, tick \\ 0) do
    case Robot.Behaviour.tick(behaviour, percept(pose, tick)) do
      {:running, wish, behaviour} when tick < 2_000 ->
        step = Pose.new(wish.twist.linear * 0.1, 0, wish.twist.turn * 0.1)
        drive(behaviour, Pose.compose(pose, step), [pose | way], tick + 1)

      {:done, outcome, _wish} ->
        {outcome, pose, way}
    end
  end

  test "it has been at every corner, to its left, and comes back" do
    start = Pose.new(3, 1, 1.0)
    assert {1, pose, way} = drive(Square.new(side: 2.0), start, [])
    assert Pose.distance(pose, start) < 0.11

    for corner <- [{2.0, 0.0}, {2.0, 2.0}, {0.0, 2.0}],
        do: assert(Enum.any?(way, &(Pose.distance(&1, Pose.place(start, corner)) < 0.11)))
  end

  test "without a pose it stands; a corner that cannot be reached ends it" do
    assert {:running, %{twist: twist}, square} =
             Robot.Behaviour.tick(Square.new([]), percept(nil, 0))

    assert twist == Hal.Twist.zero()
    {:running, _wish, square} = Robot.Behaviour.tick(square, percept(Pose.new(0, 0), 1))
    square = Robot.Behaviour.routed(square, :no_way, percept(Pose.new(0, 0), 1))
    assert {:done, 0, _wish} = Robot.Behaviour.tick(square, percept(Pose.new(0, 0), 2))
  end

  test "a wrong side is refused by name" do
    assert_raise ArgumentError, ~r/square option side: expected .*, got 99/, fn ->
      Square.new(side: 99)
    end
  end
end
