defmodule Record.Replay do
  @moduledoc """
  Replays a recorded robot of processes: gives the pure functions behind its gate, executive and
  pilot the same inputs again, and compares the effects with those recorded. Pure if the missions
  are.

  Each role is replayed by itself, from the state with which it began, or from a checkpoint, so
  that a recording may begin in the middle. At a later checkpoint the state that the replay has
  come to is compared, too. A role that crashed begins anew. Where entries were lost, a role waits
  for its next state, and what it did meanwhile counts as `skipped`, not as equal.

  The effects of an input are compared when the next entry of its role shows that there are no
  more of them; those of the last one by `finish/1`.
  """
  alias Robot.Trace
  alias Record.Replay.{Moment, Roles}

  @enforce_keys [:parts, :moments]
  defstruct @enforce_keys

  @typedoc "An entry of a robot's trace, with its state in place of the function of a checkpoint; or the loss of some."
  @type entry ::
          {robot :: atom(), Trace.entry()}
          | {robot :: atom(), {role :: atom(), :lost, count :: pos_integer(), at_ms :: integer()}}

  @typedoc """
  Of a role: `inputs` replayed; `decisions`, the effects that were compared and are equal;
  `checked` states that were compared and are equal; `begun`, how often it started; `lost` entries;
  `early` entries before its first state, with which a recording may begin in the middle; `skipped`
  entries that were not compared for lack of a state after a loss or a difference, or of any state.
  """
  @type counts :: %{
          inputs: non_neg_integer(),
          decisions: non_neg_integer(),
          checked: non_neg_integer(),
          begun: non_neg_integer(),
          lost: non_neg_integer(),
          early: non_neg_integer(),
          skipped: non_neg_integer()
        }

  @typedoc """
  `state` is `nil` while the role waits for one, and `{:crashed, line}` if the replay crashed on
  the last input. `input`, with its time, is the last one; `replayed` and `recorded` its effects;
  `known?` says whether it had a state before, or a loss.
  """
  @type part :: %{
          state: Roles.t() | {:crashed, String.t()} | nil,
          input: {term(), integer()} | nil,
          replayed: [term()],
          recorded: [term()],
          known?: boolean(),
          counts: counts()
        }

  @type t :: %__MODULE__{
          parts: %{{robot :: atom(), role :: atom()} => part()},
          moments: %{(robot :: atom()) => Moment.t()}
        }

  @typedoc """
  What was done on an `input`, and what the replay does; of a checkpoint the parts of the two
  states that differ, by their names. `crash` says how the replay crashed where the robot did not.
  """
  @type difference :: %{
          robot: atom(),
          role: atom(),
          at_ms: integer(),
          input: term(),
          recorded: term(),
          replayed: term(),
          crash: String.t() | nil
        }

  @none %{inputs: 0, decisions: 0, checked: 0, begun: 0, lost: 0, early: 0, skipped: 0}
  @new %{state: nil, input: nil, replayed: [], recorded: [], known?: false, counts: @none}

  @doc """
  A replay that knows nothing yet.

      iex> Record.Replay.counts(Record.Replay.new())
      []
  """
  @spec new() :: t()
  def new, do: %__MODULE__{parts: %{}, moments: %{}}

  @doc "Replays one entry. The difference, if any, may be in the effects of the input before."
  @spec step(t(), entry()) :: {t(), difference() | nil}
  def step(%__MODULE__{} = replay, {robot, {role, kind, what, at_ms}}) do
    part = Map.get(replay.parts, {robot, role}, @new)
    {after_it, difference} = part |> entry(kind, what, at_ms, role) |> named(robot, role)
    moment = Moment.note(replay.moments[robot], role, {kind, what, at_ms}, part, after_it)

    {%{
       replay
       | parts: Map.put(replay.parts, {robot, role}, after_it),
         moments: Map.put(replay.moments, robot, moment)
     }, difference}
  end

  @doc "Compares the effects of each role's last input, as far as they were recorded."
  @spec finish(t()) :: {t(), [difference()]}
  def finish(%__MODULE__{} = replay) do
    {parts, differences} =
      replay.parts
      |> Enum.sort()
      |> Enum.map_reduce([], fn {{robot, role} = key, part}, differences ->
        {part, difference} = part |> settle(:cut) |> named(robot, role)
        {{key, part}, List.wrap(difference) ++ differences}
      end)

    {%{replay | parts: Map.new(parts)}, Enum.reverse(differences)}
  end

  @doc "What was counted of each role of each robot, sorted."
  @spec counts(t()) :: [{{robot :: atom(), role :: atom()}, counts()}]
  def counts(%__MODULE__{parts: parts}),
    do: parts |> Enum.map(fn {key, part} -> {key, part.counts} end) |> Enum.sort()

  @doc "The state that a role has come to, if it is known."
  @spec state(t(), robot :: atom(), role :: atom()) :: struct() | nil
  def state(%__MODULE__{parts: parts}, robot, role) do
    case parts do
      %{{^robot, ^role} => %{state: %_{} = state}} -> state
      _unknown -> nil
    end
  end

  @doc "What a robot did last, for people who ask why; `nil` for a robot that is not known."
  @spec moment(t(), robot :: atom()) :: Moment.t() | nil
  def moment(%__MODULE__{moments: moments}, robot), do: moments[robot]

  defp named({part, nil}, _robot, _role), do: {part, nil}

  defp named({part, difference}, robot, role),
    do: {part, Map.merge(difference, %{robot: robot, role: role})}

  # What came before the first state of all belongs to a time that is not in the recording.
  defp entry(%{known?: false} = part, kind, state, at_ms, role)
       when kind in [:begin, :checkpoint] do
    counts = %{part.counts | early: part.counts.skipped, skipped: 0}
    entry(%{part | known?: true, counts: counts}, kind, state, at_ms, role)
  end

  # Whatever a role that crashed has not done any more is not compared.
  defp entry(part, :begin, state, at_ms, _role) do
    {part, difference} = settle(part, :cut)
    part = %{part | state: state, input: {:begin, at_ms}, replayed: [], recorded: []}
    {count(part, :begun), difference}
  end

  defp entry(%{state: {:crashed, _line}} = part, :checkpoint, taken, _at_ms, _role),
    do: {%{part | state: taken, replayed: [], recorded: []}, crashed(part)}

  defp entry(part, :checkpoint, taken, at_ms, _role) do
    {part, difference} = settle(part, :whole)
    {reached, part} = {part.state, %{part | input: {:checkpoint, at_ms}}}

    cond do
      difference != nil or reached == nil ->
        {%{part | state: taken}, difference}

      reached === taken ->
        {count(part, :checked), nil}

      true ->
        {recorded, replayed} = Moment.parted(taken, reached)

        {%{part | state: taken},
         difference(%{part | recorded: recorded, replayed: replayed}, nil)}
    end
  end

  defp entry(part, :lost, count, _at_ms, _role) do
    counts = Map.update!(part.counts, :lost, &(&1 + count))
    {%{@new | known?: true, counts: counts}, nil}
  end

  defp entry(%{state: nil} = part, _kind, _what, _at_ms, _role), do: {count(part, :skipped), nil}

  defp entry(part, :input, what, at_ms, _role) do
    case settle(part, :whole) do
      {%{state: {:crashed, _line}} = part, nil} -> {%{part | state: nil}, crashed(part)}
      {%{state: nil} = part, difference} -> {count(part, :skipped), difference}
      {part, nil} -> {replayed(part, what, at_ms), nil}
    end
  end

  defp entry(part, :effect, what, _at_ms, _role),
    do: {%{part | recorded: [what | part.recorded]}, nil}

  # The mission may be foreign code, and may have crashed on this input in the robot, too.
  defp replayed(part, what, at_ms) do
    {state, effects} =
      try do
        Roles.input(part.state, what, at_ms)
      catch
        kind, reason -> {{:crashed, Exception.format_banner(kind, reason, __STACKTRACE__)}, []}
      end

    count(%{part | state: state, input: {what, at_ms}, replayed: effects, recorded: []}, :inputs)
  end

  # Compares what was recorded since the last input; of a role that was cut, all that there is.
  defp settle(%{state: nil} = part, _whole?), do: {part, nil}
  defp settle(%{state: {:crashed, _line}} = part, _whole?), do: {part, nil}

  defp settle(%{replayed: replayed} = part, whole?) do
    recorded = Enum.reverse(part.recorded)
    part = %{part | recorded: recorded}

    if recorded === replayed or
         (whole? == :cut and recorded === Enum.take(replayed, length(recorded))) do
      counts = Map.update!(part.counts, :decisions, &(&1 + length(recorded)))
      {%{part | replayed: [], recorded: [], counts: counts}, nil}
    else
      {%{part | state: nil, replayed: [], recorded: []}, difference(part, nil)}
    end
  end

  defp crashed(%{state: {:crashed, line}} = part),
    do: difference(%{part | recorded: Enum.reverse(part.recorded)}, line)

  defp difference(%{input: {input, at_ms}} = part, crash) do
    %{
      at_ms: at_ms,
      input: input,
      recorded: part.recorded,
      replayed: part.replayed,
      crash: crash
    }
  end

  defp count(part, what), do: update_in(part.counts[what], &(&1 + 1))
end
