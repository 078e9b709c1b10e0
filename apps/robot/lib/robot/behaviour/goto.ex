defmodule Robot.Behaviour.Goto do
  @moduledoc """
  Goes to a place and optionally turns to a heading there. It turns until it points at the
  place, drives, and turns on the spot again only when it points clearly away. The two thresholds
  prevent chattering between turning and driving.

  Options: `x`, `y` (map frame, metres, required), `heading` (radians, default none), `tolerance`
  (metres, default 0.1), `heading_tolerance` (radians, default 0.05), `speed` (m/s, default the
  profile's). Outcome 1: arrived. Without a pose it stands and waits.

  It gives up with outcome 0 if the walls that it knows leave no place or no way (`Nav.Reach`), and with 2 if
  it has come no nearer for 15 s (`Robot.Behaviour.Patience`), which it learns from `Robot.Behaviour.Avoid`.
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Pose, Twist}
  alias Robot.Behaviour.Patience
  alias Robot.Wish
  alias Nav.{Reach, Steering}

  @points_there 0.09
  @points_aside 0.26
  # So many ticks, three minutes, it lets others pass before its patience counts again.
  @waits 1_800

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

    {__MODULE__,
     Enum.into(Options.check!(options, table, "goto"), %{
       mode: :turning,
       patience: nil,
       waited: 0,
       way?: true
     })}
  end

  @impl Robot.Behaviour
  def update(options, state) do
    kept = Map.take(state, [:x, :y, :heading, :tolerance, :heading_tolerance, :speed])
    {_, fresh} = new(Keyword.merge(Map.to_list(kept), options))
    {__MODULE__, %{fresh | mode: state.mode}}
  end

  @impl Robot.Behaviour
  def tick(%{pose: nil}, state), do: {:running, stand(), {__MODULE__, state}}

  def tick(%{pose: pose, profile: profile} = percept, state) do
    distance = Pose.distance(pose, {state.x, state.y})
    # A robot that has arrived and only turns must not drive again because its pose fluctuates.
    near = if state.mode == :aligning, do: 2 * state.tolerance, else: state.tolerance

    cond do
      distance < near -> arrive(percept, state)
      not state.way? or not place?(percept, state) -> {:done, 0, stand()}
      Patience.late?(state.patience, profile.max_turn) -> {:done, 2, stand()}
      true -> approach(pose, profile, distance, wait(state, percept))
    end
  end

  defp wait(%{mode: :aligning} = state, _percept), do: %{state | patience: nil}

  defp wait(state, %{at_ms: at_ms}),
    do: %{state | patience: Patience.wait(state.patience, at_ms)}

  # It lets another pass, which is no failure of its own, but not for ever.
  @impl Robot.Behaviour
  def routed(:waits, _percept, %{waited: waited} = state) when waited < @waits,
    do: {__MODULE__, %{state | patience: nil, waited: waited + 1}}

  def routed(:waits, _percept, state), do: {__MODULE__, state}
  def routed(:no_way, _percept, state), do: {__MODULE__, %{state | way?: false}}

  def routed({:left, metres}, %{at_ms: at_ms}, state),
    do: {__MODULE__, %{state | patience: Patience.note(state.patience, metres, at_ms)}}

  # Only a floor plan proves it: what sonars have seen may be something else, and may go away.
  defp place?(%{grid: %{closed?: true} = grid, profile: profile}, state),
    do: Reach.place(grid, {state.x, state.y}, profile.radius) == :ok

  defp place?(_without_plan, _state), do: true

  defp arrive(_percept, %{heading: nil}), do: {:done, 1, stand()}

  defp arrive(%{pose: pose, profile: profile, at_ms: at_ms}, state) do
    error = Steering.turn_error(state.heading - pose.heading)
    before = if state.mode == :aligning, do: state.patience
    # Radians are as good as metres here.
    patience = Patience.note(before, abs(error), at_ms)

    cond do
      abs(error) < state.heading_tolerance ->
        {:done, 1, stand()}

      Patience.late?(patience, profile.max_turn) ->
        {:done, 2, stand()}

      true ->
        wish = Wish.new(:goto, Twist.new(0, Steering.turn_rate(error, profile)), 0.5)
        {:running, wish, {__MODULE__, %{state | mode: :aligning, patience: patience}}}
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
