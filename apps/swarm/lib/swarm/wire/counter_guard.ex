defmodule Swarm.Wire.CounterGuard do
  @moduledoc """
  Bounds how far others may raise a number that all robots count up, such as that of a leadership.
  A robot that adopts any number that it hears follows the first wrong one: it counts on
  from there, and nothing is left at the end of the range. Pure; times in milliseconds.

  A number is admitted if it is at most a million above what was known when the present second
  began, so no robot can be pushed by more than a million a second, and the end of the range
  (2^64) is more than half a million years away. No fleet elects a million leaders unheard, so a
  robot that was just switched on, or a part that was cut off, is as far behind as it can get by
  itself.

  What is beyond that is refused. A fleet whose number was pushed is joined nevertheless: while
  a greater number is heard again and again, the limit approaches it (`approach/4`), and a number
  that several say can be trusted at once (`trust/2`).
  """

  @step 1_000_000
  @window_ms 1_000

  defstruct top: 0, base: 0, since_ms: nil

  @typedoc """
  `top` is the highest number that was admitted, or approached; `base` is what was known at
  `since_ms`, when the present second began.
  """
  @type t :: %__MODULE__{
          top: non_neg_integer(),
          base: non_neg_integer(),
          since_ms: integer() | nil
        }

  @doc """
  The highest number that is admitted now. `known` is the highest that the caller knows itself,
  0 if it relies on what this guard has admitted.

      iex> alias Swarm.Wire.CounterGuard
      iex> CounterGuard.limit(%CounterGuard{}, 7, 0)
      1_000_007
  """
  @spec limit(t(), known :: non_neg_integer(), now_ms :: integer()) :: pos_integer()
  def limit(guard, known, now_ms) do
    {base, _since_ms} = second(guard, known, now_ms)
    max(base + @step, known)
  end

  @doc """
  Admits a number from outside, or returns the highest that is allowed.

      iex> alias Swarm.Wire.CounterGuard
      iex> {:ok, guard} = CounterGuard.admit(%CounterGuard{}, 1_000_000, 0, 0)
      iex> CounterGuard.admit(guard, 1_000_001, 0, 999)
      {:error, 1_000_000}
      iex> {:ok, guard} = CounterGuard.admit(guard, 1_000_001, 0, 1_000)
      iex> guard.top
      1_000_001
  """
  @spec admit(t(), number :: integer(), known :: non_neg_integer(), now_ms :: integer()) ::
          {:ok, t()} | {:error, allowed :: pos_integer()}
  def admit(guard, number, known, now_ms) do
    case limit(guard, known, now_ms) do
      allowed when number > allowed -> {:error, allowed}
      _enough when number <= guard.top -> {:ok, guard}
      _enough -> {:ok, raised(guard, number, known, now_ms)}
    end
  end

  @doc """
  A refused number is heard, or heard again: the limit approaches it by one step a second.

      iex> alias Swarm.Wire.CounterGuard
      iex> guard = CounterGuard.approach(%CounterGuard{}, 2_500_000, 0, 0)
      iex> guard = CounterGuard.approach(guard, 2_500_000, 0, 1_000)
      iex> CounterGuard.limit(guard, 0, 2_000)
      3_000_000
  """
  @spec approach(t(), number :: integer(), known :: non_neg_integer(), now_ms :: integer()) :: t()
  def approach(guard, number, known, now_ms),
    do: raised(guard, min(number, limit(guard, known, now_ms)), known, now_ms)

  @doc """
  Trusts a number, however high, so that those up to a step above it are admitted.

      iex> alias Swarm.Wire.CounterGuard
      iex> CounterGuard.limit(CounterGuard.trust(%CounterGuard{}, 5_000_000_000), 0, 0)
      5_001_000_000
  """
  @spec trust(t(), non_neg_integer()) :: t()
  def trust(guard, number),
    do: %{guard | top: max(guard.top, number), base: max(guard.base, number)}

  defp raised(guard, number, known, now_ms) do
    {base, since_ms} = second(guard, known, now_ms)
    %{guard | top: max(guard.top, number), base: base, since_ms: since_ms}
  end

  defp second(%{since_ms: since_ms, base: base}, _known, now_ms)
       when since_ms != nil and now_ms - since_ms < @window_ms,
       do: {base, since_ms}

  defp second(%{top: top}, known, now_ms), do: {max(top, known), now_ms}
end
