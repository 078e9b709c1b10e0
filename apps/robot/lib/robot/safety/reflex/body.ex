defmodule Robot.Safety.Reflex.Body do
  @moduledoc """
  Computes how fast a body may move near what its sonars and its lidar see. Pure; points in `base_link`.

  For driving, every body counts as the circle round its corners; for turning, a body longer than
  wide counts as a box, whose corners may swing into something.
  """
  alias Hal.{Pose, Profile, Scan}

  @type point :: {x :: float(), y :: float()}

  @clearance 0.15
  # Seconds: a step of the gate and the lag of the wheels.
  @reaction_s 0.15
  # The clearance (metres) to the side of an obstacle that the body would otherwise graze.
  @side 0.03
  # What is so little farther to the side (metres) than that is passed slowly, because a sonar tells the distance of
  # something, but its direction only to within its cone; it counts from so far ahead of the body (metres).
  @beside 0.12
  @beside_from 0.3
  # How fast (m/s) at its nearest, and how much faster for each metre farther to the side.
  @beside_speed 0.1
  @beside_growth 4.0
  # The range (metres) that is assumed for an obstacle too near to be measured.
  @touching 0.05
  # A range is that of an obstacle too near if it is so little more than the sonar's minimum.
  @unmeasured 0.005

  @doc """
  The points that a sonar ring sees. A sonar without an echo, or with a reading that is not a
  range, gives none.

      iex> profile = Hal.Profile.magellan()
      iex> silent = List.duplicate(profile.sonar_max, 16)
      iex> Robot.Safety.Reflex.Body.points(profile, silent)
      []
      iex> [{x, y}] = Robot.Safety.Reflex.Body.points(profile, List.replace_at(silent, 11, 1.0))
      iex> {Float.round(x, 3), Float.round(y, 3)}
      {1.2, 0.0}
  """
  @spec points(Profile.t(), [number()]) :: [point()]
  def points(%Profile{sonars: sonars} = profile, ranges), do: points(sonars, ranges, profile)

  defp points([pose | poses], [range | ranges], profile)
       when is_number(range) and range >= 0 and range < profile.sonar_max do
    range = touched(range, profile.sonar_min)
    x = pose.x + range * :math.cos(pose.heading)
    y = pose.y + range * :math.sin(pose.heading)
    [{x, y} | points(poses, ranges, profile)]
  end

  defp points([_ | poses], [_ | ranges], profile), do: points(poses, ranges, profile)
  defp points(_, _, _profile), do: []

  # At the least range, the obstacle may be anywhere nearer.
  defp touched(range, least),
    do: if(range <= least + @unmeasured, do: min(range, @touching), else: range)

  @doc """
  The points that a lidar sees, as far as they may slow the body down.

      iex> body = %{Hal.Profile.magellan() | scan: Hal.Profile.scan()}
      iex> scan = %Hal.Scan{start: 0.0, step: 0.1, ranges: <<600::16, 0::16, 9000::16, 100::16>>}
      iex> for {x, y} <- Robot.Safety.Reflex.Body.scanned(body, scan), do: {Float.round(x, 3), Float.round(y, 3)}
      [{0.6, 0.0}, {0.048, 0.015}]
  """
  @spec scanned(Profile.t(), Scan.t()) :: [point()]
  def scanned(%Profile{scan: %{pose: mount} = lidar} = profile, %Scan{} = scan) do
    most = horizon(profile) + Pose.distance(Pose.new(0, 0), Pose.point(mount))

    for {direction, range} <- Scan.echoes(scan, min(most, lidar.max)) do
      range = touched(range, lidar.min)
      angle = mount.heading + direction
      {mount.x + range * :math.cos(angle), mount.y + range * :math.sin(angle)}
    end
  end

  # What is farther away (metres) slows down nothing at full speed.
  defp horizon(%Profile{max_linear: speed, max_acceleration: braking, radius: radius} = profile) do
    way = speed * (@reaction_s + profile.sonar_round_s) + speed * speed / (2 * braking)
    radius + @side + @clearance + max(way, @beside_from)
  end

  @doc """
  The greatest speed (m/s) in the direction of `linear` from which the body can stop before the
  points in its way. It keeps 0.15 m from a point straight ahead, and less from one that it would
  only graze. A point may have been seen as long ago as the sonars take for a round.

      iex> profile = Hal.Profile.magellan()
      iex> Robot.Safety.Reflex.Body.free_speed(profile, [{0.35, 0.0}], 0.5)
      0.0
      iex> Robot.Safety.Reflex.Body.free_speed(profile, [{0.35, 0.0}], -0.5) > 10
      true
      iex> Robot.Safety.Reflex.Body.free_speed(profile, [{0.3, 0.5}], 0.5) > 10
      true
      iex> slow = %{profile | sonar_round_s: 0.5}
      iex> for p <- [profile, slow], do: Float.round(Robot.Safety.Reflex.Body.free_speed(p, [{0.6, 0.0}], 0.5), 2)
      [0.43, 0.27]
  """
  @spec free_speed(Profile.t(), [point()], float()) :: float()
  def free_speed(%Profile{max_acceleration: braking} = profile, points, linear) do
    sign = if linear < 0, do: -1.0, else: 1.0
    free = Enum.reduce(points, 1.0e6, fn {x, y}, free -> min(free, gap(profile, sign * x, y)) end)
    fastest(braking, max(free, 0.0), @reaction_s + profile.sonar_round_s)
  end

  # The way before it brakes, v * reaction, counts as well; solved for v.
  defp fastest(braking, free, reaction_s) do
    lost = braking * reaction_s
    :math.sqrt(2 * braking * free + lost * lost) - lost
  end

  @doc """
  The greatest speed (m/s) in the direction of `linear` at which the body may pass the points beside its way: 0.1 m/s
  where it would all but touch one, no limit where 0.15 m are left.

      iex> profile = Hal.Profile.magellan()
      iex> for y <- [0.22, 0.24, 0.29, 0.36], do: Float.round(Robot.Safety.Reflex.Body.passing_speed(profile, [{0.2, y}], 0.5), 2)
      [1.0e6, 0.14, 0.34, 1.0e6]
      iex> Robot.Safety.Reflex.Body.passing_speed(profile, [{0.2, 0.24}], -0.5)
      1.0e6
  """
  @spec passing_speed(Profile.t(), [point()], float()) :: float()
  def passing_speed(%Profile{radius: radius}, points, linear) do
    sign = if linear < 0, do: -1.0, else: 1.0
    half = radius + @side

    Enum.reduce(points, 1.0e6, fn {x, y}, fastest ->
      x = sign * x
      aside = abs(y) - half

      if x > 0 and x < radius + @beside_from and aside >= 0 and aside < @beside,
        do: min(fastest, @beside_speed + @beside_growth * aside),
        else: fastest
    end)
  end

  # How far the body may go before it must stand. Every body counts as the circle round its
  # corners: a longer one is a little narrower, but may turn on its way.
  defp gap(%Profile{radius: radius}, x, y) do
    half = radius + @side

    if x <= 0 or abs(y) >= half do
      1.0e6
    else
      ahead = :math.sqrt(half * half - y * y)
      x - (ahead - @side) - @clearance * ahead / half
    end
  end

  @doc """
  The greatest turn rate (rad/s) in the direction of `turn` from which the body can stop before a
  corner swings into a point.

      iex> Robot.Safety.Reflex.Body.free_turn(Hal.Profile.magellan(), [{0.0, 0.21}], 1.0) > 10
      true
      iex> mini = Hal.Profile.atrv_mini()
      iex> Robot.Safety.Reflex.Body.free_turn(mini, [{0.22, 0.155}], 0.5)
      0.0
      iex> Robot.Safety.Reflex.Body.free_turn(mini, [{0.22, 0.155}], -0.5) > 0.5
      true
  """
  @spec free_turn(Profile.t(), [point()], float()) :: float()
  def free_turn(_profile, _points, turn) when turn == 0, do: 1.0e6

  def free_turn(%Profile{} = profile, points, turn),
    do: free_turn(Profile.corners(profile), profile, points, turn)

  defp free_turn([], _round, _points, _turn), do: 1.0e6

  defp free_turn(corners, profile, points, turn) do
    corners = for {x, y} <- corners, do: :math.atan2(y, x)

    free =
      for {x, y} <- points, x * x + y * y < profile.radius * profile.radius, reduce: 1.0e6 do
        free ->
          angle = :math.atan2(y, x)
          Enum.reduce(corners, free, &min(&2, swing(&1, angle, turn)))
      end

    fastest(profile.max_turn_acceleration, max(free - 0.1, 0.0), profile.sonar_round_s)
  end

  @doc """
  How far from all that stands about (metres) the body must be to turn freely: where a longer one is nearer, a sonar may be
  so near that the obstacle counts as touching it.

      iex> for profile <- [Hal.Profile.magellan(), Hal.Profile.atrv_mini()],
      ...>   do: Float.round(Robot.Safety.Reflex.Body.turning_room(profile), 3)
      [0.2, 0.385]
  """
  @spec turning_room(Profile.t()) :: float()
  def turning_room(%Profile{} = profile),
    do: if(Profile.round?(profile), do: profile.radius, else: sonar_room(profile))

  defp sonar_room(%Profile{sonars: sonars, sonar_min: least, radius: radius}) do
    reach = least + @unmeasured

    for %{x: x, y: y, heading: heading} <- sonars do
      :math.sqrt(
        :math.pow(x + reach * :math.cos(heading), 2) +
          :math.pow(y + reach * :math.sin(heading), 2)
      )
    end
    |> Enum.max(fn -> radius end)
    |> max(radius)
  end

  @doc """
  The turn rate (rad/s) at which the corners of a body longer than wide move at this speed (m/s);
  no limit for any other, which turns on the spot without reaching further.

      iex> Robot.Safety.Reflex.Body.turn_at(Hal.Profile.magellan(), 0.1) > 10
      true
      iex> mini = Hal.Profile.atrv_mini()
      iex> Robot.Safety.Reflex.Body.turn_at(mini, 0.1) * mini.radius
      0.1
  """
  @spec turn_at(Profile.t(), speed :: float()) :: float()
  def turn_at(%Profile{radius: radius} = profile, speed),
    do: if(Profile.round?(profile), do: 1.0e6, else: speed / radius)

  # How far (radians) a corner may turn in this direction before it reaches the angle.
  defp swing(corner, angle, turn) do
    ahead = if turn > 0, do: angle - corner, else: corner - angle
    :math.fmod(ahead + 4 * :math.pi(), 2 * :math.pi())
  end
end
