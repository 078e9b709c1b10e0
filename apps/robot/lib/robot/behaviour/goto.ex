defmodule Robot.Behaviour.Goto do
  @moduledoc """
  Goes to a place and optionally turns to a heading there (R33). It turns until it points at the
  place, drives, and turns on the spot again only when it points clearly away. The two thresholds
  prevent chattering between turning and driving.

  Options: `x`, `y` (map frame, metres, required), `heading` (radians, default none), `tolerance`
  (metres, default 0.1), `heading_tolerance` (radians, default 0.05), `speed` (m/s, default the
  profile's). Outcome 1: arrived. Without a pose it stands and waits.
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Pose, Twist}
  alias Robot.Wish
  alias Robot.Navigation.Steering

  @points_there 0.09
  @points_aside 0.26

  @impl Robot.Behaviour
  def new(options) do
    table = [
      x: [{:number, -1.0e6, 1.0e6, "m"}, required: true],
      y: [{:number, -1.0e6, 1.0e6, "m"}, required: true],
      heading: [{:number, -1.0e6, 1.0e6, "rad"}, default: nil],
      tolerance: [{:number, 0.005, 10.0, "m"}, default: 0.1],
      heading_tolerance: [{:number, 0.005, 3.2, "rad"}, default: 0.05],
      speed: [{:number, 0.01, 10.0, "m/s"}, default: nil]
    ]

    {__MODULE__, Enum.into(Options.check!(options, table, "goto"), %{mode: :turning})}
  end

  @impl Robot.Behaviour
  def update(options, state) do
    kept = Map.take(state, [:x, :y, :heading, :tolerance, :heading_tolerance, :speed])
    {_, fresh} = new(Keyword.merge(Map.to_list(kept), options))
    {__MODULE__, %{fresh | mode: state.mode}}
  end

  @impl Robot.Behaviour
  def tick(%{pose: nil}, state), do: {:running, stand(), {__MODULE__, state}}

  def tick(%{pose: pose, profile: profile}, state) do
    distance = Pose.distance(pose, {state.x, state.y})
    # A robot that has arrived and only turns must not drive again because its pose fluctuates.
    near = if state.mode == :aligning, do: 2 * state.tolerance, else: state.tolerance

    if distance < near,
      do: arrive(pose, profile, state),
      else: approach(pose, profile, distance, state)
  end

  defp arrive(_pose, _profile, %{heading: nil}), do: {:done, 1, stand()}

  defp arrive(pose, profile, state) do
    error = Steering.turn_error(state.heading - pose.heading)

    if abs(error) < state.heading_tolerance do
      {:done, 1, stand()}
    else
      wish = Wish.new(:goto, Twist.new(0, Steering.turn_rate(error, profile)), 0.5)
      {:running, wish, {__MODULE__, %{state | mode: :aligning}}}
    end
  end

  defp approach(pose, profile, distance, state) do
    direction = :math.atan2(state.y - pose.y, state.x - pose.x)
    error = Steering.turn_error(direction - pose.heading)
    mode = mode(state.mode, abs(error))
    speed = min(Steering.approach(distance, profile), state.speed || profile.max_linear)
    linear = if mode == :driving, do: speed * Steering.alignment(error), else: 0.0

    wish =
      Wish.new(:goto, Twist.new(linear, Steering.turn_rate(error, profile)), 0.5,
        velocity: {speed * :math.cos(direction), speed * :math.sin(direction)},
        goal: {state.x, state.y}
      )

    {:running, wish, {__MODULE__, %{state | mode: mode}}}
  end

  defp mode(:driving, error), do: if(error > @points_aside, do: :turning, else: :driving)
  defp mode(_turning, error), do: if(error < @points_there, do: :driving, else: :turning)

  defp stand, do: Wish.new(:goto, Twist.zero(), 0.5)
end
