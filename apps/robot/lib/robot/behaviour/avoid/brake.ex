defmodule Robot.Behaviour.Avoid.Brake do
  @moduledoc false
  # Checks the speed that avoidance has found, before caution, arbiter and gate (docs/architecture.md, section 1): if the robot drove on
  # for a moment and then braked, would it come too near to another robot that does the same? If so, it drives more slowly, or not at all. The turn rate is not limited. Pure.
  #
  # The wheels cannot follow a wished velocity immediately, so the real path differs from the
  # planned one; this check takes that into account.
  alias Hal.{Pose, Profile, Twist}
  alias Robot.Behaviour.Avoid.Neighbours

  # How long a decision holds: a tick, the age of the others' reports, the lag of the wheels.
  @delay_s 0.35
  @samples [0.2, 0.4, 0.6, 0.8, 1.0, 1.3]
  # Metres between bodies. The margin to standing robots is smaller, because their places are
  # known better and the robot must get through narrow gaps.
  @margin 0.08
  @standing_margin 0.03
  @parting 0.02
  @parts [1.0, 0.7, 0.45, 0.2]

  @doc "The same speed, with the linear part reduced as far as this check requires."
  @spec twist(Twist.t(), Pose.t(), Profile.t(), [Neighbours.t()]) :: Twist.t()
  def twist(%Twist{linear: linear} = twist, _pose, _profile, _neighbours) when linear == 0.0,
    do: twist

  def twist(%Twist{} = twist, pose, profile, neighbours) do
    case Enum.filter(neighbours, &(&1.gap < 1.2)) do
      [] ->
        twist

      near ->
        paths = Enum.map(near, &path(&1, pose, profile))
        part = Enum.find(@parts, 0.0, &safe?(&1 * twist.linear, twist.turn, profile, paths))
        %{twist | linear: part * twist.linear}
    end
  end

  # The places of the other, relative to this body, at each sample, if it brakes too.
  defp path(%{at: {x, y}, velocity: {vx, vy}, radius: radius} = other, pose, profile) do
    dx = x - pose.x
    dy = y - pose.y
    c = :math.cos(pose.heading)
    s = :math.sin(pose.heading)
    speed = :math.sqrt(vx * vx + vy * vy)
    bx = c * dx + s * dy
    by = c * dy - s * dx
    bvx = c * vx + s * vy
    bvy = c * vy - s * vx

    places =
      for t <- @samples do
        k =
          if speed > 1.0e-6, do: travelled(speed, t, profile.max_acceleration) / speed, else: 0.0

        {bx + k * bvx, by + k * bvy}
      end

    margin = if other.standing?, do: @standing_margin, else: @margin
    limit = profile.radius + radius + margin
    {places, limit, :math.sqrt(bx * bx + by * by)}
  end

  defp safe?(linear, turn, profile, paths) do
    own =
      for t <- @samples do
        s = travelled(abs(linear), t, profile.max_acceleration)
        s = if linear < 0, do: -s, else: s
        # The chord of the arc points along half of the angle turned by then.
        angle = turn * min(t, 0.6) / 2
        {s * :math.cos(angle), s * :math.sin(angle)}
      end

    Enum.all?(paths, fn {places, limit, now} ->
      clear?(own, places, min(limit, now), min(limit, now + @parting))
    end)
  end

  # No sample may be nearer than the limit. Robots that already are may not come nearer, and must
  # be farther apart at the last sample.
  defp clear?([{ax, ay}], [{bx, by}], _limit, last), do: apart?(ax - bx, ay - by, last)

  defp clear?([{ax, ay} | own], [{bx, by} | other], limit, last),
    do: apart?(ax - bx, ay - by, limit) and clear?(own, other, limit, last)

  defp apart?(dx, dy, limit), do: dx * dx + dy * dy >= limit * limit

  # Metres driven after t seconds: at constant speed for the delay, then braking.
  defp travelled(speed, t, _braking) when t <= @delay_s, do: speed * t

  defp travelled(speed, t, braking) do
    brake_s = min(t - @delay_s, speed / braking)
    speed * @delay_s + speed * brake_s - braking * brake_s * brake_s / 2
  end
end
