defmodule Robot.Behaviour.Move do
  @moduledoc """
  Drives at a given speed until replaced (R32). Options: `linear` (m/s), `turn` (rad/s), both
  required, and `for_ms` (default `nil`, for ever), after which it ends with outcome 1.
  """
  @behaviour Robot.Behaviour
  alias Hal.Twist
  alias Robot.Behaviour.Options
  alias Robot.Wish

  @impl Robot.Behaviour
  def new(options) do
    options = Keyword.validate!(options, [:linear, :turn, for_ms: nil])
    twist = Twist.new(Options.number!(options, :linear), Options.number!(options, :turn))
    for_ms = Options.optional!(options, :for_ms, 0.0)
    {__MODULE__, %{twist: twist, for_ms: for_ms, since_ms: nil}}
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
