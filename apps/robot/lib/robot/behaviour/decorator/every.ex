defmodule Robot.Behaviour.Decorator.Every do
  @moduledoc """
  Runs another behaviour repeatedly: starts it again `period_ms` after its last start, or at
  the tick after its end, whichever is later. Never ends by itself.

  Options: `start`, `{module, options}` of the behaviour (required); `period_ms` (default 0).
  """
  @behaviour Robot.Behaviour
  alias Hal.Options

  @impl Robot.Behaviour
  def new(options) do
    behaviour = {:check, &match?({_, list} when is_list(list), &1), "{module, options}"}

    table = [
      start: [behaviour, required: true],
      period_ms: [{:number, 0, 1.0e6, "ms"}, default: 0.0]
    ]

    state = %{running: nil, since_ms: nil}
    {__MODULE__, Enum.into(Options.check!(options, table, "every"), state)}
  end

  @impl Robot.Behaviour
  def tick(percept, %{running: nil} = state) do
    if state.since_ms == nil or percept.at_ms - state.since_ms >= state.period_ms do
      {module, options} = state.start
      go_on(percept, %{state | running: module.new(options), since_ms: percept.at_ms})
    else
      {:running, nil, {__MODULE__, state}}
    end
  end

  def tick(percept, state), do: go_on(percept, state)

  defp go_on(percept, state) do
    case Robot.Behaviour.tick(state.running, percept) do
      {:running, wish, running} -> {:running, wish, {__MODULE__, %{state | running: running}}}
      {:done, _outcome, wish} -> {:running, wish, {__MODULE__, %{state | running: nil}}}
    end
  end
end
