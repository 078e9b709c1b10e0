defmodule Robot.Localiser.History do
  @moduledoc false
  # Keeps the poses of odometry at the last ticks, for pictures that were taken a moment ago. Pure.
  alias Hal.Pose

  @most 12

  @typedoc "The newest entry first; times in milliseconds."
  @type t :: [{at_ms :: integer(), odometry :: Pose.t()}]

  @doc "An empty history."
  @spec new() :: t()
  def new, do: []

  @doc "The history with one more tick; it keeps the last 12."
  @spec note(t(), integer(), Pose.t()) :: t()
  def note(history, at_ms, odometry), do: Enum.take([{at_ms, odometry} | history], @most)

  @doc """
  The robot's pose at a time, relative to its present pose by odometry. Between two ticks the pose
  is interpolated; `nil` for a time before the oldest entry.

      iex> history = [{100, Hal.Pose.new(1, 0)}, {0, Hal.Pose.new(0, 0)}]
      iex> Robot.Localiser.History.back(history, Hal.Pose.new(1.5, 0), 50)
      Hal.Pose.new(-1.0, 0)
  """
  @spec back(t(), now :: Pose.t(), integer()) :: Pose.t() | nil
  def back(history, now, at_ms) do
    case Enum.split_while(history, fn {time_ms, _odometry} -> time_ms > at_ms end) do
      {_later, []} ->
        nil

      {later, [{time_ms, then} | _]} ->
        {next_ms, next} = List.last(later) || {nil, now}
        step = Pose.relative(then, next)
        part = part(next_ms, time_ms, at_ms)
        between = Pose.new(step.x * part, step.y * part, step.heading * part)
        Pose.relative(now, Pose.compose(then, between))
    end
  end

  defp part(_next_ms, at_ms, at_ms), do: 0.0
  defp part(nil, _time_ms, _at_ms), do: 1.0
  defp part(next_ms, time_ms, at_ms), do: (at_ms - time_ms) / (next_ms - time_ms)
end
