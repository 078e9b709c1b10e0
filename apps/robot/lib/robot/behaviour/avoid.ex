defmodule Robot.Behaviour.Avoid do
  @moduledoc false
  @behaviour Robot.Behaviour
  alias Robot.Behaviour

  @impl Behaviour
  def new(options) do
    options = Keyword.validate!(options, [:inner, discs: []])
    {__MODULE__, %{inner: options[:inner], discs: options[:discs]}}
  end

  @impl Behaviour
  def update(options, state) do
    {discs, inner_options} = Keyword.pop(options, :discs, state.discs)
    {__MODULE__, %{state | discs: discs, inner: Behaviour.update(state.inner, inner_options)}}
  end

  @impl Behaviour
  def tick(percept, state) do
    case Behaviour.tick(state.inner, percept) do
      {:running, wish, inner} -> {:running, wish, {__MODULE__, %{state | inner: inner}}}
      done -> done
    end
  end
end
