defmodule Robot.Behaviour.Avoid.Progress do
  @moduledoc """
  Notices that a robot makes no progress to its goal, and then sends it aside for a while. The
  side and the duration follow from its name and the number of attempts, so that two robots that
  block each other do not mirror each other for ever. Pure.
  """

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
  # A way that suddenly got this much longer is another one: the goal moved, or somebody stopped in it.
  @other 1.0
  @angles [-1.6, 1.6, -2.4, 2.4, 3.1, -0.9, 0.9]

  @doc """
  Takes the length of the way that is left (metres) of a robot that wants to go on; `nil`
  when it does not want to. Gives the angle (radians) by which to leave the way now, if any.
  """
  @spec note(t() | nil, float() | nil, atom(), integer()) :: {float() | nil, t() | nil}
  def note(_progress, nil, _robot, _at_ms), do: {nil, nil}
  def note(nil, left, _robot, at_ms), do: {nil, %__MODULE__{best: left, since_ms: at_ms}}

  # Time in which nobody was in the way is no time without progress: it turned, or its goal runs.
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

  @doc "Notes whether somebody was in the way at this tick."
  @spec hindered(t() | nil, boolean()) :: t() | nil
  def hindered(nil, _hindered?), do: nil
  def hindered(progress, hindered?), do: %{progress | hindered?: hindered?}
end
