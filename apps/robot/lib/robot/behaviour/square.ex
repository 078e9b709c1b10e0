defmodule Robot.Behaviour.Square do
  @moduledoc """
  Drives once along a square to the left of where it begins, and stands where it began.

  Option: `side` (0.2 to 10 m, default 1.0). Outcome 1: back again; else that of the corner that it
  gave up (`Robot.Behaviour.Goto`). Without a pose it stands and waits.
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Pose, Twist}
  alias Robot.Wish
  alias Robot.Behaviour.{Goto, Sequence}

  @table [side: [{:number, 0.2, 10.0, "m"}, default: 1.0]]

  @impl Robot.Behaviour
  def new(options \\ []) do
    options = Options.check!(options, @table, "square")
    {__MODULE__, {:begin, options[:side]}}
  end

  @impl Robot.Behaviour
  def tick(%{pose: nil}, {:begin, _side} = state),
    do: {:running, Wish.new(:square, Twist.zero(), 0.5), {__MODULE__, state}}

  def tick(%{pose: pose} = percept, {:begin, side}) do
    corners =
      for {x, y} <- [{side, 0.0}, {side, side}, {0.0, side}, {0.0, 0.0}] do
        {x, y} = Pose.place(pose, {x, y})
        Goto.new(x: x, y: y)
      end

    tick(percept, {:driving, Sequence.new(steps: corners, while: 1)})
  end

  def tick(percept, {:driving, way}) do
    with {:running, wish, way} <- Robot.Behaviour.tick(way, percept),
         do: {:running, wish, {__MODULE__, {:driving, way}}}
  end

  @impl Robot.Behaviour
  def routed(_route, _percept, {:begin, _side} = state), do: {__MODULE__, state}

  def routed(route, percept, {:driving, way}),
    do: {__MODULE__, {:driving, Robot.Behaviour.routed(way, route, percept)}}
end
