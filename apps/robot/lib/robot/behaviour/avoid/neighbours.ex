defmodule Robot.Behaviour.Avoid.Neighbours do
  @moduledoc """
  Describes the surroundings of a robot as discs in the map frame: other robots by their own reports, and obstacles that
  the sonars see and that are not known robots or discs. Pure.
  """
  alias Hal.{Pose, Twist}
  alias Nav.Grid
  alias Robot.Percept
  alias Robot.Safety.Reflex

  @typedoc """
  `share` is this robot's part of the evasion, `standing?` whether the body is slower than
  0.05 m/s, `fixed?` whether it will not make way, `gap` the distance between the bodies in
  metres.
  """
  @type t :: %{
          id: atom(),
          at: Pose.point(),
          velocity: {float(), float()},
          radius: float(),
          share: float(),
          standing?: boolean(),
          fixed?: boolean(),
          gap: float()
        }

  # Robots with a larger gap (metres) are not considered yet, and only this many of the nearest.
  @range 4.0
  @most 10
  @standing 0.05
  # The weight of the latest report in the mean place of a standing robot, and the distance
  # (metres) from the mean at which it counts as having moved.
  @recent 0.15
  @moved 0.25
  # A reported pose is extrapolated for at most this long (seconds).
  @carry_s 0.5
  @sonar_range 1.5
  @sonar_radius 0.05
  # A robot that knows its place less well than this (metres) may hear others elsewhere, and would hear one up to so far away if it
  # were there, not later than so far behind its front.
  @unsure 1.0
  @heard 2.0
  @beyond 0.3
  # Metres; what is left out by a bound is so much beyond it.
  @rounding 1.0e-6
  # How far (metres) outside a known body an echo may be and still count as its echo.
  @explained 0.15

  @doc """
  All other robots, nearest first, extrapolated to the present time. A robot that is not sure of its own place leaves out those that
  two of its sonars would hear there, and do not: it is beside where it believes to be, and avoids what it hears.
  """
  @spec robots(Percept.t()) :: [t()]
  def robots(%Percept{pose: nil}), do: []

  def robots(%Percept{pose: pose} = percept) do
    # `keysort` keeps the order of what is equally near.
    discs = for {id, peer} <- Map.to_list(percept.peers), do: disc(id, peer, pose, percept)
    discs = if unsure?(percept), do: heard(discs, percept), else: discs
    for {_gap, disc} <- :lists.keysort(1, Enum.map(discs, &{&1.gap, &1})), do: disc
  end

  defp unsure?(%{uncertainty: %{radius: radius}, sonar: [_ | _]}), do: radius > @unsure
  defp unsure?(_percept), do: false

  # One sonar may fail, or miss an echo: two must hear nothing up to well behind its front. A round body sends the echo back
  # along the line to its middle, so only those count that look at that.
  defp heard(discs, %{pose: pose, profile: profile, sonar: ranges}) do
    ears =
      for {mount, range} <- Enum.zip(profile.sonars, ranges),
          is_number(range),
          do: {Pose.compose(pose, mount), range}

    # From there no sonar hears a robot.
    far = for({ear, _range} <- ears, do: Pose.distance(ear, pose)) |> Enum.max(fn -> 0.0 end)
    far = @heard + far + @rounding

    Enum.reject(discs, fn disc ->
      Pose.distance(pose, disc.at) < far and unheard?(disc, ears, profile)
    end)
  end

  defp unheard?(%{at: at, radius: radius}, ears, profile) do
    echoes =
      for {from, range} <- ears,
          distance = Pose.distance(from, at),
          distance < @heard and distance > radius,
          abs(Pose.bearing(from, at)) < profile.sonar_cone / 2,
          do: range > distance - radius + @beyond

    enough?(profile, echoes) and Enum.all?(echoes)
  end

  # A beam of a lidar has many rays, and lies beside the next one.
  defp enough?(%{scan: nil}, echoes), do: match?([_, _ | _], echoes)
  defp enough?(_lidar, echoes), do: echoes != []

  @doc """
  Replaces the place of each standing robot by the mean of its recent reports, because reported
  places of standing robots fluctuate. Also returns the means, which the next tick takes as
  argument.
  """
  @spec steady([t()], %{atom() => Pose.point()}) :: {[t()], %{atom() => Pose.point()}}
  def steady(robots, means) do
    Enum.map_reduce(robots, %{}, fn
      %{standing?: true, id: id, at: at} = robot, kept ->
        mean = mean(means[id], at)
        {%{robot | at: mean}, Map.put(kept, id, mean)}

      robot, kept ->
        {robot, kept}
    end)
  end

  defp mean(nil, at), do: at

  defp mean({mx, my} = mean, {x, y} = at) do
    if Pose.distance(mean, at) > @moved,
      do: at,
      else: {mx + @recent * (x - mx), my + @recent * (y - my)}
  end

  @doc "Their bodies, as further discs are given."
  @spec bodies([t()]) :: [{float(), float(), float()}]
  def bodies(robots), do: for(%{at: {x, y}, radius: radius} <- robots, do: {x, y, radius})

  @doc "The nearest of these robots, at most ten, within 4 m."
  @spec near([t()]) :: [t()]
  def near(robots), do: robots |> Enum.take_while(&(&1.gap < @range)) |> Enum.take(@most)

  defp disc(id, peer, pose, percept) do
    %{pose: at, twist: %Twist{linear: linear}, radius: radius, mode: mode} = peer
    age_s = max(percept.at_ms - peer.at_ms, 0) / 1000
    linear = if mode == :dead, do: 0.0, else: linear
    standing? = abs(linear) < @standing
    vx = linear * :math.cos(at.heading)
    vy = linear * :math.sin(at.heading)
    carry_s = min(age_s, @carry_s)
    place = {at.x + carry_s * vx, at.y + carry_s * vy}
    # It is unknown where a robot with an old report has driven since; its disc grows by that way.
    grown = abs(linear) * min(max(age_s - @carry_s, 0.0), 1.0)

    %{
      id: id,
      at: place,
      velocity: {vx, vy},
      radius: radius + grown,
      share: if(mode == :moving and not standing?, do: 0.5, else: 1.0),
      standing?: standing?,
      fixed?: mode != :moving,
      gap: Pose.distance(pose, place) - radius - grown - percept.profile.radius
    }
  end

  @doc "The obstacles that the sonars see outside all of these discs."
  @spec unknown(Percept.t(), [{float(), float(), float()}]) :: [t()]
  def unknown(%Percept{sonar: nil}, _known), do: []

  def unknown(%Percept{pose: pose, profile: profile} = percept, known) do
    near =
      Enum.map(
        percept.sonar,
        &if(is_number(&1) and &1 < @sonar_range, do: &1, else: profile.sonar_max)
      )

    points = for point <- Reflex.Body.points(profile, near), do: Pose.place(pose, point)
    known = within(known, pose, points)

    for {x, y} = place <- points, not Enum.any?(known, &explains?(&1, x, y)) do
      %{
        id: nil,
        at: place,
        velocity: {0.0, 0.0},
        radius: @sonar_radius,
        share: 1.0,
        standing?: true,
        fixed?: true,
        gap: Pose.distance(pose, place) - @sonar_radius - profile.radius
      }
    end
  end

  # Those that may explain one of these points.
  defp within(_known, _pose, []), do: []

  defp within(known, pose, points) do
    far = for(point <- points, do: Pose.distance(pose, point)) |> Enum.max()
    far = far + @explained + @rounding

    Enum.filter(known, fn {x, y, radius} ->
      {dx, dy, reach} = {x - pose.x, y - pose.y, far + radius}
      dx * dx + dy * dy < reach * reach
    end)
  end

  @doc """
  Those that are farther than this (metres) from all walls of the floor plan; all without one. A sonar's echo may come from
  anywhere in its cone, so that in a door the posts seem to stand in the way; a way keeps clear of walls that are known,
  and the gate of what the sonars see.
  """
  @spec but_walls([t()], Percept.t(), float()) :: [t()]
  def but_walls(things, %Percept{grid: %{closed?: true} = grid}, far),
    do: Enum.filter(things, &(Grid.clearance(grid, &1.at) >= far))

  def but_walls(things, _without_plan, _far), do: things

  defp explains?({cx, cy, radius}, x, y) do
    limit = radius + @explained
    (x - cx) * (x - cx) + (y - cy) * (y - cy) < limit * limit
  end
end
