defmodule Robot.Behaviour.Follow do
  @moduledoc """
  Drives to a place that may move, such as a slot of a formation, and stays with it: it
  matches the velocity of the place and adds a correction that closes the gap. Once it has reached
  a target that stands, it turns to the target's heading and stands. It drives again only when the
  target moves or is farther away than a second, larger threshold, to prevent chattering. Never
  ends by itself.

  Options: `target` (`Hal.Pose`, required), `velocity` of the target (`{vx, vy}`, map frame, m/s,
  default zero), `tolerance` (metres, default 0.06), `leave` (the distance in metres at which it
  drives again, default 0.12), `heading_tolerance` (radians, default 0.05), `speed` (m/s, default
  the profile's). All of them can be changed by `update/2` at any tick.
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Pose, Twist}
  alias Robot.Wish
  alias Nav.Steering

  # Nearer than this (metres) it may drive backwards instead of turning round.
  @back_up 0.6
  # A target slower than this counts as standing.
  @still 0.03

  @impl Robot.Behaviour
  def new(options) do
    table = [
      target: [{:check, &target?/1, "a %Hal.Pose{} in metres and radians"}, required: true],
      velocity: [{:check, &velocity?/1, "{vx, vy} in m/s"}, default: {0.0, 0.0}],
      tolerance: [{:number, 0.005, 10.0, "m"}, default: 0.06],
      leave: [{:number, 0.005, 10.0, "m"}, default: 0.12],
      heading_tolerance: [{:number, 0.005, 3.2, "rad"}, default: 0.05],
      speed: [{:number, 0.01, 10.0, "m/s"}, default: nil]
    ]

    state = %{mode: :going, turning?: true, backing?: false, distance: nil}
    {__MODULE__, Enum.into(Options.check!(options, table, "follow"), state)}
  end

  # The fields of a struct may hold anything.
  defp target?(%Pose{x: x, y: y, heading: heading}),
    do: Enum.all?([x, y, heading], &(is_number(&1) and abs(&1) <= 1.0e6))

  defp target?(_), do: false

  defp velocity?({vx, vy}), do: is_number(vx) and is_number(vy) and abs(vx) + abs(vy) < 100
  defp velocity?(_), do: false

  @options [:target, :velocity, :tolerance, :leave, :heading_tolerance, :speed]

  @impl Robot.Behaviour
  def update(options, state), do: Robot.Behaviour.change(__MODULE__, options, state, @options)

  @impl Robot.Behaviour
  def tick(%{pose: nil}, state),
    do: {:running, Wish.new(:follow, Twist.zero(), 0.5), {__MODULE__, state}}

  def tick(%{pose: pose, profile: profile}, state) do
    distance = Pose.distance(pose, state.target)
    {vx, vy} = state.velocity
    still? = :math.sqrt(vx * vx + vy * vy) < @still
    state = %{state | mode: mode(state, distance, still?), distance: distance}

    if state.mode == :in_place,
      do: hold(pose, profile, state),
      else: go(pose, profile, distance, still?, state)
  end

  defp mode(_state, _distance, false), do: :going

  defp mode(%{mode: :in_place} = state, distance, true),
    do: if(distance > state.leave, do: :going, else: :in_place)

  # It aims for half the tolerance; within the whole tolerance it also stops when the gap grows.
  defp mode(%{mode: :going} = state, distance, true) do
    receding? = state.distance != nil and distance > state.distance + 0.001

    if distance < state.tolerance / 2 or (distance < state.tolerance and receding?),
      do: :in_place,
      else: :going
  end

  defp hold(pose, profile, state) do
    error = Steering.turn_error(state.target.heading - pose.heading)
    limit = if state.turning?, do: state.heading_tolerance / 3, else: state.heading_tolerance
    turning? = abs(error) > limit
    turn = if turning?, do: Steering.turn_rate(error, profile), else: 0.0

    wish =
      Wish.new(:follow, Twist.new(0, turn), 0.5,
        velocity: {0.0, 0.0},
        goal: Pose.point(state.target)
      )

    {:running, wish, {__MODULE__, %{state | turning?: turning?}}}
  end

  defp go(pose, profile, distance, still?, state) do
    {vx, vy} = state.velocity
    top = state.speed || profile.max_linear
    closing = min(Steering.approach(distance, profile), top)
    scale = if distance > 1.0e-6, do: closing / distance, else: 0.0
    ux = vx + scale * (state.target.x - pose.x)
    uy = vy + scale * (state.target.y - pose.y)
    {ux, uy} = clip({ux, uy}, top)
    reverse? = distance < @back_up
    from = reverse_from(reverse?, state.backing?)
    twist = Steering.twist({ux, uy}, pose.heading, profile, reverse_from: from)

    wish =
      Wish.new(:follow, twist, 0.5,
        velocity: {ux, uy},
        goal: Pose.point(state.target),
        reverse?: reverse?
      )

    {:running, wish, {__MODULE__, %{state | turning?: still?, backing?: backing?(twist, state)}}}
  end

  # Once it drives backwards it continues to, so that it does not alternate between two equally
  # good directions.
  defp reverse_from(false, _backing?), do: :infinity
  defp reverse_from(true, backing?), do: if(backing?, do: 1.2, else: 2.0)

  defp backing?(%Twist{linear: linear}, state) when linear == 0.0, do: state.backing?
  defp backing?(%Twist{linear: linear}, _state), do: linear < 0

  defp clip({x, y}, top) do
    size = :math.sqrt(x * x + y * y)
    if size > top, do: {x * top / size, y * top / size}, else: {x, y}
  end
end
