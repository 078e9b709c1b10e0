defmodule Robot.Localiser.Walls.Facing do
  @moduledoc false
  # Computes what a sonar should hear by a floor plan: the wall that it faces squarely, because any other throws the echo elsewhere.
  # Pure; metres and radians, in the frame of the map.
  #
  # A ray along the axis of the sonar finds the wall. Its distance, and the direction in which it faces, follow from the clearances
  # before it (`Nav.Grid`), which are finer than the cells. More rays look for what else is in the cone and nearer.
  alias Hal.Pose
  alias Nav.Grid

  # Directions beside the axis in which nothing may be nearer, as shares of half the cone.
  @rays [-0.5, 0.5, -1.0, 1.0]
  # The least step of a ray, and how far before the wall its clearances are taken.
  @step 0.06
  @before 0.25
  # How far the clearance at the centre of a cell is from the true one at least: it is that of the worst of the smaller cells in it,
  # rounded down (`Grid.coarsen/2`).
  @shy 0.035
  # The slope of the clearance before a straight wall is 1; it is less before a corner or between two walls.
  @straight 0.8
  # It is as flat as this (metres) so far to both sides.
  @side 0.3
  @flat 0.06
  # The wall by its clearances must be where the ray ended (metres).
  @same 0.15
  # What else is in the cone may be nearer by this (metres).
  @nearer 0.1

  @typedoc "The distance of a wall from the sonar along its normal, and the unit normal, towards the sonar."
  @type t :: {distance :: float(), normal :: {float(), float()}}

  @doc "The wall that a sonar at this pose faces within `most` metres; `nil` for none, or none that it would surely hear."
  @spec find(Grid.t(), Pose.t(), cone :: float(), most :: float()) :: t() | nil
  def find(%Grid{} = grid, %Pose{} = sonar, cone, most) do
    t = cast(grid, sonar, 0.0, most)

    with true <- t < most,
         {distance, _normal} = wall <- facing(grid, sonar, cone, t),
         least = distance - @nearer,
         true <- Enum.all?(@rays, &(cast(grid, sonar, &1 * cone / 2, least) >= least)) do
      wall
    else
      _none -> nil
    end
  end

  # How far a ray comes that leaves the sonar at this angle.
  defp cast(grid, sonar, angle, most) do
    {c, s} = {:math.cos(sonar.heading + angle), :math.sin(sonar.heading + angle)}
    march(grid, sonar.x, sonar.y, c, s, most, 0.0)
  end

  defp march(_grid, _x, _y, _c, _s, most, t) when t >= most, do: t

  defp march(grid, x, y, c, s, most, t) do
    clear = Grid.clearance(grid, {x + t * c, y + t * s})
    step = clear - 0.71 * grid.cell

    cond do
      clear == 0.0 -> t
      step > @step -> march(grid, x, y, c, s, most, t + step)
      true -> march(grid, x, y, c, s, most, t + @step)
    end
  end

  defp facing(grid, sonar, cone, t) do
    {c, s} = {:math.cos(sonar.heading), :math.sin(sonar.heading)}
    ahead = max(t - @before, 0.0)
    {x, y} = at = {sonar.x + ahead * c, sonar.y + ahead * s}
    {gx, gy} = slope(grid, at)
    steep = :math.sqrt(gx * gx + gy * gy)

    # The cosine of the angle between the sonar and the wall's normal.
    if steep > @straight and -(gx * c + gy * s) >= steep * :math.cos(cone / 2) do
      {nx, ny} = {gx / steep, gy / steep}
      clear = between(grid, at)
      distance = clear + @shy + nx * (sonar.x - x) + ny * (sonar.y - y)
      if abs(distance - t) < @same and flat?(grid, at, {nx, ny}, clear), do: {distance, {nx, ny}}
    end
  end

  defp flat?(grid, {x, y}, {nx, ny}, clear) do
    Enum.all?([-@side, @side], fn side ->
      abs(between(grid, {x - side * ny, y + side * nx}) - clear) < @flat
    end)
  end

  defp slope(grid, {x, y}) do
    h = grid.cell

    {(between(grid, {x + h, y}) - between(grid, {x - h, y})) / (2 * h),
     (between(grid, {x, y + h}) - between(grid, {x, y - h})) / (2 * h)}
  end

  # The clearance, interpolated between the centres of cells.
  defp between(grid, {x, y}) do
    half = grid.cell / 2
    {i, j} = Grid.index(grid, {x - half, y - half})
    {left, low} = {grid.left + i * grid.cell + half, grid.low + j * grid.cell + half}
    {u, v} = {(x - left) / grid.cell, (y - low) / grid.cell}
    at = fn dx, dy -> Grid.clearance(grid, {left + dx * grid.cell, low + dy * grid.cell}) end

    (1 - v) * ((1 - u) * at.(0, 0) + u * at.(1, 0)) + v * ((1 - u) * at.(0, 1) + u * at.(1, 1))
  end
end
