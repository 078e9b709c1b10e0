defmodule Lab.Check do
  @moduledoc """
  Judges one expectation of a scenario moment by moment. Pure.

  | status | meaning |
  |---|---|
  | `:open` | not decided |
  | `:holding` | not violated, which is enough if the run ends now |
  | `{:held, at_s, figures}`, `{:failed, at_s, figures}` | decided |

  `Lab.Check.Kind` says what the modules answer that look at a moment. What is never to be (`{:never, invariant}`) is judged as in
  `mix chaos` (`Lab.Check.Invariants`).
  """
  alias Lab.Check.{Expectation, Violation}
  alias Lab.Moment

  @enforce_keys [:expectation, :kind, :asked, :window]
  defstruct @enforce_keys ++ [memory: :new, status: :open]

  @type status ::
          :open
          | :holding
          | {:held | :failed, at_s :: float(), figures :: String.t()}

  @type t :: %__MODULE__{
          expectation: Expectation.t(),
          kind: module(),
          asked: Expectation.t(),
          window: {number(), number() | :end},
          memory: :new | :unseen | term(),
          status: status()
        }

  @doc "The check of an expectation, before the first moment."
  @spec new(Expectation.t()) :: t()
  def new(expectation) do
    {kind, asked} = Expectation.asked(expectation)

    %__MODULE__{
      expectation: expectation,
      kind: kind,
      asked: asked,
      window: Expectation.window(expectation),
      status: if(match?({:never, _invariant}, expectation), do: :holding, else: :open)
    }
  end

  @doc "One moment, every 100 ms. What is decided stays."
  @spec tick(t(), Moment.t()) :: t()
  def tick(%__MODULE__{status: {_decided, _at_s, _figures}} = check, _moment), do: check

  def tick(%__MODULE__{window: {from_s, to_s}} = check, moment) do
    at_s = Moment.at_s(moment)

    cond do
      at_s < from_s ->
        check

      # A look in real time may come after the window: what is then is not asked.
      at_s > to_s and check.status == :holding ->
        %{check | status: {:held, to_s, "to the end of that time"}}

      true ->
        judged(check, moment, at_s)
    end
  end

  defp judged(%{memory: :new} = check, moment, at_s),
    do: judged(%{check | memory: check.kind.new(moment.options)}, moment, at_s)

  defp judged(%{asked: asked, window: {_from_s, to_s}} = check, moment, at_s) do
    over? = to_s != :end and at_s >= to_s

    case check.kind.note(asked, moment, check.memory) do
      :unseen ->
        %{check | memory: :unseen, status: :holding}

      {:never, violations, memory} ->
        %{check | memory: memory, status: :holding} |> violated(violations)

      {kind, so?, figures, memory} ->
        %{check | memory: memory, status: status(kind, so?, over?, at_s, figures)}
    end
  end

  defp violated(%{expectation: {:never, invariant}} = check, violations) do
    case for %{invariant: ^invariant} = one <- violations, do: {one.at_ms, one.robots, one} do
      [] ->
        check

      some ->
        {at_ms, _robots, first} = Enum.min(some)
        %{check | status: {:failed, at_ms / 1000, Violation.line(first)}}
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
  The verdict if the run ended now, at this second, with this report (`Lab.Trial.result/1`): what was not violated holds, what did
  not come about fails.
  """
  @spec verdict(t(), at_s :: float(), result :: map()) :: verdict()
  def verdict(check, at_s, result) do
    {held?, at_s, figures} =
      case finish(check, result) do
        %{status: {word, at_s, figures}} -> {word == :held, at_s, figures}
        %{memory: :unseen} -> {nil, at_s, "only a run in lockstep is judged by this"}
        %{status: :open} -> {false, at_s, "the run ended before that was decided"}
        %{status: :holding} -> {true, at_s, "to the end of the run"}
      end

    %{expectation: check.expectation, held?: held?, at_s: at_s, figures: figures}
  end

  defp finish(%{status: :holding, kind: kind, memory: memory} = check, result) do
    if memory not in [:new, :unseen] and function_exported?(kind, :finish, 2),
      do: violated(check, kind.finish(memory, result)),
      else: check
  end

  defp finish(check, _result), do: check
end
