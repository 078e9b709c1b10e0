defmodule Robot.Behaviour.Move do
  @moduledoc """
  Drives at a given speed until replaced. Options: `linear` (m/s), `turn` (rad/s), both
  required, and `for_ms` (default `nil`, no limit), after which it ends with outcome 1.
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Twist}
  alias Robot.Wish

  @impl Robot.Behaviour
  def new(options) do
    table = [
      linear: [{:number, -1.0e6, 1.0e6, "m/s"}, required: true],
      turn: [{:number, -1.0e6, 1.0e6, "rad/s"}, required: true],
      for_ms: [{:number, 0, 1.0e6, "ms"}, default: nil]
    ]

    options = Options.check!(options, table, "move")
    twist = Twist.new(options[:linear], options[:turn])
    {__MODULE__, %{twist: twist, for_ms: options[:for_ms], since_ms: nil}}
  end

  @impl Robot.Behaviour
  def update(options, state) do
    linear = Keyword.get(options, :linear, state.twist.linear)
    turn = Keyword.get(options, :turn, state.twist.turn)
    {_, fresh} = new(linear: linear, turn: turn, for_ms: state.for_ms)
    {__MODULE__, %{fresh | since_ms: state.since_ms}}
  end

  @impl Robot.Behaviour
  def tick(percept, state) do
    since_ms = state.since_ms || percept.at_ms

    if state.for_ms && percept.at_ms - since_ms >= state.for_ms do
      {:done, 1, Wish.new(:move, Twist.zero(), 0.5)}
    else
      {:running, Wish.new(:move, state.twist, 0.5), {__MODULE__, %{state | since_ms: since_ms}}}
    end
  end
end
