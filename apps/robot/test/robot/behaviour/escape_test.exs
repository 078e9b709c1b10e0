defmodule Robot.Behaviour.EscapeTest do
  @moduledoc "What is touched, for a moment or for ever; controller and gate in lockstep, ten ticks a second."
  use ExUnit.Case, async: true
  alias Hal.{Pose, Twist}
  alias Robot.Body
  alias Robot.Control.Controller
  alias Robot.Behaviour.{Escape, Move}
  doctest Robot.Behaviour.Escape

  @minute 600

  defp press(bumpers), do: fn percept -> %{percept | bumpers: bumpers} end
  defp body, do: Body.new(Pose.new(0, 0))

  # How far it went and turned, all in all.
  defp way(body, ticks, change) do
    Enum.reduce(1..ticks, {body, 0.0, 0.0}, fn _, {before, way, turned} ->
      {nil, body} = Body.run(before, 1, change)
      way = way + Pose.distance(before.pose, body.pose)
      turned = turned + abs(Pose.wrap(body.pose.heading - before.pose.heading))
      {body, way, turned}
    end)
  end

  test "a bumper that is held down on an idle robot: it backs off once, and stands from then on" do
    for bumper <- [0, 3, 8, 13] do
      {body, way, turned} = way(body(), @minute, press([bumper]))
      assert way < 0.25 and turned < 0.05
      assert Twist.zero?(body.twist)
      assert Controller.fault(body.controller) == "bumper #{bumper} stays pressed"
      assert body.controller.last_by == :escape
      # Released, that is over, and the next touch is a touch.
      {body, way, _turned} = way(body, 20, press([]))
      assert way == 0.0 and Controller.fault(body.controller) == nil
      {_body, way, _turned} = way(body, 5, press([bumper]))
      assert way > 0.0
    end
  end

  test "a base that is silent for a while does not make a pressed bumper a new touch" do
    {body, _way, _turned} = way(body(), @minute, press([0]))
    {body, _way, _turned} = way(body, 5, &%{&1 | bumpers: [], odometry: nil})
    {body, way, turned} = way(body, 100, press([0]))
    assert way == 0.0 and turned == 0.0
    assert Controller.fault(body.controller) == "bumper 0 stays pressed"
  end

  test "it stands whatever its mission wants" do
    goal = &%{&1 | controller: Controller.goal(&1.controller, 1, {Move, linear: 0.3, turn: 0.5})}
    {body, way, turned} = way(goal.(body()), @minute, press([0]))
    assert way < 0.25 and turned < 0.05
    assert Controller.fault(body.controller) == "bumper 0 stays pressed"
    {body, way, _turned} = way(body, 100, press([]))
    assert way > 1.0 and body.controller.last_by == :move
  end

  test "where the sonars see the thing too it turns away, and is then at fault if it still holds" do
    wall = fn percept ->
      near = Enum.map(percept.profile.sonars, &if(abs(&1.heading) < 0.3, do: 0.2, else: 5.1))
      %{percept | bumpers: [0], sonar: near}
    end

    {body, way, turned} = way(body(), @minute, wall)
    assert way < 0.25
    assert_in_delta turned, 0.8, 0.15
    assert Controller.fault(body.controller) == "bumper 0 stays pressed"
  end

  test "held in front and behind it gives up, and stands" do
    stuck = fn percept ->
      %{percept | bumpers: [0], odometry: %{percept.odometry | pose: Pose.new(0, 0)}}
    end

    {nil, body} = Body.run(body(), 39, stuck)
    assert Controller.fault(body.controller) == nil
    {nil, body} = Body.run(body, 10, stuck)
    assert Controller.fault(body.controller) == "bumper 0 stays pressed"
    assert Twist.zero?(body.twist)
  end

  test "another touch is another sensor's word" do
    {body, _way, _turned} = way(body(), 100, press([0]))
    x = body.pose.x
    {body, _way, _turned} = way(body, 100, press([0, 8]))
    assert body.pose.x > x + 0.1
    assert Controller.fault(body.controller) == "bumper 8 stays pressed"
  end

  test "to be armed, or released from the emergency stop, with a bumper pressed is no reason to move" do
    for limit <- [:disarmed, :estop] do
      held = fn limits ->
        fn percept ->
          %{percept | bumpers: [0], driving: %{twist: Twist.zero(), limits: limits}}
        end
      end

      {body, _way, _turned} = way(body(), 100, held.([]))
      assert Controller.fault(body.controller) != nil
      {body, way, _turned} = way(body, 3, held.([limit]))
      assert way == 0.0 and Controller.fault(body.controller) == nil
      {body, way, _turned} = way(body, @minute, held.([]))
      assert way == 0.0 and Controller.fault(body.controller) == nil
      # The other ones are as good as ever, and this one too once it was released.
      {_body, way, _turned} = way(body, 5, press([0, 4]))
      assert way > 0.0
      {body, _way, _turned} = way(body, 1, press([]))
      {_body, way, _turned} = way(body, 5, press([0]))
      assert way > 0.0
    end
  end

  test "a robot that has touched something and goes back is at no fault" do
    touch = fn percept -> if percept.at_ms < 600, do: press([1]).(percept), else: percept end
    {nil, body} = Body.run(body(), 40, touch)
    assert Controller.fault(body.controller) == nil
    assert body.pose.x < -0.1
    assert_in_delta body.pose.heading, -0.8, 0.15
  end

  test "one line names all that are pressed" do
    {nil, body} = Body.run(body(), 60, press([0, 1]))
    assert Controller.fault(body.controller) == "bumpers 0 and 1 stay pressed"
    {Escape, state} = body.controller.escape
    assert Escape.fault(state) == Controller.fault(body.controller)
  end
end
