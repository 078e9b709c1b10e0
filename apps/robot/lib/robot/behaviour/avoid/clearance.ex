defmodule Robot.Behaviour.Avoid.Clearance do
  @moduledoc """
  What a robot keeps clear of, and how far, as half-planes of velocities for
  `Robot.Navigation.Orca`. Pure.
  """
  alias Hal.Pose
  alias Robot.Navigation.Orca
  alias Robot.Percept

  # Metres kept to others by reaction; to standing ones less when there is no more room.
  @standing_margin 0.12
  @moving_margin 0.15
  @closest 0.04
  @horizon_s 2.5
  @standing_horizon_s 1.2

  @typedoc "A neighbour (`Robot.Behaviour.Avoid.Neighbours.t/0`), or a thing that stands."
  @type body :: %{
          required(:at) => Pose.point(),
          required(:velocity) => {float(), float()},
          required(:radius) => float(),
          required(:share) => float(),
          required(:standing?) => boolean(),
          required(:gap) => float(),
          optional(atom()) => term()
        }

  @doc "Discs `{x, y, radius}` as bodies that stand."
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
  The half-planes of velocities that keep clear of the robots, and of the eight nearest things.
  """
  @spec planes(Percept.t(), [body()], [body()]) :: [Orca.half_plane()]
  def planes(percept, robots, things) do
    at = Pose.point(percept.pose)
    own = own_velocity(percept)
    nearest = things |> Enum.filter(&(&1.gap < 1.5)) |> Enum.sort_by(& &1.gap) |> Enum.take(8)

    for %{gap: gap} = other <- nearest ++ robots do
      margin = if other.standing?, do: @standing_margin, else: @moving_margin
      horizon_s = if other.standing?, do: @standing_horizon_s, else: @horizon_s
      # The margin is a wish; only what is nearer than the tightest is pushed away from.
      margin = max(@closest, min(margin, gap - 0.01))
      radius = percept.profile.radius + other.radius + margin
      Orca.half_plane(at, own, other.at, other.velocity, radius, horizon_s, other.share)
    end
  end

  defp own_velocity(%{odometry: %{twist: twist}, pose: pose}),
    do: {twist.linear * :math.cos(pose.heading), twist.linear * :math.sin(pose.heading)}

  defp own_velocity(_percept), do: {0.0, 0.0}
end
