defmodule Robot.Behaviour do
  @moduledoc """
  A behaviour turns what a robot perceives into a wish, one tick (100 ms) at a time. Pure: no
  clock, no process, no chance; time is `percept.at_ms`.

  A running behaviour is a pair `{module, state}`, so that behaviours can hold, start and combine
  others (`Robot.Behaviour.Sequence`, `.Parallel`, `.Fsm`, …). It goes on until it reports an
  outcome, an integer as in the thesis (R12), which combinators use to choose what comes next.
  """
  alias Robot.{Percept, Wish}

  @type t :: {module(), state :: term()}
  @type outcome :: integer()
  @type result :: {:running, Wish.t() | nil, t()} | {:done, outcome(), Wish.t() | nil}

  @doc "A behaviour with these options; wrong ones raise `ArgumentError`."
  @callback new(keyword()) :: t()

  @doc "One tick."
  @callback tick(Percept.t(), state :: term()) :: result()

  @doc "The same running behaviour with some options changed, as a target that moves every tick."
  @callback update(keyword(), state :: term()) :: t()

  @optional_callbacks update: 2

  @doc "One tick of a running behaviour."
  @spec tick(t(), Percept.t()) :: result()
  def tick({module, state}, %Percept{} = percept), do: module.tick(percept, state)

  @doc "Changes options of a running behaviour; one that has nothing to change stays as it is."
  @spec update(t(), keyword()) :: t()
  def update({module, state} = behaviour, options) do
    # Loaded already: the pair was made by its `new/1`.
    if function_exported?(module, :update, 2), do: module.update(options, state), else: behaviour
  end
end
