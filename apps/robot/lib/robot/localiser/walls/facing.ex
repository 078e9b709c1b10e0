defmodule Robot.Localiser.Walls.Facing do
  @moduledoc """
  What a sonar should hear by a floor plan: the wall that it faces squarely, because any other throws the echo elsewhere. Pure;
  metres and radians, in the frame of the map.

  Rays over the cone find what comes first. The distance of that from the sonar, and the direction in which it faces, follow
  from the clearances before it (`Robot.Navigation.Grid`), which are finer than the cells.
  """
  alias Hal.Pose
  alias Robot.Navigation.Grid

  # Directions of the rays, as shares of half the cone.
  @rays [0.0, -0.5, 0.5, -1.0, 1.0]
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

  @typedoc "The distance of a wall from the sonar along its normal, and the unit normal, towards the sonar."
  @type t :: {distance :: float(), normal :: {float(), float()}}

  @doc "The wall that a sonar at this pose faces within `most` metres; `nil` for none, or none that it would surely hear."
  @spec find(Grid.t(), Pose.t(), cone :: float(), most :: float()) :: t() | nil
  def find(%Grid{} = grid, %Pose{} = sonar, cone, most) do
    {t, c, s} =
      for share <- @rays, reduce: {most, 1.0, 0.0} do
        {best, _, _} = found ->
          angle = sonar.heading + share * cone / 2
          {c, s} = {:math.cos(angle), :math.sin(angle)}
          t = cast(grid, sonar.x, sonar.y, c, s, best, 0.0)
          if t < best, do: {t, c, s}, else: found
      end

    if t < most, do: facing(grid, sonar, cone, {t, c, s}), else: nil
  end

  defp cast(_grid, _x, _y, _c, _s, most, t) when t >= most, do: most

  defp cast(grid, x, y, c, s, most, t) do
    clear = Grid.clearance(grid, {x + t * c, y + t * s})

    if clear > 0.0,
      do: cast(grid, x, y, c, s, most, t + max(clear - 0.71 * grid.cell, @step)),
      else: t
  end

  defp facing(grid, sonar, cone, {t, c, s}) do
    ahead = max(t - @before, 0.0)
    {x, y} = at = {sonar.x + ahead * c, sonar.y + ahead * s}
    {gx, gy} = slope(grid, at)
    steep = :math.sqrt(gx * gx + gy * gy)

    if steep > @straight do
      {nx, ny} = {gx / steep, gy / steep}
      clear = between(grid, at)
      distance = clear + @shy + nx * (sonar.x - x) + ny * (sonar.y - y)
      aside = abs(Pose.wrap(:math.atan2(-ny, -nx) - sonar.heading))

      flat? =
        Enum.all?([-@side, @side], fn side ->
          abs(between(grid, {x - side * ny, y + side * nx}) - clear) < @flat
        end)

      if aside <= cone / 2 and abs(distance - t) < @same and flat?,
        do: {distance, {nx, ny}}
    end
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
