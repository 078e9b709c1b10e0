defmodule Robot.Localiser.TurnCheckTest do
  @moduledoc "A robot in its own frame looks for a pole, and learns how its wheels slip."
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.{Localiser, Percept}
  alias Robot.Localiser.{Anchors, Belief}
  alias Vision.{Blob, Detections}

  @view :math.pi() / 3
  @focal 160 / :math.tan(:math.pi() / 6)
  @distance 3.0
  @standing %Anchors{standing: "Y"}

  # A picture from the true pose, and the odometry that goes with it.
  defp percept(odometry, truth, pole, at_ms, view) do
    %Percept{
      robot: :mag1,
      at_ms: at_ms,
      profile: Profile.magellan(),
      odometry: %Odometry{pose: odometry, twist: Twist.zero()},
      ptz: %{pan: 0.0, tilt: 0.0, field_of_view: view},
      detections: %Detections{at_ms: at_ms, blobs: blobs(truth, pole)}
    }
  end

  # By the pinhole, from the outside; the pole is so near that top and bottom are cut off.
  defp blobs(truth, pole) do
    bearing = Pose.bearing(truth, pole)
    half = @focal * 0.15 / Pose.distance(truth, pole)
    x = 159.5 - @focal * :math.tan(bearing)
    {left, right} = {max(round(x - half), 0), min(round(x + half), 319)}

    if abs(bearing) < 1.0 and left < right do
      [
        %Blob{
          colour: "Y",
          area: 9_000,
          share: 0.1,
          x: (left + right) / 2,
          y: 119.5,
          left: left,
          right: right,
          top: 0,
          bottom: 239,
          width: 320,
          height: 240,
          clipped?: true
        }
      ]
    else
      []
    end
  end

  # Turns by 1.2 rad by odometry, at 0.7 rad/s, and stands for 1.5 s; the pole is straight ahead in
  # the end. `slip` is the share by which it turns farther left and less far right.
  defp search(side, slip, options \\ []) do
    anchors = Keyword.get(options, :anchors, @standing)
    way = Keyword.get(options, :way, 0.0)
    drift = Keyword.get(options, :drift, 0.0)
    view = Keyword.get(options, :view, @view)
    more = 1 + side * slip
    target = side * 1.2 * more

    Enum.reduce(0..32, Localiser.new(Pose.new(0, 0)), fn k, localiser ->
      angle = side * min(0.07 * k, 1.2)
      at = way * min(k, 17) / 17
      direction = target + drift * (k - 32) / 10
      pole = {@distance * :math.cos(direction), @distance * :math.sin(direction)}
      truth = Pose.new(at, 0, angle * more)

      {_percept, localiser} =
        localiser
        |> Localiser.anchors(anchors)
        |> Localiser.update(percept(Pose.new(at, 0, angle), truth, pole, 100 * k, view))

      localiser
    end).belief
  end

  for {side, name} <- [{1, "left"}, {-1, "right"}], slip <- [0.055, -0.08, 0.0] do
    test "turning #{name} by odometry, it finds that it slips by #{slip}" do
      {side, slip} = {unquote(side), unquote(slip)}
      belief = search(side, slip)
      assert_in_delta belief.slip, slip, Belief.slip_sd(belief)
      assert Belief.slip_sd(belief) < 0.04

      # So it knows its heading, too, which would be off by the slip of the whole turn.
      truth = side * 1.2 * (1 + side * slip)
      error = Pose.wrap(belief.pose.heading - truth)
      {_worst, _least, sd} = Belief.sd(belief)
      assert abs(error) < 0.4 * 1.2 * abs(slip) + 0.005
      assert abs(error) < 1.5 * sd
      assert sd < 0.05
    end
  end

  test "a lens that is not quite what was said does not make it surer than it is" do
    for share <- [0.97, 1.03] do
      belief = search(1, 0.0, view: share * @view)
      assert abs(belief.slip) < 1.0 * Belief.slip_sd(belief)
    end
  end

  test "an object that moves is not taken for slip" do
    for drift <- [-0.1, -0.03, 0.03, 0.1] do
      belief = search(1, 0.0, drift: drift)
      assert belief.slip == 0.0
      assert_in_delta Belief.slip_sd(belief), 0.056, 0.001
    end
  end

  test "a robot that drives learns nothing of its turns" do
    assert search(1, 0.055, way: 0.2).slip == 0.0
  end

  test "nothing is learnt from an object of which nobody said that it stands" do
    assert search(1, 0.055, anchors: %Anchors{}).slip == 0.0
    assert search(1, 0.055, anchors: %Anchors{standing: "R"}).slip == 0.0
  end

  test "nothing is learnt in another robot's frame" do
    frame = %{
      key: {:mag2, 1, 1},
      base: nil,
      at: {1.0, 0.0},
      position: 0.0,
      heading: 0.0,
      start: {0.0, 0.0},
      drift: {0.0, 0.0, 0.0},
      slip: 0.0
    }

    assert search(1, 0.055, anchors: %Anchors{frame: frame, standing: "Y"}).slip == 0.0
  end
end
