defmodule Robot.Behaviour.Every do
  @moduledoc """
  Runs another behaviour again and again (R11): a fresh one each `period_ms`, or as soon as the
  last one has ended, whichever is later. Never ends by itself.

  Options: `start`, `{module, options}` of the behaviour (required); `period_ms` (default 0: at once).
  """
  @behaviour Robot.Behaviour
  alias Robot.Behaviour
  alias Robot.Behaviour.Options

  @impl Behaviour
  def new(options) do
    options = Keyword.validate!(options, [:start, period_ms: 0])

    {__MODULE__,
     %{
       start:
         Options.check!(
           options,
           :start,
           &(match?({_, [_ | _]}, &1) or match?({_, []}, &1)),
           "{module, options}"
         ),
       period_ms: Options.number!(options, :period_ms, 0.0),
       running: nil,
       since_ms: nil
     }}
  end

  @impl Behaviour
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
    case Behaviour.tick(state.running, percept) do
      {:running, wish, running} -> {:running, wish, {__MODULE__, %{state | running: running}}}
      {:done, _outcome, wish} -> {:running, wish, {__MODULE__, %{state | running: nil}}}
    end
  end
end
