defmodule Robot.Localiser.RingCheckTest do
  @moduledoc "A robot turns on the spot among walls, and learns by its sonars how its wheels slip."
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.{Localiser, Percept}
  alias Robot.Localiser.{Anchors, Belief}

  @step 0.05
  # Half the width and the height of the room (metres).
  @room {2.2, 1.4}

  # A room that echoes, by how far it is to its wall from the true pose.
  defp range(%Pose{} = from, {half_width, half_height}) do
    along = fn
      _at, way, _half when way == 0 -> 9.0
      at, way, half when way > 0 -> (half - at) / way
      at, way, half -> (-half - at) / way
    end

    min(
      along.(from.x, :math.cos(from.heading), half_width),
      along.(from.y, :math.sin(from.heading), half_height)
    )
    |> min(5.0)
  end

  defp sonar(profile, truth, room) do
    for {mount, k} <- Enum.with_index(profile.sonars) do
      # A centimetre more or less, the same in each run.
      off = (rem(k * 7 + round(truth.heading * 100), 5) - 2) / 200
      if is_function(room), do: room.(k), else: range(Pose.compose(truth, mount), room) + off
    end
  end

  # Turns left by this angle by odometry, stands for half a second; what is believed then.
  defp turned(slip, options) do
    profile = Keyword.get(options, :profile, Profile.magellan())
    room = Keyword.get(options, :room, @room)
    way = Keyword.get(options, :way, 0.0)
    anchors = Keyword.get(options, :anchors, %Anchors{})
    steps = round(Keyword.get(options, :turn, 6.4) / @step)
    localiser = Pose.new(0.3, 0.2) |> Localiser.new() |> Localiser.anchors(anchors)

    Enum.reduce(0..(steps + 5), localiser, fn k, localiser ->
      turning? = k <= steps
      heading = @step * min(k, steps)
      truth = Pose.new(0.3 + way * k, 0.2, heading * (1 + slip))
      twist = Twist.new(0.0, if(turning?, do: 10 * @step, else: 0.0))

      percept = %Percept{
        robot: :mag1,
        at_ms: 100 * k,
        profile: profile,
        odometry: %Odometry{pose: Pose.new(way * k, 0.0, heading), twist: twist},
        sonar: sonar(profile, truth, room)
      }

      {_percept, localiser} = Localiser.update(localiser, percept)
      localiser
    end).belief
  end

  for {name, profile} <- [magellan: Profile.magellan(), atrv_mini: Profile.atrv_mini()],
      slip <- [-0.055, 0.0, 0.02, 0.055] do
    @profile profile
    @slip slip
    test "#{name}: a full turn shows a slip of #{slip}, and takes back what it has turned the heading" do
      belief = turned(@slip, profile: @profile)
      assert_in_delta belief.slip, @slip, 0.008
      assert Belief.slip_sd(belief) < 0.015
      assert_in_delta Pose.wrap(belief.pose.heading - 6.4 * (1 + @slip)), 0.0, 0.06
    end
  end

  test "most of a turn is enough when the robot stands" do
    belief = turned(0.04, turn: 5.2)
    assert_in_delta belief.slip, 0.04, 0.008
    assert Belief.slip_sd(belief) < 0.015
  end

  test "less of a turn says nothing" do
    assert turned(0.04, turn: 4.6).slip == 0.0
  end

  test "nothing is learned where nothing echoes, or the same from all sides" do
    assert turned(0.04, room: fn _sonar -> 5.0 end).slip == 0.0
    assert turned(0.04, room: fn _sonar -> 1.5 end).slip == 0.0
  end

  test "nothing is learned where few of the sonars hear anything" do
    assert turned(0.04, room: fn sonar -> if(sonar in [3, 4], do: 1.5, else: 5.0) end).slip == 0.0
  end

  test "nothing is learned by a robot that drives meanwhile" do
    assert turned(0.04, way: 0.01).slip == 0.0
  end

  test "a leader does not correct itself, because all that follow it would have to move" do
    assert turned(0.04, anchors: %Anchors{walls?: false}).slip == 0.0
  end
end
