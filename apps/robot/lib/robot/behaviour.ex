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

  @doc "One tick of a running behaviour."
  @spec tick(t(), Percept.t()) :: result()
  def tick({module, state}, %Percept{} = percept), do: module.tick(percept, state)
end
