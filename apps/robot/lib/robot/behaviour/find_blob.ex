defmodule Robot.Behaviour.FindBlob do
  @moduledoc """
  Looks for a colour: turns left on the spot until the camera shows it, then turns to it.
  Outcome 1: found, and the body points at it. Outcome 0: not in view after a full turn, or after
  a time-out.

  The full turn is measured by odometry; the time-out ends the search if the wheels do not turn.
  Options: `colour` (default any), `min_share` of the picture (default 0.0003), `speed` (rad/s,
  default 0.8 of the profile's), `centred` (radians, default 0.04).
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Pose, Twist}
  alias Robot.Wish
  alias Nav.Steering
  alias Robot.Percept.Sighting

  # How long a sighting is valid after the last picture that showed it.
  @memory_ms 600

  @impl Robot.Behaviour
  def new(options) do
    table = [
      colour: [{:check, &is_binary/1, "a colour's name"}, default: nil],
      min_share: [{:number, 0.0, 1.0}, default: 0.0003],
      speed: [{:number, 0.05, 10.0, "rad/s"}, default: nil],
      centred: [{:number, 0.005, 1.0}, default: 0.04]
    ]

    state = %{since_ms: nil, heading: nil, turned: 0.0, seen: nil, steady: 0}
    {__MODULE__, Enum.into(Options.check!(options, table, "find_blob"), state)}
  end

  @impl Robot.Behaviour
  def tick(percept, state) do
    state = state |> start(percept.at_ms) |> count_turn(percept.odometry) |> look(percept)

    if state.seen, do: centre(percept, state), else: scan(percept, state)
  end

  defp start(%{since_ms: nil} = state, at_ms), do: %{state | since_ms: at_ms}
  defp start(state, _at_ms), do: state

  defp count_turn(state, nil), do: state

  defp count_turn(%{heading: nil} = state, odometry),
    do: %{state | heading: odometry.pose.heading}

  defp count_turn(state, odometry) do
    step = Pose.wrap(odometry.pose.heading - state.heading)
    %{state | heading: odometry.pose.heading, turned: state.turned + step}
  end

  defp look(state, percept) do
    case Sighting.of(percept, state.colour, state.min_share) do
      nil ->
        forget? = state.seen && percept.at_ms - state.seen.at_ms > @memory_ms
        if forget?, do: %{state | seen: nil, steady: 0}, else: state

      sighting ->
        %{state | seen: sighting}
    end
  end

  defp centre(percept, state) do
    bearing = bearing(state.seen, percept.pose)
    steady = if abs(bearing) < state.centred, do: state.steady + 1, else: 0

    cond do
      # Two ticks in a row, because a single one may be part of an overshoot.
      steady >= 2 ->
        {:done, 1, wish(0.0)}

      steady == 1 ->
        {:running, wish(0.0), {__MODULE__, %{state | steady: steady}}}

      true ->
        rate = Steering.turn_rate(bearing, percept.profile)
        {:running, wish(clamp(rate, speed(percept, state))), {__MODULE__, %{state | steady: 0}}}
    end
  end

  defp bearing(%{direction: direction}, %Pose{heading: heading}) when direction != nil,
    do: Pose.wrap(direction - heading)

  defp bearing(%{bearing: bearing}, _pose), do: bearing

  defp scan(percept, state) do
    speed = speed(percept, state)
    # A tenth more than the time that the turn needs, plus time to accelerate.
    limit_ms = 1000 * (1.1 * 2 * :math.pi() / speed + 2 * speed)

    if state.turned >= 2 * :math.pi() or percept.at_ms - state.since_ms > limit_ms,
      do: {:done, 0, wish(0.0)},
      else: {:running, wish(speed), {__MODULE__, state}}
  end

  defp speed(percept, state),
    do: min(state.speed || 0.8 * percept.profile.max_turn, percept.profile.max_turn)

  defp clamp(rate, limit), do: rate |> min(limit) |> max(-limit)
  defp wish(turn), do: Wish.new(:find_blob, Twist.new(0, turn), 0.4, look: 0.0)
end
