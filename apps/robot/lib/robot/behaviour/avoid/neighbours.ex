defmodule Robot.Behaviour.Avoid.Neighbours do
  @moduledoc """
  What is around a robot, as discs in the map frame: other robots by their own reports, and
  obstacles that the sonars see and no robot reported. Pure.
  """
  alias Hal.{Pose, Twist}
  alias Robot.Percept
  alias Robot.Safety.Reflex

  @typedoc "`share`: the part of the evasion that is ours."
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

  # Farther ones do not matter yet, and more than this many nearest ones change nothing.
  @range 4.0
  @most 10
  @standing 0.05
  # Share of the latest in the mean place of one that stands, and how far off (metres) it has moved after all.
  @recent 0.15
  @moved 0.25
  # A pose that was not renewed for this long (seconds) is no longer carried on.
  @carry_s 0.5
  @sonar_range 1.5
  @sonar_radius 0.05
  # How far beside a known body an echo may lie and still be its echo.
  @explained 0.15

  @doc "The other robots, nearest first, carried on to now; all of them, however far."
  @spec robots(Percept.t()) :: [t()]
  def robots(%Percept{pose: pose} = percept) do
    percept.peers
    |> Enum.map(fn {id, peer} -> disc(id, peer, pose, percept) end)
    |> Enum.sort_by(& &1.gap)
  end

  @doc """
  The same, where those that stand are taken to stand at the mean of what they lately told:
  what they tell wobbles, they do not. Gives the means to hand in again at the next tick.
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

  @doc "The nearest of them, as many as matter for the next seconds."
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
    # Where an old one went meanwhile nobody knows: it grows by what it may have driven.
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

  @doc "What the sonars see that none of these discs explains."
  @spec unknown(Percept.t(), [{float(), float(), float()}]) :: [t()]
  def unknown(%Percept{sonar: nil}, _known), do: []

  def unknown(%Percept{pose: pose, profile: profile} = percept, known) do
    near =
      Enum.map(
        percept.sonar,
        &if(is_number(&1) and &1 < @sonar_range, do: &1, else: profile.sonar_max)
      )

    for point <- Reflex.Body.points(profile, near),
        {x, y} = Pose.place(pose, point),
        not Enum.any?(known, &explains?(&1, x, y)) do
      %{
        id: nil,
        at: {x, y},
        velocity: {0.0, 0.0},
        radius: @sonar_radius,
        share: 1.0,
        standing?: true,
        fixed?: true,
        gap: Pose.distance(pose, {x, y}) - @sonar_radius - profile.radius
      }
    end
  end

  defp explains?({cx, cy, radius}, x, y) do
    limit = radius + @explained
    (x - cx) * (x - cx) + (y - cy) * (y - cy) < limit * limit
  end
end
