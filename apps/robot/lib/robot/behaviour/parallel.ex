defmodule Robot.Behaviour.Parallel do
  @moduledoc """
  Runs behaviours side by side; the wish with the greatest weight counts. It ends when all
  have ended, with the outcome of the last, or, with `ends: :any`, when one has ended, with its
  outcome. If several end in the same tick, the last, or the first, in the list counts.

  Options: `parts`, a list of behaviours (required, at least one); `ends`, `:all` (default) or
  `:any`.
  """
  @behaviour Robot.Behaviour
  alias Robot.Behaviour.Arbiter
  alias Hal.Options

  @impl Robot.Behaviour
  def new(options) do
    table = [
      parts: [behaviours(), required: true],
      ends: [{:one_of, [:all, :any]}, default: :all]
    ]

    options = Options.check!(options, table, "parallel")
    {__MODULE__, %{parts: options[:parts], ends: options[:ends], last_by: nil}}
  end

  defp behaviours, do: {:check, &match?([_ | _], &1), "a list of behaviours"}

  @impl Robot.Behaviour
  def tick(percept, state) do
    results = Enum.map(state.parts, &Robot.Behaviour.tick(&1, percept))
    wish = results |> Enum.map(&wish/1) |> Arbiter.choose(state.last_by)
    outcomes = for {:done, outcome, _wish} <- results, do: outcome
    running = for {:running, _wish, behaviour} <- results, do: behaviour

    case {state.ends, outcomes, running} do
      {:any, [outcome | _], _running} -> {:done, outcome, wish}
      {_ends, [_ | _], []} -> {:done, List.last(outcomes), wish}
      _ -> {:running, wish, {__MODULE__, %{state | parts: running, last_by: wish && wish.by}}}
    end
  end

  defp wish({:running, wish, _behaviour}), do: wish
  defp wish({:done, _outcome, wish}), do: wish
end
