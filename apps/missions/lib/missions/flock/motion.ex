defmodule Missions.Flock.Motion do
  @moduledoc false
  # Computes the velocity of a robot of the flock, tick by tick, from its percept: the accelerations of
  # `Missions.Flock.Field`, integrated. Pure; metres, m/s, in the frame of the percept's pose.
  alias Hal.Pose
  alias Missions.Flock.{Field, Members}
  alias Robot.Behaviour.Avoid.Neighbours
  alias Robot.Percept

  # Seconds of a tick.
  @tick_s 0.1
  # A robot integrates its velocity, and takes so much of what its wheels measure, so that what stops them counts.
  @measured 0.1
  # Metres at which echoes count, and how many of the nearest.
  @obstacle_range 1.0
  @echoes 3
  # How far (metres) from where it tells a robot may seem to be, if this one knew its own place exactly; and how much more
  # at most, if it does not.
  @told_off 0.2
  @unsure 1.0

  @typedoc """
  `spacing` between neighbours, `top` the greatest speed, and `guide`, the agent that all follow: where it is, its velocity, and
  with which speed from how far it draws a robot (`Missions.Flock.Field.guide/5`).
  """
  @type rules :: %{
          spacing: float(),
          top: float(),
          guide: {Pose.point(), Field.vector(), speed :: float(), wide :: float()}
        }

  @doc "The next velocity, after `last` (`nil` at the first tick), among these neighbours."
  @spec velocity(Field.vector() | nil, Percept.t(), [Members.agent()], rules()) :: Field.vector()
  def velocity(last, %Percept{pose: pose} = percept, near, rules) do
    at = Pose.point(pose)
    own = {vx, vy} = mix(last, measured(percept))
    {guide, velocity, speed, wide} = rules.guide

    forces = [
      Field.neighbours(at, own, near, rules.spacing),
      Field.obstacles(at, own, echoes(percept), @obstacle_range),
      Field.guide(at, own, {guide, velocity}, speed, wide)
    ]

    {ux, uy} = Enum.reduce(forces, fn {ax, ay}, {bx, by} -> {ax + bx, ay + by} end)
    clip({vx + @tick_s * ux, vy + @tick_s * uy}, rules.top)
  end

  defp measured(%{odometry: %{twist: twist}, pose: pose}),
    do: {twist.linear * :math.cos(pose.heading), twist.linear * :math.sin(pose.heading)}

  defp measured(_percept), do: {0.0, 0.0}

  defp mix(nil, measured), do: measured

  defp mix({ax, ay}, {bx, by}),
    do: {(1 - @measured) * ax + @measured * bx, (1 - @measured) * ay + @measured * by}

  # An echo that may be another robot, which is not quite where it tells, is no obstacle: members keep their spacing by what
  # they tell, and `Robot.Behaviour.Avoid` looks at all echoes.
  defp echoes(percept) do
    off = @told_off + unsure(percept)
    bodies = for {_id, peer} <- percept.peers, do: {peer.pose.x, peer.pose.y, peer.radius + off}

    percept
    |> Neighbours.unknown(bodies)
    |> Enum.filter(&(&1.gap < @obstacle_range))
    |> Enum.sort_by(& &1.gap)
    |> Enum.take(@echoes)
    |> Enum.map(& &1.at)
  end

  defp unsure(%{uncertainty: %{radius: radius}}), do: min(radius, @unsure)
  defp unsure(_percept), do: 0.0

  defp clip({x, y} = velocity, most) do
    size = :math.sqrt(x * x + y * y)
    if size > most, do: {x * most / size, y * most / size}, else: velocity
  end
end
