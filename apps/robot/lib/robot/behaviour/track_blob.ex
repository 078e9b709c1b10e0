defmodule Robot.Behaviour.TrackBlob do
  @moduledoc """
  Keeps a coloured object in view and at a distance, as the leader does with the
  landmark. Never ends.

  The camera follows the object. The body begins to turn when the object is more than 30 degrees
  off its front, and turns until the object is ahead, more slowly once it is within these 30
  degrees. It also turns when it has to drive, because it faces the object while driving. A robot
  without a pan-tilt unit keeps the object in front of its body.

  Measurements from pictures fluctuate, so direction and distance are filtered, and each has
  two thresholds: the robot starts to turn when it is clearly off and stops when it is well
  centred, and likewise for the distance. In between it stands still. When the object is lost, the
  robot turns to where it was last seen and then on to that side, a little more than a full turn
  in total, and then waits.

  Options: `colour` (default any), `min_share` (default 0.0003), `near` and `far` (metres, default
  1.0 and 1.5), `max_turn` (rad/s, default 0.4, so that followers can keep up), `speed` (m/s,
  default 0.3), `place` (`{x, y}` in the map frame, default `nil`): the presumed place of the
  object, to which the robot turns if it has not seen the object yet.
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Pose, Twist}
  alias Robot.Wish
  alias Nav.Steering
  alias Robot.Percept.{CameraPointing, Sighting}

  # Radians off the front at which the body begins to turn, with a pan-tilt unit and without one,
  # and at which it stops.
  @aside :math.pi() / 6
  @off_centre 0.04
  @centred 0.012
  # rad/s.
  @gently 0.2
  # It drives only while the object is this near to straight ahead (radians).
  @ahead 0.3
  # The weight of a new picture in the filtered value, while standing and while moving.
  @calm 0.3
  @lively 0.7
  @lost_ms 700
  # An object that covers more of the picture than this is too near, whatever distance it seems to have.
  @too_near_share 0.3

  @impl Robot.Behaviour
  def new(options) do
    table = [
      colour: [{:check, &is_binary/1, "a colour's name"}, default: nil],
      min_share: [{:number, 0.0, 1.0}, default: 0.0003],
      near: [{:number, 0.1, 20.0, "m"}, default: 1.0],
      far: [{:number, 0.1, 20.0, "m"}, default: 1.5],
      max_turn: [{:number, 0.01, 10.0, "rad/s"}, default: 0.4],
      speed: [{:number, 0.01, 10.0, "m/s"}, default: 0.3],
      place: [{:check, &place?/1, "{x, y} in metres"}, default: nil]
    ]

    options = Options.check!(options, table, "track_blob")

    state = %{
      error: nil,
      side: 1,
      distance: nil,
      heading: nil,
      picture_ms: nil,
      seen_ms: nil,
      turning?: false,
      driving: 0,
      searched: 0.0,
      there?: false
    }

    if options[:near] > options[:far],
      do: raise(ArgumentError, "option near: expected at most far, got #{options[:near]}")

    {__MODULE__, Enum.into(options, state)}
  end

  defp place?({x, y}), do: is_number(x) and is_number(y)
  defp place?(_other), do: false

  @options [:colour, :min_share, :near, :far, :max_turn, :speed, :place]

  @impl Robot.Behaviour
  def update(options, state), do: Robot.Behaviour.change(__MODULE__, options, state, @options)

  @impl Robot.Behaviour
  def tick(percept, state) do
    state = state |> carry(percept) |> look(percept) |> recall(percept)

    cond do
      state.error == nil -> stand(state)
      percept.at_ms - state.seen_ms <= @lost_ms -> hold(percept, state)
      true -> search(percept, state)
    end
  end

  # The remembered direction is relative to the body, so it changes when the body turns. Odometry
  # measures this better than the pose, which may jump when it is corrected.
  defp carry(state, percept) do
    heading = heading(percept)

    if state.heading && heading && state.error do
      step = Pose.wrap(heading - state.heading)
      error = Pose.wrap(state.error - step)
      %{state | heading: heading, error: error, searched: state.searched + abs(step)}
    else
      %{state | heading: heading}
    end
  end

  defp heading(%{odometry: %{pose: pose}}), do: pose.heading
  defp heading(%{pose: %Pose{heading: heading}}), do: heading
  defp heading(_percept), do: nil

  # A picture counts once, however many ticks it stays fresh.
  defp look(state, %{detections: nil}), do: state
  defp look(%{picture_ms: at_ms} = state, %{detections: %{at_ms: at_ms}}), do: state

  defp look(state, percept) do
    state = %{state | picture_ms: percept.detections.at_ms}

    case Sighting.of(percept, state.colour, state.min_share) do
      nil ->
        state

      sighting ->
        part = if state.turning? or state.driving != 0, do: @lively, else: @calm
        fresh? = state.seen_ms == nil or percept.at_ms - state.seen_ms > @lost_ms
        part = if fresh?, do: 1.0, else: part
        error = filter_angle(state.error, sighting.bearing, part)

        %{
          state
          | error: error,
            side: if(error < 0, do: -1, else: 1),
            distance: filter(state.distance, distance(sighting, state), part),
            seen_ms: percept.at_ms,
            searched: 0.0,
            there?: false
        }
    end
  end

  # This robot has not seen the object yet, but was given its place.
  defp recall(%{error: nil, place: {_x, _y} = place} = state, %{pose: %Pose{} = pose} = percept) do
    error = Pose.bearing(pose, place)
    %{state | error: error, side: if(error < 0, do: -1, else: 1), seen_ms: percept.at_ms}
  end

  defp recall(state, _percept), do: state

  defp distance(%{share: share}, state) when share > @too_near_share, do: state.near * 0.5
  defp distance(%{distance: distance}, _state), do: distance

  defp filter_angle(nil, new, _part), do: new
  defp filter_angle(old, new, part), do: Pose.wrap(old + part * Pose.wrap(new - old))
  defp filter(old, nil, _part), do: old
  defp filter(nil, new, _part), do: new
  defp filter(old, new, part), do: old + part * (new - old)

  defp hold(percept, state) do
    driving = driving(state.driving, state.distance, state)
    turning? = abs(state.error) > limit(state.turning?, driving, percept)
    turn = if turning?, do: turn(state.error, percept, gently(state, percept)), else: 0.0
    state = %{state | turning?: turning?, driving: driving}
    running(Twist.new(linear(percept, state), turn), gaze(state.error, percept), state)
  end

  defp limit(true, _driving, _percept), do: @centred
  defp limit(false, 0, %{ptz: ptz}) when ptz != nil, do: @aside
  defp limit(false, _driving, _percept), do: @off_centre

  # The camera can see the object already, so the body turns slowly and followers can keep up.
  defp gently(%{error: error} = state, %{ptz: ptz}) when ptz != nil and abs(error) < @aside,
    do: %{state | max_turn: min(state.max_turn, @gently)}

  defp gently(state, _percept), do: state

  defp gaze(_error, %{ptz: nil}), do: 0.0
  defp gaze(error, percept), do: CameraPointing.pan(error, percept)

  # The direction of driving: it starts outside the range and stops a little inside it.
  defp driving(_driving, nil, _state), do: 0

  defp driving(driving, distance, %{near: near, far: far}) do
    inside = min(0.1, (far - near) / 4)

    cond do
      distance > far + 0.05 -> 1
      distance < near - 0.05 -> -1
      driving == 1 and distance > far - inside -> 1
      driving == -1 and distance < near + inside -> -1
      true -> 0
    end
  end

  defp linear(_percept, %{driving: 0}), do: 0.0
  defp linear(_percept, %{error: error}) when abs(error) > @ahead, do: 0.0

  defp linear(percept, state) do
    goal = if state.driving == 1, do: state.far - 0.15, else: state.near + 0.15
    speed = Steering.approach(abs(state.distance - goal), percept.profile)
    state.driving * min(speed, state.speed)
  end

  defp search(percept, %{searched: searched} = state) when searched < 7.0 do
    # First to where the object was last seen, and from there on to the same side.
    there? = state.there? or abs(state.error) < 0.1
    error = if there?, do: state.side * 3.0, else: state.error
    # The camera gets there before the body; after that it looks straight ahead.
    gaze = if there?, do: 0.0, else: gaze(state.error, percept)
    state = %{state | driving: 0, turning?: true, there?: there?}
    running(Twist.new(0, turn(error, percept, state)), gaze, state)
  end

  defp search(_percept, state), do: stand(%{state | driving: 0, turning?: false})

  defp turn(error, percept, state),
    do:
      error |> Steering.turn_rate(percept.profile) |> min(state.max_turn) |> max(-state.max_turn)

  defp stand(state), do: running(Twist.zero(), 0.0, state)

  defp running(twist, look, state),
    do: {:running, Wish.new(:track_blob, twist, 0.5, look: look), {__MODULE__, state}}
end
