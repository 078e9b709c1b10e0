defmodule Robot.Behaviour.Avoid.Clearance do
  @moduledoc false
  # Expresses the distances that a robot keeps from robots and obstacles, as half-planes of velocities for
  # `Nav.Orca`. Pure.
  alias Hal.Pose
  alias Nav.Orca
  alias Robot.Percept

  # Desired distances (metres) to standing and to moving bodies; the least one applies when there
  # is no more room.
  @standing_margin 0.12
  @moving_margin 0.15
  @closest 0.04
  @horizon_s 2.5
  @standing_horizon_s 1.2

  @typedoc "A neighbour (`Robot.Behaviour.Avoid.Neighbours.t/0`), or a standing obstacle."
  @type body :: %{
          required(:at) => Pose.point(),
          required(:velocity) => {float(), float()},
          required(:radius) => float(),
          required(:share) => float(),
          required(:standing?) => boolean(),
          required(:gap) => float(),
          optional(atom()) => term()
        }

  @doc "Converts discs `{x, y, radius}` to standing bodies."
  @spec standing([{float(), float(), float()}], Percept.t()) :: [body()]
  def standing(discs, percept) do
    for {x, y, radius} <- discs do
      gap = Pose.distance(percept.pose, {x, y}) - radius - percept.profile.radius

      %{
        id: nil,
        at: {x, y},
        velocity: {0.0, 0.0},
        radius: radius,
        share: 1.0,
        standing?: true,
        gap: gap
      }
    end
  end

  @doc """
  The half-planes of velocities that keep clear of the robots, and of the nearest standing
  obstacles, at most eight, within 1.5 m.
  """
  @spec planes(Percept.t(), [body()], [body()]) :: [Orca.half_plane()]
  def planes(percept, robots, things) do
    at = Pose.point(percept.pose)
    own = own_velocity(percept)
    nearest = things |> Enum.filter(&(&1.gap < 1.5)) |> Enum.sort_by(& &1.gap) |> Enum.take(8)

    for %{gap: gap} = other <- nearest ++ robots do
      margin = if other.standing?, do: @standing_margin, else: @moving_margin
      horizon_s = if other.standing?, do: @standing_horizon_s, else: @horizon_s
      # The desired margin shrinks with the room there is; the robot moves away only from what is
      # nearer than the least margin.
      margin = max(@closest, min(margin, gap - 0.01))
      radius = percept.profile.radius + other.radius + margin
      Orca.half_plane(at, own, other.at, other.velocity, radius, horizon_s, other.share)
    end
  end

  defp own_velocity(%{odometry: %{twist: twist}, pose: pose}),
    do: {twist.linear * :math.cos(pose.heading), twist.linear * :math.sin(pose.heading)}

  defp own_velocity(_percept), do: {0.0, 0.0}
end
