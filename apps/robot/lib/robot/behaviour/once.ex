defmodule Robot.Behaviour.Once do
  @moduledoc """
  Calls a function with the percept once and ends with the outcome that it returns. It
  serves for checks and for choosing between behaviours. Options: `run`,
  `(Robot.Percept.t() -> integer)` (required).
  """
  @behaviour Robot.Behaviour
  alias Hal.Options

  @impl Robot.Behaviour
  def new(options) do
    table = [run: [{:check, &is_function(&1, 1), "a function of a percept"}, required: true]]
    {__MODULE__, Options.check!(options, table, "once")[:run]}
  end

  @impl Robot.Behaviour
  def tick(percept, run) do
    outcome = run.(percept)
    true = is_integer(outcome)
    {:done, outcome, nil}
  end
end
