defmodule Robot.Behaviour.Velocity do
  @moduledoc """
  Drives with a velocity of the map frame until replaced: it turns toward it, and drives. Without a place to go to nothing
  is planned; `Robot.Behaviour.Avoid` bends the velocity round what is near.

  Options: `velocity` (`{vx, vy}`, m/s, required); slower than 0.03 m/s means that it stands. Without a pose it stands.
  """
  @behaviour Robot.Behaviour
  alias Hal.{Options, Twist}
  alias Robot.Wish
  alias Nav.Steering

  @still 0.03

  @impl Robot.Behaviour
  def new(options) do
    table = [velocity: [{:check, &velocity?/1, "{vx, vy} in m/s"}, required: true]]
    {__MODULE__, Map.new(Options.check!(options, table, "velocity"))}
  end

  defp velocity?({vx, vy}), do: is_number(vx) and is_number(vy) and abs(vx) + abs(vy) < 100
  defp velocity?(_), do: false

  @impl Robot.Behaviour
  def update(options, state) do
    if Robot.Behaviour.same?(options, state, [:velocity]),
      do: {__MODULE__, state},
      else: new(Keyword.merge(Map.to_list(state), options))
  end

  @impl Robot.Behaviour
  def tick(%{pose: pose, profile: profile}, %{velocity: {vx, vy} = velocity} = state) do
    wish =
      if pose == nil or :math.sqrt(vx * vx + vy * vy) < @still,
        do: Wish.new(:velocity, Twist.zero(), 0.5, velocity: {0.0, 0.0}),
        else:
          Wish.new(:velocity, Steering.twist(velocity, pose.heading, profile), 0.5,
            velocity: velocity
          )

    {:running, wish, {__MODULE__, state}}
  end
end
