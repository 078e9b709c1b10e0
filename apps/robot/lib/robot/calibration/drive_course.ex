defmodule Robot.Calibration.DriveCourse do
  @moduledoc """
  Drives a course of straight legs and turns on the spot, by odometry alone, for calibration. The
  course is laid out once, from the robot's pose at the first tick; after each leg the robot
  stands still before it begins the next, so that the wheels slip less.

  Options: `legs`, a list of `{:go, metres}` (0.05 to 100) and `{:turn, radians}` (left is
  positive; more than a whole turn is allowed); `speed` (m/s) and `turn` (rad/s), at most the
  profile's, which are the defaults.

  Outcome 1: the course is driven. Outcome 2: a bumper was touched, or the robot made no progress,
  or had no odometry before the start, for 5 s; it stands.
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Pose, Twist}
  alias Robot.Wish
  alias Nav.Steering

  @close_m 0.004
  @close_rad 0.008
  # Below these speeds of odometry (m/s, rad/s) the robot counts as standing.
  @still_linear 0.006
  @still_turn 0.01
  @stuck_ms 5_000
  @progress 0.01
  # The robot heads for a point on the line this many metres ahead.
  @ahead_m 0.6
  @slowest 0.02
  @slowest_turn 0.04

  @impl Robot.Behaviour
  def new(options) do
    table = [
      legs: [{:check, &legs?/1, "[{:go, metres} | {:turn, radians}]"}, required: true],
      speed: [{:number, 0.01, 10.0, "m/s"}, default: nil],
      turn: [{:number, 0.01, 10.0, "rad/s"}, default: nil]
    ]

    state = %{mark: nil, heading: nil, left: nil, best: nil, best_ms: nil}
    {__MODULE__, Enum.into(Options.check!(options, table, "course"), state)}
  end

  defp legs?(legs), do: is_list(legs) and legs != [] and Enum.all?(legs, &leg?/1)
  defp leg?({:go, way}), do: is_number(way) and way >= 0.05 and way <= 100
  defp leg?({:turn, turn}), do: is_number(turn) and abs(turn) <= 100
  defp leg?(_other), do: false

  @impl Robot.Behaviour
  def tick(%{bumpers: [_ | _]}, _state), do: {:done, 2, stand()}
  def tick(%{odometry: nil, at_ms: at_ms}, state), do: wait(state, at_ms)

  def tick(%{odometry: %{pose: pose}} = percept, %{mark: nil} = state),
    do: tick(percept, begin(%{state | mark: pose, heading: pose.heading}, percept.at_ms))

  def tick(%{odometry: odometry} = percept, state) do
    state = come_nearer(state, odometry.pose, percept.at_ms)
    leg = hd(state.legs)

    cond do
      percept.at_ms - state.best_ms > @stuck_ms -> {:done, 2, stand()}
      not there?(leg, state) -> go_on(leg, odometry.pose, percept.profile, state)
      moving?(odometry.twist) -> {:running, stand(), {__MODULE__, state}}
      tl(state.legs) == [] -> {:done, 1, stand()}
      true -> {:running, stand(), {__MODULE__, next(state, odometry.pose, percept.at_ms)}}
    end
  end

  defp wait(%{best_ms: nil} = state, at_ms), do: wait(%{state | best_ms: at_ms}, at_ms)

  defp wait(state, at_ms) do
    if at_ms - state.best_ms > @stuck_ms,
      do: {:done, 2, stand()},
      else: {:running, stand(), {__MODULE__, state}}
  end

  # The mark is the planned pose at which the leg begins.
  defp next(%{legs: [leg | legs]} = state, pose, at_ms),
    do:
      begin(%{state | legs: legs, mark: after_leg(leg, state.mark), heading: pose.heading}, at_ms)

  defp after_leg({:go, way}, mark), do: Pose.compose(mark, Pose.new(way, 0))
  defp after_leg({:turn, turn}, mark), do: Pose.compose(mark, Pose.new(0, 0, turn))

  defp begin(%{legs: [{:go, way} | _]} = state, at_ms),
    do: %{state | left: way * 1.0, best: way * 1.0, best_ms: at_ms}

  # Whatever the heading at the end of the last leg, the turn ends with the planned heading.
  defp begin(%{legs: [{:turn, turn} | _]} = state, at_ms) do
    left = turn + Pose.wrap(state.mark.heading - state.heading)
    %{state | left: left, best: abs(left), best_ms: at_ms}
  end

  defp come_nearer(%{legs: [leg | _]} = state, pose, at_ms) do
    left = left(leg, pose, state)
    state = %{state | left: left, heading: pose.heading}

    if abs(left) < state.best - @progress or there?(leg, state),
      do: %{state | best: abs(left), best_ms: at_ms},
      else: state
  end

  defp left({:go, way}, pose, %{mark: mark}), do: way - Pose.relative(mark, pose).x
  defp left({:turn, _turn}, pose, state), do: state.left - Pose.wrap(pose.heading - state.heading)

  defp there?({:go, _way}, %{left: left}), do: left < @close_m
  defp there?({:turn, _turn}, %{left: left}), do: abs(left) < @close_rad

  defp moving?(%Twist{linear: linear, turn: turn}),
    do: abs(linear) > @still_linear or abs(turn) > @still_turn

  defp go_on({:go, _way}, pose, profile, state) do
    %{y: aside, heading: heading} = Pose.relative(state.mark, pose)
    error = Pose.wrap(-:math.atan2(aside, @ahead_m) - heading)
    speed = Steering.approach(state.left, profile) |> min(state.speed || profile.max_linear)
    twist = Twist.new(max(speed, @slowest), Steering.turn_rate(error, profile))
    {:running, Wish.new(:course, twist, 0.5), {__MODULE__, state}}
  end

  defp go_on({:turn, _turn}, _pose, profile, %{left: left} = state) do
    rate = min(abs(Steering.turn_rate(left, profile)), state.turn || profile.max_turn)
    rate = if left < 0, do: -max(rate, @slowest_turn), else: max(rate, @slowest_turn)
    {:running, Wish.new(:course, Twist.new(0, rate), 0.5), {__MODULE__, state}}
  end

  defp stand, do: Wish.new(:course, Twist.zero(), 0.5)
end
