defmodule Robot.Behaviour.Sequence do
  @moduledoc """
  Runs behaviours one after another. Its outcome is that of the last one. If `while` is set
  to an outcome, the sequence ends as soon as a step ends with another one, and has that outcome.

  Options: `steps`, a list of behaviours (required, at least one); `while`, an outcome (default
  none).
  """
  @behaviour Robot.Behaviour
  alias Hal.Options

  @impl Robot.Behaviour
  def new(options) do
    behaviours = {:check, &match?([_ | _], &1), "a list of behaviours"}
    table = [steps: [behaviours, required: true], while: [{:integer, -1000, 1000}, default: nil]]
    {__MODULE__, Map.new(Options.check!(options, table, "sequence"))}
  end

  @impl Robot.Behaviour
  def tick(percept, %{steps: [step | rest]} = state) do
    case Robot.Behaviour.tick(step, percept) do
      {:running, wish, step} -> {:running, wish, {__MODULE__, %{state | steps: [step | rest]}}}
      {:done, outcome, wish} -> next(outcome, wish, rest, percept, state)
    end
  end

  @impl Robot.Behaviour
  def routed(route, percept, %{steps: [step | rest]} = state),
    do: {__MODULE__, %{state | steps: [Robot.Behaviour.routed(step, route, percept) | rest]}}

  # The next step runs within the same tick, so that no tick is lost between two steps.
  defp next(outcome, wish, [], _percept, _state), do: {:done, outcome, wish}

  defp next(outcome, wish, _rest, _percept, %{while: while})
       when while != nil and outcome != while,
       do: {:done, outcome, wish}

  defp next(_outcome, _wish, rest, percept, state), do: tick(percept, %{state | steps: rest})
end
