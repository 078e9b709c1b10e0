defmodule Robot.Room do
  @moduledoc false
  # A rectangular room for tests, its lower left corner at the origin: its floor plan, and what sonars hear in it, by the
  # geometry of its four walls alone.
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Nav.Grid
  alias Robot.Percept

  @cell 0.05
  # Cells of wall around it.
  @border 4

  @doc "The floor plan, as one draws it in cells of 5 cm and robots use it."
  def plan({width, height}) do
    {columns, rows} = {round(width / @cell), round(height / @cell)}

    cells =
      for j <- -@border..(rows + @border - 1),
          i <- -@border..(columns + @border - 1),
          into: <<>> do
        if i in 0..(columns - 1) and j in 0..(rows - 1), do: <<0>>, else: <<1>>
      end

    corner = {-@border * @cell, -@border * @cell}
    Grid.plan(cells, {columns + 2 * @border, rows + 2 * @border}, @cell, corner)
  end

  @doc "How far it is to the first wall from here in a direction."
  def ray({width, height}, {x, y}, angle),
    do: min(side(x, :math.cos(angle), width), side(y, :math.sin(angle), height))

  defp side(_at, part, _length) when abs(part) < 1.0e-9, do: 1.0e9
  defp side(at, part, length) when part > 0.0, do: (length - at) / part
  defp side(at, part, _length), do: -at / part

  @doc "What a sonar at this pose hears: the nearest of many rays in its cone."
  def hear(size, %Pose{} = sonar, cone) do
    for(k <- -10..10, do: ray(size, Pose.point(sonar), sonar.heading + k * cone / 20))
    |> Enum.min()
  end

  @doc "A percept of a robot that truly is at `pose`, with this odometry and this floor plan."
  def percept(size, pose, odometry, at_ms, plan) do
    profile = Profile.magellan()

    ranges =
      for mount <- profile.sonars do
        range = hear(size, Pose.compose(pose, mount), profile.sonar_cone)
        min(range + (0.01 + 0.01 * range) * :rand.normal(), profile.sonar_max)
      end

    %Percept{
      robot: :mag1,
      at_ms: at_ms,
      profile: profile,
      odometry: %Odometry{pose: odometry, twist: Twist.zero()},
      sonar: ranges,
      grid: plan
    }
  end
end
