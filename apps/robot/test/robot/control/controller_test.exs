defmodule Robot.Control.ControllerTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Twist}
  alias Robot.Body
  alias Robot.Control.Controller
  alias Robot.Behaviour.{FindBlob, Follow, Goto, Move, Stop, TrackBlob}

  defp with_goal(body, tag, goal),
    do: %{body | controller: Controller.goal(body.controller, tag, goal)}

  test "goes to any place from any pose, says so once, and then rests" do
    for _ <- 1..60 do
      profile = Enum.random([Profile.magellan(), Profile.atrv_mini()])
      start = Pose.new(6 * :rand.uniform() - 3, 6 * :rand.uniform() - 3, 6.3 * :rand.uniform())
      goal = {Goto, x: 1.0, y: -0.5, heading: 1.0}
      body = start |> Body.new(profile) |> with_goal(:there, goal)
      assert {{:there, 1}, body} = Body.run(body, 400)
      assert Pose.distance(body.pose, {1.0, -0.5}) < 0.21
      assert abs(Pose.wrap(body.pose.heading - 1.0)) < 0.1
      {nil, body} = body |> with_goal(:there, goal) |> Body.run(20)
      assert body.controller.last_by == :rest
      assert Twist.zero?(body.twist)
    end
  end

  test "a goal right here ends at once, one right behind is reached by turning left" do
    assert {{1, 1}, %{at_ms: 100}} =
             Pose.new(1, 1) |> Body.new() |> with_goal(1, {Goto, x: 1.0, y: 1.0}) |> Body.run(9)

    body = Pose.new(0, 0) |> Body.new() |> with_goal(1, {Goto, x: -2.0, y: 0.0})
    {nil, body} = Body.run(body, 5)
    assert body.twist.turn > 0.3
    assert body.twist.linear == 0.0
  end

  test "looks where the mission says, unless the behaviour looks somewhere itself" do
    body = Body.new(Pose.new(0, 0))
    {controller, 0.5} = Controller.obey(body.controller, {:look, 0.5})
    assert {^controller, nil} = Controller.obey(controller, {:look, 0.5})
    {%{look: 0.5}, nil, controller} = Controller.tick(controller, Body.percept(body))

    goal = {Robot.Acts.Roll, twist: Twist.zero()}
    {controller, nil} = Controller.obey(controller, {:goal, :roll, goal})
    {%{look: 0.25}, nil, controller} = Controller.tick(controller, Body.percept(body))
    # Not before the behaviour has its next say.
    assert {%{look: -0.5} = controller, nil} = Controller.obey(controller, {:look, -0.5})

    {controller, nil} = Controller.obey(controller, {:goal, :roll, nil})
    {%{look: -0.5}, nil, controller} = Controller.tick(controller, Body.percept(body))

    {%{look: nil}, nil, _} =
      controller |> Controller.stand() |> Controller.tick(Body.percept(body))
  end

  test "says that its goal's wish was slowed down by caution, and only then" do
    %{controller: controller} =
      body = Pose.new(0, 0) |> Body.new() |> with_goal(1, {Goto, x: 5.0, y: 0.0})

    far = %{pose: Pose.new(0, 9), twist: Twist.zero(), radius: 0.2, at_ms: 0, mode: :holding}

    for {lost?, speed, limits} <- [{false, 0.5, []}, {true, 0.2, [:caution]}] do
      unsure = %{radius: 4.0, lost?: lost?}
      percept = %{Body.percept(body) | peers: %{mag2: far}, uncertainty: unsure}
      {wish, nil, controller} = Controller.tick(controller, percept)
      assert {wish.twist.linear, Controller.limits(controller)} == {speed, limits}
      assert Controller.limits(Controller.stand(controller)) == []
    end
  end

  test "without a pose it stands and waits" do
    body = Pose.new(0, 0) |> Body.new() |> with_goal(1, {Goto, x: 2.0, y: 0.0})
    {nil, body} = Body.run(body, 20, &%{&1 | pose: nil})
    assert body.pose == Pose.new(0, 0)
  end

  test "follows a place that moves, and stands precisely when it stands" do
    for _ <- 1..30 do
      start = Pose.new(-1, 2 * :rand.uniform() - 1, 6.3 * :rand.uniform())

      place = fn at_ms ->
        s = min(at_ms / 1000, 20.0)
        {Pose.new(0.25 * s, 0.02 * s, 0.08), if(s < 20, do: {0.25, 0.02}, else: {0.0, 0.0})}
      end

      body =
        Enum.reduce(1..350, Body.new(start), fn _, body ->
          {target, velocity} = place.(body.at_ms)
          body = with_goal(body, :slot, {Follow, target: target, velocity: velocity})
          {nil, body} = Body.run(body, 1)
          if body.at_ms in 17_000..19_500, do: assert(Pose.distance(body.pose, target) < 0.2)
          body
        end)

      assert Pose.distance(body.pose, {5.0, 0.4}) < 0.05
      assert abs(Pose.wrap(body.pose.heading - 0.08)) < 0.05
      assert Twist.zero?(body.twist)
    end
  end

  test "in place, a wobbling pose moves nothing" do
    target = Pose.new(1, 0, 0.0)
    body = Pose.new(0, 0) |> Body.new() |> with_goal(:slot, {Follow, target: target})
    {nil, body} = Body.run(body, 100)
    wobble = fn p -> %{p | pose: %{p.pose | x: p.pose.x + 0.05 * (:rand.uniform() - 0.5)}} end
    {nil, after_wobble} = Body.run(body, 100, wobble)
    assert after_wobble.pose == body.pose
  end

  test "finds a blob wherever it is, and points at it" do
    for _ <- 1..40 do
      profile = Enum.random([Profile.magellan(), Profile.atrv_mini()])
      start = Pose.new(0, 0, 6.3 * :rand.uniform())
      body = start |> Body.new(profile) |> with_goal(:find, {FindBlob, colour: "Yellow"})
      assert {{:find, 1}, body} = Body.run(body, 150, &Body.see(&1, {2.0, 1.0}))
      assert abs(Pose.bearing(body.pose, {2.0, 1.0})) < 0.06
    end
  end

  test "finds nothing in one full turn" do
    body = Pose.new(0, 0) |> Body.new() |> with_goal(:find, {FindBlob, colour: "Yellow"})
    assert {{:find, 0}, body} = Body.run(body, 150, &Body.see_nothing/1)
    assert body.at_ms in 8000..11_000
    # Another colour is nothing either; wheels that are held end by the time-out.
    other = fn p -> %{Body.see(p, {2.0, 0.0}) | pose: nil} end
    red = Pose.new(0, 0) |> Body.new() |> with_goal(:find, {FindBlob, colour: "Red"})
    assert {{:find, 0}, _} = Body.run(red, 200, other)
    held = Pose.new(0, 0) |> Body.new() |> with_goal(:find, {FindBlob, []})
    assert {{:find, 0}, _} = Body.run(held, 200, &%{Body.see_nothing(&1) | odometry: nil})
  end

  test "keeps a blob centred and at its distance without hunting" do
    body = Pose.new(0, 0, 2.0) |> Body.new() |> with_goal(:lead, {TrackBlob, colour: "Yellow"})
    see = &Body.see(&1, {3.0, 1.0}, 3 * (:rand.uniform() - 0.5))
    # It has to be in the picture once.
    body = %{body | pose: Pose.new(0, 0, 0.0)}
    {nil, body} = Body.run(body, 150, see)
    distance = Pose.distance(body.pose, {3.0, 1.0})
    assert distance > 1.2 and distance < 1.52
    # Within its dead zone and the noise of the picture; of 300 seeds the worst was 0.034.
    assert abs(Pose.bearing(body.pose, {3.0, 1.0})) < 0.04

    {nil, later} = Body.run(body, 100, see)
    assert Pose.distance(body.pose, later.pose) < 0.02
    assert abs(Pose.wrap(later.pose.heading - body.pose.heading)) < 0.03
  end

  test "tracks a thing that moves, backs off when it comes near, and looks for it when lost" do
    body = Pose.new(0, 0) |> Body.new() |> with_goal(:lead, {TrackBlob, []})
    {nil, body} = Body.run(body, 50, &Body.see(&1, {1.2, 0.0}))
    assert body.pose.x == 0.0

    {nil, body} = Body.run(body, 100, &Body.see(&1, {0.6, 0.0}))
    assert body.pose.x < -0.35

    circle = fn p ->
      Body.see(p, {2 * :math.cos(p.at_ms / 10_000), 2 * :math.sin(p.at_ms / 10_000)})
    end

    start = Pose.new(0, 0) |> Body.new() |> with_goal(:lead, {TrackBlob, []})
    {nil, body} = Body.run(start, 300, circle)
    place = {2 * :math.cos(body.at_ms / 10_000), 2 * :math.sin(body.at_ms / 10_000)}
    assert abs(Pose.bearing(body.pose, place)) < 0.15
    # Suddenly behind: found again by turning on.
    place = Pose.place(body.pose, {-2.0, 0.5})
    {nil, body} = Body.run(body, 200, &Body.see(&1, place))
    assert abs(Pose.bearing(body.pose, place)) < 0.05
  end

  test "turns to where a thing is known to stand, which it has not seen itself, and no further" do
    for place <- [{1.0, 1.6}, {-1.5, -0.4}] do
      goal = {TrackBlob, near: 1.5, far: 2.5, place: place}
      body = Pose.new(0, 0) |> Body.new() |> with_goal(:lead, goal)
      assert Body.see(Body.percept(body), place).detections.blobs == []
      {nil, body} = Body.run(body, 90, &Body.see(&1, place))
      assert abs(Pose.bearing(body.pose, place)) < 0.05
    end

    # One that is told nothing stands.
    body = Pose.new(0, 0) |> Body.new() |> with_goal(:lead, {TrackBlob, []})
    {nil, body} = Body.run(body, 90, &Body.see(&1, {1.0, 1.6}))
    assert body.pose == Pose.new(0, 0)
  end

  test "stop outweighs, and another tag starts afresh" do
    body = Pose.new(0, 0) |> Body.new() |> with_goal(1, {Move, linear: 0.3, turn: 0.0})
    {nil, body} = Body.run(body, 20)
    assert body.twist.linear == 0.3
    {nil, body} = body |> with_goal(2, {Stop, []}) |> Body.run(20)
    assert Twist.zero?(body.twist)
    assert body.controller.last_by == :stop
    {nil, body} = body |> with_goal(3, nil) |> Body.run(1)
    assert body.controller.last_by == :rest
  end

  test "backs off from what it touched" do
    body = Pose.new(0, 0) |> Body.new() |> with_goal(1, {Move, linear: 0.3, turn: 0.0})
    touch = fn p -> if p.at_ms < 100, do: %{p | bumpers: [0]}, else: p end
    {nil, body} = Body.run(body, 20, touch)
    assert body.pose.x < -0.1
  end

  test "wrong options say what is allowed" do
    assert_raise ArgumentError, ~r/option x: expected .*, got :a/, fn -> Goto.new(x: :a, y: 1) end
    assert_raise ArgumentError, ~r/option target/, fn -> Follow.new(target: 1) end

    assert_raise ArgumentError, ~r/color is not known: allowed are colour/, fn ->
      FindBlob.new(color: "Red")
    end

    assert_raise ArgumentError, ~r/place: expected .*, got 1/, fn -> TrackBlob.new(place: 1) end
    assert_raise ArgumentError, ~r/near/, fn -> TrackBlob.new(near: 2.0, far: 1.0) end
    assert_raise ArgumentError, ~r/profile/, fn -> Controller.new([]) end
  end
end
