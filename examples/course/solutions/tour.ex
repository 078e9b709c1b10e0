defmodule Course.Tour do
  @moduledoc "Drives to four places of the map, one after the other. Outcome 1: been at all of them."
  @behaviour Robot.Behaviour
  alias Robot.Behaviour.{Goto, Sequence}

  @places [{3, 3}, {-3, 3}, {-3, -3}, {3, -3}]

  @impl Robot.Behaviour
  def option_table, do: []

  @impl Robot.Behaviour
  def new([]), do: Sequence.new(steps: for({x, y} <- @places, do: Goto.new(x: x, y: y)), while: 1)

  # `new/1` returns a sequence, which ticks itself.
  @impl Robot.Behaviour
  def tick(percept, state), do: Sequence.tick(percept, state)
end
