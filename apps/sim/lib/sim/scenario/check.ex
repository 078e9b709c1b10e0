defmodule Sim.Scenario.Check do
  @moduledoc """
  Judges one expectation tick by tick. Pure.

  | status | meaning |
  |---|---|
  | `:open` | not decided |
  | `:holding` | not violated, which is enough if the run ends now |
  | `{:held, at_s, figures}`, `{:failed, at_s, figures}` | decided |

  An expectation is of one of two kinds. What must come about (`:reach`) holds as soon as it does, and
  fails when its time is up. What must be so all the time (`:keep`) fails as soon as it is not, and
  holds when its time is up, or the run. `Sim.Scenario.Check.Fleet` and `.Bodies` know which. What is
  never to be (`{:never, invariant}`) is judged by `Sim.Invariants`, as in `mix chaos`; what that can say
  at the end of a run alone is asked in `verdict/4`.
  """
  alias Sim.Invariants
  alias Sim.Invariants.Violation
  alias Sim.Scenario.{Expectation, View}
  alias Sim.Scenario.Check.{Bodies, Fleet}

  @enforce_keys [:expectation, :window]
  defstruct @enforce_keys ++ [memory: nil, status: :open]

  @type status ::
          :open
          | :holding
          | {:held | :failed, at_s :: float(), figures :: String.t()}

  @type t :: %__MODULE__{
          expectation: Expectation.t(),
          window: {number(), number() | :end},
          memory: term(),
          status: status()
        }

  @typedoc """
  An answer at one tick within the window: whether it is so now, the figures, and what to remember
  until the next tick.
  """
  @type answer :: {:reach | :keep, so? :: boolean(), figures :: String.t(), memory :: term()}

  @bodies [:at, :in_slot, :still, :moves, :turned, :sees_distance] ++
            [:speed_at_most, :separation_at_least]

  @doc "The check of an expectation, before the first tick."
  @spec new(Expectation.t()) :: t()
  def new(expectation),
    do: %__MODULE__{expectation: expectation, window: Expectation.window(expectation)}

  @doc "One tick of 100 ms, and what the judge of the run has seen up to now. What is decided stays."
  @spec tick(t(), View.t(), Invariants.t()) :: t()
  def tick(%__MODULE__{status: {_decided, _at_s, _figures}} = check, _view, _judge), do: check

  def tick(%__MODULE__{expectation: {:never, _invariant}} = check, _view, judge),
    do: never(check, judge)

  def tick(%__MODULE__{window: {from_s, to_s}} = check, view, _judge) do
    at_s = View.at_s(view)

    cond do
      at_s < from_s ->
        check

      # A look in real time may come after the window: what is then is not asked.
      at_s > to_s and check.status == :holding ->
        %{check | status: {:held, to_s, "to the end of that time"}}

      true ->
        judged(check, view, at_s)
    end
  end

  defp judged(%{window: {_from_s, to_s}, expectation: expectation} = check, view, at_s) do
    module = if elem(expectation, 0) in @bodies, do: Bodies, else: Fleet
    {kind, so?, figures, memory} = module.judge(expectation, view, check.memory)
    over? = to_s != :end and at_s >= to_s
    %{check | memory: memory, status: status(kind, so?, over?, at_s, figures)}
  end

  defp never(%{expectation: {:never, invariant}} = check, judge) do
    case Invariants.first(judge, invariant) do
      nil -> %{check | status: :holding}
      one -> %{check | status: {:failed, one.at_ms / 1000, Violation.line(one)}}
    end
  end

  defp status(:reach, true, _over?, at_s, figures), do: {:held, at_s, figures}
  defp status(:reach, false, true, at_s, figures), do: {:failed, at_s, figures}
  defp status(:reach, false, false, _at_s, _figures), do: :open
  defp status(:keep, false, _over?, at_s, figures), do: {:failed, at_s, figures}
  defp status(:keep, true, true, at_s, figures), do: {:held, at_s, figures}
  defp status(:keep, true, false, _at_s, _figures), do: :holding

  @typedoc "Whether an expectation held, when that was decided, and the figures. `nil`: nothing looked at it."
  @type verdict :: %{
          expectation: Expectation.t(),
          held?: boolean() | nil,
          at_s: float(),
          figures: String.t()
        }

  @doc """
  The verdict if the run ended now, at this second, with its judge (`Sim.Invariants.finish/2`): what was not violated holds, what did
  not come about fails. `judged` are the invariants that the judge looks at.
  """
  @spec verdict(t(), at_s :: float(), Invariants.t(), judged :: [atom()]) :: verdict()
  def verdict(check, at_s, judge, judged \\ Invariants.names()) do
    {word, at_s, figures} = check |> last(judge) |> ended(at_s, judged)
    held? = %{held: true, failed: false, unknown: nil}[word]
    %{expectation: check.expectation, held?: held?, at_s: at_s, figures: figures}
  end

  defp last(%{expectation: {:never, _invariant}, status: status} = check, judge)
       when status in [:open, :holding],
       do: never(check, judge)

  defp last(check, _judge), do: check

  defp ended(%{status: {_word, _at_s, _figures} = decided}, _at_s_now, _judged), do: decided

  defp ended(%{status: :open}, at_s, _judged),
    do: {:failed, at_s, "the run ended before that was decided"}

  defp ended(%{expectation: expectation}, at_s, judged) do
    with {:never, invariant} <- expectation, false <- invariant in judged do
      {:unknown, at_s, "only a run in lockstep is judged by this"}
    else
      _looked_at -> {:held, at_s, "to the end of the run"}
    end
  end
end
