defmodule Lab.Replay.Cursor do
  @moduledoc """
  Holds a place in a recording of either kind, from which one goes forwards and backwards tick by tick. Pure.

  A replay itself goes forwards only. So the cursor keeps its state every few ticks, and goes back
  by going on from the nearest state before. When there are too many, it drops every second one,
  and keeps half as many from then on: a long recording takes no more memory than a short one.
  """
  alias Lab.Replay.Kind

  # 5 s of a run are replayed in a few tenths of a second.
  @every 50
  @most 100
  # So many differences of a walk are returned; the first ones explain the others.
  @shown 3

  @enforce_keys [:ticks, :here, :kept, :every, :most]
  defstruct @enforce_keys ++ [furthest: 0]

  @typedoc """
  The run at the end of a tick: its number (0 is the start), the replay after it and before it, the
  tick, and where it differs; `end?` says whether no tick follows, as far as one has looked.
  """
  @type place :: %{
          number: non_neg_integer(),
          replay: Kind.t(),
          before: Kind.t() | nil,
          tick: Kind.tick() | nil,
          differences: [Kind.difference()],
          end?: boolean()
        }

  @type t :: %__MODULE__{
          ticks: (non_neg_integer() -> Enumerable.t()),
          here: place(),
          kept: [place()],
          every: pos_integer(),
          most: pos_integer(),
          furthest: non_neg_integer()
        }

  @doc """
  The start of a replay. `ticks` returns the recorded ticks from a time in ms on. Options: `:every`
  so many ticks a state is kept (#{@every}), `:most` (#{@most}, at least 2) of them.
  """
  @spec new(Kind.t(), (non_neg_integer() -> Enumerable.t()), keyword()) :: t()
  def new(replay, ticks, options \\ []) do
    here = %{number: 0, replay: replay, before: nil, tick: nil, differences: [], end?: false}

    %__MODULE__{
      ticks: ticks,
      here: here,
      kept: [here],
      every: Keyword.get(options, :every, @every),
      most: Keyword.get(options, :most, @most)
    }
  end

  @doc "The time of the place, in ms from the start."
  @spec at_ms(t()) :: non_neg_integer()
  def at_ms(%__MODULE__{here: here}), do: Kind.at_ms(here.replay)

  @doc """
  Goes so many ticks on, or back if negative, as far as the recording goes. Returns also where
  ticks differ to which the cursor has not been before: the first #{@shown}.
  """
  @spec step(t(), integer()) :: {t(), [Kind.difference()]}
  def step(%__MODULE__{here: here} = cursor, count) do
    number = max(here.number + count, 0)

    cursor
    |> from(&(&1.number <= number))
    |> walk(fn place, _at_ms -> place.number < number end)
  end

  @doc "Goes to the last tick that ends at this time in ms or before; returns as `step/2` does."
  @spec goto(t(), non_neg_integer()) :: {t(), [Kind.difference()]}
  def goto(%__MODULE__{} = cursor, to_ms) do
    cursor
    |> from(&(Kind.at_ms(&1.replay) <= to_ms))
    |> walk(fn _place, at_ms -> at_ms <= to_ms end)
  end

  @doc """
  Goes on until a condition holds for the replay, or the recording ends; returns as `step/2` does.
  """
  @spec until(t(), (Kind.t() -> boolean())) :: {t(), [Kind.difference()]}
  def until(%__MODULE__{} = cursor, condition),
    do: walk(cursor, fn place, _at_ms -> not condition.(place.replay) end)

  # From here, or from the nearest state before.
  defp from(cursor, fits?) do
    here = Enum.max_by(Enum.filter([cursor.here | cursor.kept], fits?), & &1.number)
    %{cursor | here: here}
  end

  defp walk(cursor, further?) do
    # A tick is found by the time at which it ends.
    (at_ms(cursor) + 1)
    |> cursor.ticks.()
    |> Enum.reduce_while({:ended, cursor, []}, fn {at_ms, _entries} = tick,
                                                  {_so_far, cursor, found} ->
      if further?.(cursor.here, at_ms),
        do: {:cont, tick(cursor, found, tick)},
        else: {:halt, {:stopped, cursor, found}}
    end)
    |> ended()
  end

  # What only the end of the recording shows belongs to its last tick.
  defp ended({:ended, %{here: %{end?: false} = here} = cursor, found}) do
    {_replay, last} = Kind.finish(here.replay)
    here = %{here | differences: here.differences ++ last, end?: true}
    {%{cursor | here: here}, Enum.take(found ++ last, @shown)}
  end

  defp ended({_ended_before, cursor, found}), do: {cursor, found}

  defp tick(%{here: here} = cursor, found, tick) do
    {replay, differences} = Kind.step(here.replay, tick)
    number = here.number + 1
    found = if number > cursor.furthest, do: Enum.take(found ++ differences, @shown), else: found

    here = %{
      number: number,
      replay: replay,
      before: here.replay,
      tick: tick,
      differences: differences,
      end?: false
    }

    {:ended, keep(%{cursor | here: here, furthest: max(cursor.furthest, number)}), found}
  end

  defp keep(%{here: here, kept: [newest | _] = kept, every: every} = cursor)
       when here.number > newest.number and rem(here.number, every) == 0 do
    if length(kept) < cursor.most do
      %{cursor | kept: [here | kept]}
    else
      every = 2 * every
      keep(%{cursor | every: every, kept: Enum.filter(kept, &(rem(&1.number, every) == 0))})
    end
  end

  defp keep(cursor), do: cursor
end
