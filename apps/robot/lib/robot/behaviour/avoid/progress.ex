defmodule Robot.Behaviour.Avoid.Progress do
  @moduledoc false
  # Detects that a robot makes no progress to its goal, and then turns it off its route for a while.
  # The angle and the duration follow from its name and the number of attempts, so that two robots
  # that block each other are unlikely to mirror each other for long. Pure.

  @enforce_keys [:best, :since_ms]
  defstruct @enforce_keys ++ [seen_ms: 0, hindered?: false, tries: 0, until_ms: nil, angle: 0.0]

  @type t :: %__MODULE__{
          best: float(),
          since_ms: integer(),
          seen_ms: integer(),
          hindered?: boolean(),
          tries: non_neg_integer(),
          until_ms: integer() | nil,
          angle: float()
        }

  @patience_ms 4000
  @gain 0.2
  # A route that is suddenly this much longer is another route: the goal moved, or a robot stopped
  # in the way.
  @other 1.0
  @angles [-1.6, 1.6, -2.4, 2.4, 3.1, -0.9, 0.9]

  @doc """
  Takes the length of the remaining route (metres), `nil` without a route. Returns the angle
  (radians) by which to leave the route now, or `nil`, and the next state.
  """
  @spec note(t() | nil, float() | nil, atom(), integer()) :: {float() | nil, t() | nil}
  def note(_progress, nil, _robot, _at_ms), do: {nil, nil}
  def note(nil, left, _robot, at_ms), do: {nil, %__MODULE__{best: left, since_ms: at_ms}}

  # Time in which nothing hindered the robot does not count as time without progress: it was
  # turning, or its goal moves away.
  def note(%{hindered?: false, until_ms: nil} = progress, left, _robot, at_ms) do
    waited_ms = max(progress.seen_ms - progress.since_ms, 0)

    {nil,
     %{progress | best: min(progress.best, left), since_ms: at_ms - waited_ms, seen_ms: at_ms}}
  end

  def note(%{until_ms: until_ms} = progress, left, _robot, at_ms) when until_ms != nil do
    if at_ms < until_ms,
      do: {progress.angle, progress},
      else: {nil, %{progress | until_ms: nil, best: left, since_ms: at_ms}}
  end

  def note(progress, left, robot, at_ms) do
    progress = %{progress | seen_ms: at_ms}

    cond do
      left < progress.best - 1.0 ->
        {nil, %{progress | best: left, since_ms: at_ms, tries: 0}}

      left < progress.best - @gain ->
        {nil, %{progress | best: left, since_ms: at_ms}}

      left > progress.best + @other ->
        {nil, %{progress | best: left, since_ms: at_ms}}

      at_ms - progress.since_ms < @patience_ms + rem(:erlang.phash2(robot), 1500) ->
        {nil, progress}

      true ->
        chance = :erlang.phash2({robot, progress.tries}, 1_000_000)
        angle = Enum.at(@angles, rem(chance, length(@angles)))
        until_ms = at_ms + 1200 + rem(div(chance, 7), 1500)
        {angle, %{progress | until_ms: until_ms, angle: angle, tries: progress.tries + 1}}
    end
  end

  @doc "Records whether something hindered the robot at this tick."
  @spec hindered(t() | nil, boolean()) :: t() | nil
  def hindered(nil, _hindered?), do: nil
  def hindered(progress, hindered?), do: %{progress | hindered?: hindered?}
end
