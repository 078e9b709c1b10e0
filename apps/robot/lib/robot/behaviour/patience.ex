defmodule Robot.Behaviour.Patience do
  @moduledoc """
  Whether a robot has come nearer to its goal within the time that it has for that. Pure.

  A way that is suddenly longer is another way, round something that stands in the first one: the time begins again, but
  not more often than ten times, so that a robot whose ways close one after the other ends, too.
  """

  @late_ms 15_000
  # A robot that turns slowly has a whole turn, and so much more.
  @turn_ms 5_000
  # It must have come so much nearer (metres) to count.
  @gain 0.1
  @other 1.0
  @others 10
  # Time in which nothing was decided, as in a robot that was frozen, does not count.
  @tick_ms 1_000

  @enforce_keys [:best, :at_ms]
  defstruct @enforce_keys ++ [waited_ms: 0, others: 0]

  @type t :: %__MODULE__{
          best: float(),
          at_ms: integer(),
          waited_ms: non_neg_integer(),
          others: non_neg_integer()
        }

  @doc "Takes what is left of the way (metres)."
  @spec note(t() | nil, left :: float(), at_ms :: integer()) :: t()
  def note(nil, left, at_ms), do: %__MODULE__{best: left, at_ms: at_ms}

  def note(%__MODULE__{} = patience, left, at_ms) do
    passed_ms = (at_ms - patience.at_ms) |> max(0) |> min(@tick_ms)
    patience = %{patience | at_ms: at_ms}

    cond do
      left < patience.best - @gain ->
        %{patience | best: left, waited_ms: 0}

      left > patience.best + @other and patience.others < @others ->
        %{patience | best: left, waited_ms: 0, others: patience.others + 1}

      true ->
        %{patience | waited_ms: patience.waited_ms + passed_ms}
    end
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

  def late?(%__MODULE__{waited_ms: waited_ms}, max_turn),
    do: waited_ms >= max(@late_ms, @turn_ms + 2000 * :math.pi() / max_turn)
end
