defmodule Robot.Behaviour.Decorator.Until do
  @moduledoc """
  Runs another behaviour until a condition holds. Outcome: that of the inner behaviour if it
  ends first, else `outcome` (default 2).

  Options: `inner`, a behaviour (required); the condition, at least one of `stop?`, a function of
  the percept, and `after_ms`, a time since the first tick; `outcome`.
  """
  @behaviour Robot.Behaviour
  alias Hal.Options

  @impl Robot.Behaviour
  def new(options) do
    table = [
      inner: [{:check, &match?({_, _}, &1), "a behaviour"}, required: true],
      stop?: [{:check, &is_function(&1, 1), "a function of a percept"}, default: nil],
      after_ms: [{:number, 0, 1.0e9, "ms"}, default: nil],
      outcome: [{:integer, -1000, 1000}, default: 2]
    ]

    options = Options.check!(options, table, "until")

    if options[:stop?] == nil and options[:after_ms] == nil,
      do: raise(ArgumentError, "until option stop? or after_ms is missing")

    {__MODULE__, Enum.into(options, %{since_ms: nil})}
  end

  @impl Robot.Behaviour
  def update(options, state),
    do: {__MODULE__, %{state | inner: Robot.Behaviour.update(state.inner, options)}}

  @impl Robot.Behaviour
  def tick(percept, state) do
    state = %{state | since_ms: state.since_ms || percept.at_ms}

    if late?(percept, state) or (state.stop? != nil and state.stop?.(percept)),
      do: {:done, state.outcome, nil},
      else: run(percept, state)
  end

  defp late?(_percept, %{after_ms: nil}), do: false
  defp late?(percept, state), do: percept.at_ms - state.since_ms >= state.after_ms

  defp run(percept, state) do
    case Robot.Behaviour.tick(state.inner, percept) do
      {:running, wish, inner} -> {:running, wish, {__MODULE__, %{state | inner: inner}}}
      done -> done
    end
  end
end
