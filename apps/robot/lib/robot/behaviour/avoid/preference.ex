defmodule Robot.Behaviour.Avoid.Preference do
  @moduledoc false
  # Computes the velocity that a robot prefers, before `Nav.Orca` limits it by the other bodies: along its
  # route, to the right of oncoming robots, and away from what is close. Pure; velocities in m/s, points in metres, in the
  # frame of the percept's pose.
  alias Hal.Pose
  alias Robot.Behaviour.Avoid.Clearance
  alias Robot.Percept

  # The speed (m/s) away from a close body at contact, and the gap (metres) that counts as close.
  @drift 0.25
  @close 0.16
  @to_the_right :math.pi() / 12

  @type velocity :: {float(), float()}

  @doc """
  The velocity toward the first corner of the route, at `speed`. The wished velocity remains if
  the route has no corner before the goal.
  """
  @spec toward(velocity(), [Pose.point()] | nil, speed :: float(), Percept.t()) :: velocity()
  def toward(velocity, [_goal], _speed, _percept), do: velocity
  def toward(velocity, nil, _speed, _percept), do: velocity

  def toward(_velocity, [{x, y} | _], speed, percept) do
    angle = :math.atan2(y - percept.pose.y, x - percept.pose.x)
    {speed * :math.cos(angle), speed * :math.sin(angle)}
  end

  @doc """
  The velocity turned a little to the right if another robot comes toward this one and the next
  corner is more than 1 m away; or turned by the angle `aside` if the robot has made no progress
  for a while (`Robot.Behaviour.Avoid.Progress`).
  """
  @spec keep_right(
          velocity(),
          aside :: float() | nil,
          [Pose.point()] | nil,
          [Clearance.body()],
          Percept.t()
        ) :: velocity()
  def keep_right(velocity, aside, _way, _robots, _percept) when aside != nil,
    do: turn(velocity, aside)

  def keep_right(velocity, nil, way, robots, percept) do
    far? = way != nil and Pose.distance(percept.pose, hd(way)) > 1.0

    if far? and Enum.any?(robots, &coming?(&1, velocity, percept)),
      do: turn(velocity, -@to_the_right),
      else: velocity
  end

  # A robot that moves, is ahead, comes nearer, and drives roughly in the opposite direction.
  defp coming?(%{standing?: true}, _velocity, _percept), do: false

  defp coming?(%{at: {x, y}, velocity: {ox, oy}, gap: gap}, {vx, vy}, percept) do
    dx = x - percept.pose.x
    dy = y - percept.pose.y

    gap < 3.0 and dx * vx + dy * vy > 0 and dx * (vx - ox) + dy * (vy - oy) > 0 and
      ox * vx + oy * vy < 0
  end

  @doc """
  The velocity with a component away from standing bodies that are close, so that the robot drifts
  into the middle of a narrow passage; a body near the robot's goal adds none.
  """
  @spec spread(velocity(), [Clearance.body()], Pose.point() | nil, Percept.t()) :: velocity()
  def spread(velocity, others, goal, percept) do
    Enum.reduce(others, velocity, fn %{at: {x, y}} = other, {vx, vy} = velocity ->
      if other.standing? and other.gap < @close and not by_goal?(other, goal, percept) do
        push = @drift * (1 - max(other.gap, 0.0) / @close)
        distance = max(Pose.distance(percept.pose, {x, y}), 0.01)
        {vx + push * (percept.pose.x - x) / distance, vy + push * (percept.pose.y - y) / distance}
      else
        velocity
      end
    end)
  end

  defp by_goal?(_other, nil, _percept), do: true

  defp by_goal?(%{at: at, radius: radius}, goal, percept) do
    Pose.distance(percept.pose, goal) < 0.8 and
      Pose.distance(at, goal) < percept.profile.radius + radius + 0.25
  end

  defp turn({vx, vy}, angle) do
    c = :math.cos(angle)
    s = :math.sin(angle)
    {c * vx - s * vy, s * vx + c * vy}
  end
end
