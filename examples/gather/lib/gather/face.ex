defmodule Gather.Face do
  @moduledoc """
  Turns on the spot until the robot faces a place. Options: `x`, `y` (map frame, metres, required), `tolerance` (radians,
  default 0.1). Outcome 1: it does.
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Pose, Twist}
  alias Robot.Wish

  @table [
    x: [{:number, -100, 100, "m"}, required: true],
    y: [{:number, -100, 100, "m"}, required: true],
    tolerance: [{:number, 0.02, 1, "rad"}, default: 0.1]
  ]

  @impl Robot.Behaviour
  def new(options), do: {__MODULE__, Map.new(Options.check!(options, @table, "face"))}

  @impl Robot.Behaviour
  def tick(%{pose: nil}, state), do: {:running, nil, {__MODULE__, state}}

  def tick(%{pose: pose, profile: profile}, state) do
    left = Pose.bearing(pose, {state.x, state.y})

    if abs(left) < state.tolerance do
      {:done, 1, Wish.new(:face, Twist.zero(), 0.5)}
    else
      turn = left |> max(-profile.max_turn) |> min(profile.max_turn)
      {:running, Wish.new(:face, Twist.new(0.0, turn), 0.5), {__MODULE__, state}}
    end
  end
end
