defmodule Robot.Behaviour.Patience do
  @moduledoc """
  Decides whether a robot has come nearer to its goal within the time that it has for that. Pure.

  Progress is approach, not movement: at each moment it must be nearer than it has ever been until 15 s ago. A robot that
  comes nearer slowly, and then twitches, is judged by when it came nearer, not by the twitch.

  A way that is suddenly longer is another way, round something that stands in the first one: the time begins again, but
  not more often than ten times, so that a robot whose ways close one after the other ends, too.
  """

  @late_ms 15_000
  # A robot that turns slowly has a whole turn, and so much more.
  @turn_ms 5_000
  @longest_ms 60_000
  # It must have come so much nearer (metres) to count.
  @gain 0.1
  @other 1.0
  @others 10
  # Time in which nothing was decided, as in a robot that was frozen, does not count.
  @tick_ms 1_000
  # How finely the way is remembered.
  @step_ms 500

  @enforce_keys [:best, :at_ms, :past]
  defstruct @enforce_keys ++ [clock_ms: 0, others: 0]

  @typedoc """
  `best` is the least that was left (metres), `clock_ms` the time that counts, and `past` when how much was the least,
  the newest first.
  """
  @type t :: %__MODULE__{
          best: float(),
          at_ms: integer(),
          past: [{clock_ms :: non_neg_integer(), float()}, ...],
          clock_ms: non_neg_integer(),
          others: non_neg_integer()
        }

  @doc "Takes what is left (metres): of a `:way`, or of the `:straight` line, which has no other ways."
  @spec note(t() | nil, left :: float(), at_ms :: integer(), :way | :straight) :: t()
  def note(patience, left, at_ms, line \\ :way)

  def note(nil, left, at_ms, _line),
    do: %__MODULE__{best: left, at_ms: at_ms, past: [{0, left}]}

  def note(%__MODULE__{} = patience, left, at_ms, line) do
    passed_ms = (at_ms - patience.at_ms) |> max(0) |> min(@tick_ms)
    patience = %{patience | at_ms: at_ms, clock_ms: patience.clock_ms + passed_ms}

    cond do
      left < patience.best ->
        %{patience | best: left, past: remember(patience.past, patience.clock_ms, left)}

      line == :way and left > patience.best + @other and patience.others < @others ->
        %{note(nil, left, at_ms) | others: patience.others + 1}

      true ->
        patience
    end
  end

  defp remember([{before_ms, _left} | [_ | _] = past], clock_ms, left)
       when clock_ms - before_ms < @step_ms,
       do: [{before_ms, left} | past]

  # What is older than the longest time, but for the last of it, says no more.
  defp remember(past, clock_ms, left) do
    {recent, old} = Enum.split_while(past, fn {at_ms, _} -> clock_ms - at_ms < @longest_ms end)
    [{clock_ms, left} | recent ++ Enum.take(old, 1)]
  end

  @doc "A tick in which nothing is known of the way: time passes."
  @spec wait(t() | nil, integer()) :: t() | nil
  def wait(nil, _at_ms), do: nil
  def wait(%__MODULE__{} = patience, at_ms), do: note(patience, patience.best, at_ms)

  @doc """
  Whether the time is up for a robot that can turn so fast (rad/s).

      iex> patience = Enum.reduce(0..149, nil, &Robot.Behaviour.Patience.note(&2, 3.0, 100 * &1))
      iex> for left <- [2.8, 3.0], turn <- [1.0, 0.2],
      ...>     do: patience |> Robot.Behaviour.Patience.note(left, 15_000) |> Robot.Behaviour.Patience.late?(turn)
      [false, false, true, false]
  """
  @spec late?(t() | nil, max_turn :: float()) :: boolean()
  def late?(nil, _max_turn), do: false

  def late?(%__MODULE__{} = patience, max_turn) do
    late_ms = max(@late_ms, @turn_ms + 2000 * :math.pi() / max_turn)
    stale?(patience, @gain, min(late_ms, @longest_ms))
  end

  @doc """
  Whether it has come less than `gain` (metres) nearer within the last `late_ms` (up to 60 s).

      iex> alias Robot.Behaviour.Patience
      iex> near = fn at_ms -> if at_ms <= 4_000, do: 3.0 - 0.02 * at_ms / 1_000, else: 2.92 end
      iex> slow = Enum.reduce(0..14_000//100, nil, &Patience.note(&2, near.(&1), &1))
      iex> twitch = Patience.note(slow, 2.89, 14_100)
      iex> for to_ms <- [15_000, 19_000], do: 14_200..to_ms//100 |> Enum.reduce(twitch, &Patience.note(&2, 2.92, &1)) |> Patience.stale?(0.1, 15_000)
      [false, true]
  """
  @spec stale?(t(), gain :: float(), late_ms :: number()) :: boolean()
  def stale?(%__MODULE__{past: past, clock_ms: clock_ms, best: best}, gain, late_ms) do
    case Enum.find(past, fn {at_ms, _left} -> clock_ms - at_ms >= late_ms end) do
      {_at_ms, before} -> before - best <= gain
      nil -> false
    end
  end
end
