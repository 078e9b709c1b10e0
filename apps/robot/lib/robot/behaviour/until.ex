defmodule Robot.Behaviour.Until do
  @moduledoc """
  Runs another behaviour until a condition holds (R11). Outcome: the inner one's when it ends
  first; when the condition does, `outcome` (default 2).

  Options: `inner`, a behaviour (required); `stop?`, a function of the percept, or `after_ms`,
  a time: one of them at least.
  """
  @behaviour Robot.Behaviour
  alias Robot.Behaviour
  alias Robot.Behaviour.Options

  @impl Behaviour
  def new(options) do
    options = Keyword.validate!(options, [:inner, stop?: nil, after_ms: nil, outcome: 2])

    if options[:stop?] == nil and options[:after_ms] == nil,
      do: raise(ArgumentError, "option stop? or after_ms is missing")

    {__MODULE__,
     %{
       inner: Options.check!(options, :inner, &match?({_, _}, &1), "a behaviour"),
       stop?:
         Options.check!(
           options,
           :stop?,
           &(&1 == nil or is_function(&1, 1)),
           "a function of a percept"
         ),
       after_ms: Options.optional!(options, :after_ms, 0.0, 1.0e9),
       outcome: Options.check!(options, :outcome, &is_integer/1, "an integer"),
       since_ms: nil
     }}
  end

  @impl Behaviour
  def update(options, state),
    do: {__MODULE__, %{state | inner: Behaviour.update(state.inner, options)}}

  @impl Behaviour
  def tick(percept, state) do
    state = %{state | since_ms: state.since_ms || percept.at_ms}

    if late?(percept, state) or (state.stop? != nil and state.stop?.(percept)),
      do: {:done, state.outcome, nil},
      else: run(percept, state)
  end

  defp late?(_percept, %{after_ms: nil}), do: false
  defp late?(percept, state), do: percept.at_ms - state.since_ms >= state.after_ms

  defp run(percept, state) do
    case Behaviour.tick(state.inner, percept) do
      {:running, wish, inner} -> {:running, wish, {__MODULE__, %{state | inner: inner}}}
      done -> done
    end
  end
end
