defmodule Robot.Behaviour.Escape do
  @moduledoc """
  What to do after touching something (R50): back off 0.15 m, away from the touched side, then
  turn away from it. Wishes nothing while nothing is touched; it never ends.

  Options: `distance` (metres, default 0.15), `turn` (radians, default 0.8).
  """
  @behaviour Robot.Behaviour
  alias Hal.{Pose, Twist}
  alias Robot.{Steering, Wish}
  alias Robot.Behaviour.Options

  # A robot that is held in front and behind gives up, rather than push for ever.
  @give_up_ms 4000

  @impl Robot.Behaviour
  def new(options \\ []) do
    options = Keyword.validate!(options, distance: 0.15, turn: 0.8)

    state = %{
      distance: Options.number!(options, :distance, 0.01, 2.0),
      turn: Options.number!(options, :turn, 0.0, 3.0),
      phase: :idle
    }

    {__MODULE__, state}
  end

  @impl Robot.Behaviour
  def tick(%{odometry: nil}, state), do: {:running, nil, {__MODULE__, state}}

  def tick(%{bumpers: [_ | _] = bumpers} = percept, %{phase: :idle} = state) do
    angle = contact_angle(bumpers, percept.profile.bumpers)
    back(percept, %{state | phase: {:back, angle, percept.odometry.pose, percept.at_ms}})
  end

  def tick(_percept, %{phase: :idle} = state), do: {:running, nil, {__MODULE__, state}}

  def tick(percept, state) do
    {_, _, _, since_ms} = state.phase

    cond do
      percept.at_ms - since_ms > @give_up_ms -> idle(state)
      elem(state.phase, 0) == :back -> back(percept, state)
      true -> turn(percept, state)
    end
  end

  defp back(percept, %{phase: {:back, angle, from, since_ms}} = state) do
    if Pose.distance(percept.odometry.pose, from) >= state.distance do
      # Away from a contact on the left is to the right; straight ahead counts as left.
      side = if angle >= 0, do: -1, else: 1
      goal = Pose.wrap(percept.odometry.pose.heading + side * state.turn)
      turn(percept, %{state | phase: {:turn, angle, goal, since_ms}})
    else
      speed = if :math.cos(angle) >= 0, do: -0.15, else: 0.15
      running(Twist.new(speed, 0), state)
    end
  end

  defp turn(percept, %{phase: {:turn, _angle, goal, _since_ms}} = state) do
    error = Pose.wrap(goal - percept.odometry.pose.heading)

    if abs(error) < 0.1,
      do: idle(state),
      else: running(Twist.new(0, Steering.turn_rate(error, percept.profile)), state)
  end

  defp idle(state), do: {:running, nil, {__MODULE__, %{state | phase: :idle}}}
  defp running(twist, state), do: {:running, Wish.new(:escape, twist, 0.9), {__MODULE__, state}}

  # The middle of all touched segments, counter-clockwise from the front.
  defp contact_angle(bumpers, count) do
    angles = Enum.map(bumpers, &(&1 * 2 * :math.pi() / max(count, 1)))
    x = angles |> Enum.map(&:math.cos/1) |> Enum.sum()
    y = angles |> Enum.map(&:math.sin/1) |> Enum.sum()
    if abs(x) + abs(y) < 1.0e-6, do: 0.0, else: :math.atan2(y, x)
  end
end
