defmodule Robot.Safety.Reflex.Body do
  @moduledoc """
  How fast a body may move beside what its sonars see. Pure; points in `base_link`.

  For driving every body counts as the circle round its corners; for turning, one longer than wide
  is a box whose corners may swing into something.
  """
  alias Hal.Profile

  @type point :: {x :: float(), y :: float()}

  @clearance 0.15
  # A step of the gate and the lag of wheels.
  @reaction_s 0.15
  # Things that would only be grazed keep this much to the side.
  @side 0.03
  # Metres: where a thing is taken to be that is too near to be measured.
  @touching 0.05

  @doc """
  The places that a sonar ring sees: no echo, and what is no range at all, gives none.

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
    # The least a sonar can say means "somewhere between there and me".
    range = if range <= profile.sonar_min + 0.005, do: min(range, @touching), else: range
    x = pose.x + range * :math.cos(pose.heading)
    y = pose.y + range * :math.sin(pose.heading)
    [{x, y} | points(poses, ranges, profile)]
  end

  defp points([_ | poses], [_ | ranges], profile), do: points(poses, ranges, profile)
  defp points(_, _, _profile), do: []

  @doc """
  The greatest speed (m/s) in the direction of `linear` from which the body can stop before
  what is in its way. Straight ahead it keeps 0.15 m; what it would only graze, less.

      iex> profile = Hal.Profile.magellan()
      iex> Robot.Safety.Reflex.Body.free_speed(profile, [{0.35, 0.0}], 0.5)
      0.0
      iex> Robot.Safety.Reflex.Body.free_speed(profile, [{0.35, 0.0}], -0.5) > 10
      true
      iex> Robot.Safety.Reflex.Body.free_speed(profile, [{0.3, 0.5}], 0.5) > 10
      true
  """
  @spec free_speed(Profile.t(), [point()], float()) :: float()
  def free_speed(%Profile{max_acceleration: braking} = profile, points, linear) do
    sign = if linear < 0, do: -1.0, else: 1.0
    free = Enum.reduce(points, 1.0e6, fn {x, y}, free -> min(free, gap(profile, sign * x, y)) end)
    # What it still drives before it brakes, v * reaction, counts as well: solved for v.
    lost = braking * @reaction_s
    :math.sqrt(2 * braking * max(free, 0.0) + lost * lost) - lost
  end

  # How far it may go until it stands before the point. The circle round its corners stands for
  # every body: a longer one is a little narrower, but it may turn on its way.
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
  The greatest turn rate (rad/s) in the direction of `turn` at which no corner swings into a point.

      iex> Robot.Safety.Reflex.Body.free_turn(Hal.Profile.magellan(), [{0.0, 0.21}], 1.0) > 10
      true
      iex> mini = Hal.Profile.atrv_mini()
      iex> Robot.Safety.Reflex.Body.free_turn(mini, [{0.22, 0.155}], 0.5)
      0.0
      iex> Robot.Safety.Reflex.Body.free_turn(mini, [{0.22, 0.155}], -0.5) > 0.5
      true
  """
  @spec free_turn(Profile.t(), [point()], float()) :: float()
  def free_turn(%Profile{length: length, width: width}, _points, _turn) when length == width,
    do: 1.0e6

  def free_turn(_profile, _points, turn) when turn == 0, do: 1.0e6

  def free_turn(%Profile{} = profile, points, turn) do
    corner = :math.atan2(profile.width, profile.length)
    corners = [corner, :math.pi() - corner, corner - :math.pi(), -corner]

    free =
      for {x, y} <- points, x * x + y * y < profile.radius * profile.radius, reduce: 1.0e6 do
        free ->
          angle = :math.atan2(y, x)
          Enum.reduce(corners, free, &min(&2, swing(&1, angle, turn)))
      end

    :math.sqrt(2 * profile.max_turn_acceleration * max(free - 0.1, 0.0))
  end

  # How far (radians) a corner may turn this way before it meets the angle.
  defp swing(corner, angle, turn) do
    ahead = if turn > 0, do: angle - corner, else: corner - angle
    :math.fmod(ahead + 4 * :math.pi(), 2 * :math.pi())
  end
end
