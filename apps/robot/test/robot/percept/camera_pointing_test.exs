defmodule Robot.Percept.CameraPointingTest do
  @moduledoc "The camera follows (R82); the body turns only when the camera is far off its middle."
  use ExUnit.Case, async: true
  alias Hal.{Pose, Twist}
  alias Robot.Behaviour.{Move, TrackBlob}
  alias Robot.Body
  alias Robot.Control.Controller
  alias Robot.Percept.CameraPointing
  doctest Robot.Percept.CameraPointing

  @degree :math.pi() / 180

  defp tracker(profile \\ Hal.Profile.magellan()) do
    body = Pose.new(0, 0) |> Body.new(profile) |> Body.with_head()

    %{
      body
      | controller: Controller.goal(body.controller, :lead, {TrackBlob, near: 1.0, far: 3.0})
    }
  end

  # On a circle of 2 m round the robot.
  defp at(degrees),
    do: {2 * :math.cos(degrees * @degree), 2 * :math.sin(degrees * @degree)}

  # How far the camera's middle is from the thing, in degrees.
  defp off(body, place),
    do: abs(Pose.wrap(Pose.bearing(body.pose, place) - body.pan)) / @degree

  defp run(body, ticks, place) do
    {nil, body} = Body.run(body, ticks, &Body.see(&1, place))
    body
  end

  test "up to 30 degrees aside the camera turns alone; from there the body does, until it faces the thing" do
    for side <- [-1, 1], aside <- [5, 15, 29] do
      body = run(tracker(), 60, at(side * aside))
      assert body.pose.heading == 0.0
      assert_in_delta body.pan / @degree, side * aside, 1.0
    end

    for side <- [-1, 1] do
      # It has to be in the picture; the camera brings it there.
      body = tracker() |> run(30, at(side * 25)) |> run(80, at(side * 45))
      assert abs(body.pose.heading / @degree - side * 45) < 1.5
      assert_in_delta body.pan / @degree, 0.0, 1.5
    end
  end

  test "a thing that goes round: the camera stays on it while the body swings" do
    body = run(tracker(), 10, at(0))

    {_body, offs, turned} =
      Enum.reduce(1..400, {body, [], 0}, fn k, {body, offs, turned} ->
        # 0.2 rad/s.
        place = at(k * 1.1459)
        next = run(body, 1, place)
        turn? = next.pose.heading != body.pose.heading
        {next, [off(next, place) | offs], if(turn?, do: turned + 1, else: turned)}
      end)

    assert Enum.max(offs) < 6.0
    assert Enum.sum(offs) / length(offs) < 3.0
    assert turned > 100
  end

  test "a robot whose body has another errand than its eyes keeps them on the thing by feeding forward" do
    # The same turn of the body, with the pan told as it is seen and as it will be.
    [plain, fed] =
      for pan <- [fn bearing, _percept -> bearing end, &CameraPointing.pan/2] do
        body = Pose.new(0, 0) |> Body.new() |> Body.with_head()
        goal = {Move, linear: 0.0, turn: 0.4}
        body = %{body | controller: Controller.goal(body.controller, 1, goal)}
        place = at(60)

        {_body, offs} =
          Enum.reduce(1..35, {body, []}, fn k, {body, offs} ->
            percept = Body.percept(body)
            look = pan.(Pose.bearing(percept.pose, place), percept)
            {nil, next} = Body.run(%{body | pan: slew(body.pan, look)}, 1)
            {next, if(k > 20, do: [off(next, place) | offs], else: offs)}
          end)

        Enum.sum(offs) / length(offs)
      end

    assert plain > 2.0
    assert fed < 0.3
  end

  # 80 degrees/s for a tick of 100 ms.
  defp slew(pan, look), do: pan + max(-0.14, min(0.14, look - pan))

  test "it drives facing the thing, and without a pan-tilt unit it turns as before" do
    place = {4.0 * :math.cos(20 * @degree), 4.0 * :math.sin(20 * @degree)}
    body = run(tracker(), 100, place)
    assert abs(Pose.bearing(body.pose, place)) < 3 * @degree
    assert Pose.distance(body.pose, place) < 3.05

    fixed = %{tracker() | pan: nil}
    fixed = run(fixed, 60, at(15))
    assert abs(fixed.pose.heading / @degree - 15) < 1.5
  end

  test "lost: the camera looks where it was, and the body searches as ever" do
    body = run(tracker(), 30, at(20))
    {nil, body} = Body.run(body, 10, &Body.see_nothing/1)
    {nil, found} = Body.run(body, 250, &Body.see(&1, at(-150)))
    assert off(found, at(-150)) < 2.0
    assert Twist.zero?(found.twist)
  end
end
