defmodule Lab.Trial.Progress do
  @moduledoc """
  Checks an invariant of every run from outside, by true poses: a follower that makes no progress
  says so. Pure; fed once a second.

  A follower that is under way by its mission's account (`c:Robot.Mission.account/1`): it claims
  neither to be in place, nor to be blocked, nor to be unsure of its place. It
  must have come nearer to its slot within 20 s, whatever shape the slot belongs to. The time starts
  again when the slot moves by more than a metre.
  """

  @silent_ms 20_000
  @every_ms 1_000
  @nearer_m 0.1
  @other_slot_m 1.0

  defstruct next_ms: 0, open: %{}, told: []

  @typedoc "A follower: whether it claims to be under way, its true error in metres, and its slot."
  @type row :: %{
          id: atom(),
          under_way?: boolean(),
          error_m: float(),
          slot: Hal.Pose.t()
        }
  @typedoc """
  A robot that stood short of its slot without reporting it: since when, which robot, how far off
  in metres.
  """
  @type silence :: %{at_s: float(), robot: atom(), error_m: float()}
  @type t :: %__MODULE__{next_ms: integer(), open: map(), told: [silence()]}

  @doc "One tick; `rows` is called only if a second has passed."
  @spec note(t(), integer(), (... -> [row()])) :: t()
  def note(%{next_ms: next_ms} = stuck, at_ms, _rows) when at_ms < next_ms, do: stuck

  def note(stuck, at_ms, rows) do
    {open, told} =
      for row <- rows.(), row.under_way?, reduce: {%{}, stuck.told} do
        {open, told} ->
          state = go_on(stuck.open[row.id], row, at_ms)
          {state, told} = tell(state, row, at_ms, told)
          {Map.put(open, row.id, state), told}
      end

    %{stuck | next_ms: at_ms + @every_ms, open: open, told: told}
  end

  @doc "All violations up to now, the oldest first; a good run has none."
  @spec report(t()) :: [silence()]
  def report(stuck), do: Enum.reverse(stuck.told)

  defp go_on(nil, row, at_ms), do: begin(row, at_ms)

  defp go_on(state, row, at_ms) do
    cond do
      Hal.Pose.distance(state.slot, row.slot) > @other_slot_m -> begin(row, at_ms)
      row.error_m < state.best - @nearer_m -> %{state | best: row.error_m, since_ms: at_ms}
      true -> state
    end
  end

  defp begin(row, at_ms),
    do: %{slot: row.slot, best: row.error_m, since_ms: at_ms, told?: false}

  defp tell(%{told?: false} = state, row, at_ms, told)
       when at_ms - state.since_ms >= @silent_ms do
    silence = %{at_s: state.since_ms / 1000, robot: row.id, error_m: row.error_m}
    {%{state | told?: true}, [silence | told]}
  end

  defp tell(state, _row, _at_ms, told), do: {state, told}
end
