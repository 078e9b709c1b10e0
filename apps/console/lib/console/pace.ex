defmodule Console.Pace do
  @moduledoc """
  Describes how fast a run in lockstep goes, as a person wants it: at a multiple of real time, as fast as it
  goes, paused, or a few steps at a time. Pure; the time is an input, in ms.

  What is said of the speed was measured, over the last two seconds: a machine that is too slow
  reaches less than it is asked for.
  """

  # Simulated time of a step.
  @step_ms 100
  @least 0.1
  @most 100.0
  # An hour of simulated time.
  @most_steps 36_000
  @measured_ms 2_000

  defstruct speed: 1.0, left: :all, marks: []

  @typedoc "A multiple of real time, or as fast as it goes."
  @type speed :: float() | :max

  @typedoc """
  `left` is how many steps are to be made before it pauses; `marks` are when the last steps were made, the newest
  first, with their count of steps.
  """
  @type t :: %__MODULE__{
          speed: speed(),
          left: :all | non_neg_integer(),
          marks: [{at_ms :: integer(), steps :: non_neg_integer()}]
        }

  @type command :: :pause | :resume | {:step, pos_integer()} | {:speed, speed()}

  @doc "The pace of a run that goes on, at this speed."
  @spec new(speed()) :: t()
  def new(speed \\ 1.0), do: %__MODULE__{speed: speed}

  @doc """
  A speed from a text; the error says what is allowed.

      iex> Console.Pace.speed("2.5")
      {:ok, 2.5}
      iex> Console.Pace.speed("0")
      {:error, "a number from 0.1 to 100, or max,"}
  """
  @spec speed(String.t()) :: {:ok, speed()} | {:error, String.t()}
  def speed("max"), do: {:ok, :max}

  def speed(text) do
    with {:error, _allowed} <- Hal.Cli.Parse.number(text, @least, @most),
         do: {:error, "a number from 0.1 to 100, or max,"}
  end

  @doc """
  A number of steps from a text; the error says what is allowed.

      iex> Console.Pace.steps("10")
      {:ok, 10}
  """
  @spec steps(String.t()) :: {:ok, pos_integer()} | {:error, String.t()}
  def steps(text), do: Hal.Cli.Parse.whole(text, 1..@most_steps)

  @doc """
  Carries out a command. Steps are for a paused run.

      iex> {:ok, pace} = Console.Pace.command(Console.Pace.new(), :pause)
      iex> {Console.Pace.wait_ms(pace), Console.Pace.command(pace, :pause)}
      {:never, {:error, "it is paused already"}}
  """
  @spec command(t(), command()) :: {:ok, t()} | {:error, String.t()}
  def command(%{left: 0}, :pause), do: {:error, "it is paused already"}
  def command(pace, :pause), do: {:ok, %{pace | left: 0, marks: []}}
  def command(%{left: :all}, :resume), do: {:error, "it is not paused"}
  def command(pace, :resume), do: {:ok, %{pace | left: :all, marks: []}}

  def command(%{left: :all}, {:step, _count}),
    do: {:error, "it goes on by itself: pause it before you make steps"}

  def command(pace, {:step, count}), do: {:ok, %{pace | left: count, marks: []}}
  def command(pace, {:speed, speed}), do: {:ok, %{pace | speed: speed, marks: []}}

  @doc """
  How long after the last step the next one is due, in ms; `:never` for a run that is paused.

      iex> Enum.map([1.0, 0.1, 3.0, :max], &Console.Pace.wait_ms(Console.Pace.new(&1)))
      [100, 1000, 33, 0]
  """
  @spec wait_ms(t()) :: non_neg_integer() | :never
  def wait_ms(%{left: 0}), do: :never
  def wait_ms(%{left: left}) when is_integer(left), do: 0
  def wait_ms(%{speed: :max}), do: 0
  def wait_ms(%{speed: speed}), do: round(@step_ms / speed)

  @doc "The pace after a step that ended now."
  @spec stepped(t(), now_ms :: integer()) :: t()
  def stepped(pace, now_ms) do
    left = if pace.left == :all, do: :all, else: pace.left - 1
    %{pace | left: left, marks: mark(pace.marks, now_ms)}
  end

  # One mark a tenth of a second is enough, however fast it goes.
  defp mark([], now_ms), do: [{now_ms, 0}]

  defp mark([{at_ms, steps}, {before_ms, _} = before | marks], now_ms)
       when at_ms - before_ms < @step_ms and now_ms - before_ms < @step_ms,
       do: [{now_ms, steps + 1}, before | marks]

  defp mark([{_at_ms, steps} | _] = marks, now_ms) do
    recent = Enum.take_while(marks, fn {at_ms, _} -> now_ms - at_ms <= @measured_ms end)
    [{now_ms, steps + 1} | recent]
  end

  @doc """
  In words, for people: what is asked for, and what was reached.

      iex> pace = Enum.reduce(0..10, Console.Pace.new(2.0), &Console.Pace.stepped(&2, &1 * 70))
      iex> Console.Pace.words(pace)
      "2.0x asked, 1.4x reached"
      iex> Console.Pace.words(%{pace | left: 0})
      "paused, then 2.0x"
  """
  @spec words(t()) :: String.t()
  def words(%{left: 0, speed: 1.0}), do: "paused"
  def words(%{left: 0, speed: :max}), do: "paused, then as fast as it goes"
  def words(%{left: 0, speed: speed}), do: "paused, then #{decimals(speed)}x"
  def words(%{left: 1} = pace), do: "1 step left" <> reached(pace)
  def words(%{left: left} = pace) when is_integer(left), do: "#{left} steps left" <> reached(pace)
  def words(%{speed: :max} = pace), do: "as fast as it goes" <> reached(pace)
  def words(%{speed: speed} = pace), do: "#{decimals(speed)}x asked" <> reached(pace)

  defp reached(%{marks: [_, _ | _] = marks}) do
    {{to_ms, to}, {from_ms, from}} = {List.first(marks), List.last(marks)}

    if to_ms > from_ms,
      do: ", #{decimals((to - from) * @step_ms / (to_ms - from_ms))}x reached",
      else: ""
  end

  defp reached(_too_few), do: ""
  defp decimals(number), do: :erlang.float_to_binary(number * 1.0, decimals: 1)
end
