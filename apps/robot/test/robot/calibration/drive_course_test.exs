defmodule Robot.Behaviour.DriveCourseTest do
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.Percept
  alias Robot.Calibration.DriveCourse

  # Wheels that do what is wished, 100 ms later.
  defp drive(legs, options \\ []) do
    stuck? = Keyword.get(options, :stuck?, false)

    s = %{
      course: DriveCourse.new(legs: legs, speed: 0.3),
      pose: Pose.new(1, 2, 0.5),
      twist: Twist.zero()
    }

    Enum.reduce_while(0..20_000, Map.put(s, :turned, 0.0), fn n, s ->
      odometry = unless options[:blind?], do: %Odometry{pose: s.pose, twist: s.twist}
      bumpers = if options[:touch_at] == n, do: [0], else: []

      percept = %Percept{
        robot: :mag1,
        at_ms: 100 * n,
        profile: Profile.magellan(),
        odometry: odometry,
        bumpers: bumpers
      }

      case Robot.Behaviour.tick(s.course, percept) do
        {:done, outcome, wish} ->
          assert Twist.zero?(wish.twist)
          {:halt, {outcome, 100 * n, Pose.relative(Pose.new(1, 2, 0.5), s.pose), s.turned}}

        {:running, %{twist: twist}, course} ->
          assert abs(twist.linear) <= 0.3 and abs(twist.turn) <= 1.0
          assert twist.linear == 0.0 or abs(twist.turn) < 0.3
          twist = if stuck?, do: Twist.zero(), else: twist
          turn = twist.turn * 0.1
          middle = s.pose.heading + turn / 2
          x = s.pose.x + twist.linear * 0.1 * :math.cos(middle)
          y = s.pose.y + twist.linear * 0.1 * :math.sin(middle)
          pose = Pose.new(x, y, s.pose.heading + turn)
          {:cont, %{s | course: course, pose: pose, twist: twist, turned: s.turned + turn}}
      end
    end)
  end

  test "a straight way" do
    assert {1, at_ms, pose, _turned} = drive(go: 3.0)
    assert at_ms in 9_000..16_000
    assert_in_delta pose.x, 3.0, 0.02
    assert_in_delta pose.y, 0.0, 0.01
  end

  test "more than a whole turn, to either side" do
    for turn <- [4 * :math.pi(), -4 * :math.pi(), 0.3, -2.9] do
      assert {1, _at_ms, pose, turned} = drive(turn: turn)
      assert_in_delta turned, turn, 0.02
      assert_in_delta pose.x, 0.0, 1.0e-9
    end
  end

  test "a square ends where it began, as it began" do
    for direction <- [:cw, :ccw] do
      legs = Robot.Calibration.Drive.legs({:square, direction, 2.0})
      assert {1, _at_ms, pose, turned} = drive(legs)
      assert Pose.distance(pose, {0.0, 0.0}) < 0.05
      assert_in_delta abs(turned), 2 * :math.pi(), 0.02
    end
  end

  test "what is touched, held or blind ends it" do
    assert {2, 500, _pose, _turned} = drive([go: 3.0], touch_at: 5)
    assert {2, at_ms, _pose, _turned} = drive([go: 3.0], stuck?: true)
    assert at_ms in 5_000..5_200
    assert {2, 5_100, _pose, _turned} = drive([go: 3.0], blind?: true)

    assert_raise ArgumentError, ~r/option legs: expected/, fn ->
      DriveCourse.new(legs: [go: 0])
    end

    assert_raise ArgumentError, ~r/option legs: expected/, fn -> DriveCourse.new(legs: []) end
  end
end
