defmodule Sim.Floorplan.Clearance do
  @moduledoc "Computes how far the walls of a map are from a point. Pure."

  @doc "See `Sim.Floorplan.clearance/3`."
  @spec of(Sim.Floorplan.t(), Sim.Floorplan.point(), number()) :: float()
  def of(map, point, limit) do
    case steps(map, point) do
      0 ->
        0.0

      steps when (steps - 1) * map.cell >= limit ->
        (steps - 1) * map.cell

      _near ->
        map |> near(point, limit) |> Enum.reduce(limit * 1.0, fn {d, _}, m -> min(d, m) end)
    end
  end

  @doc "Whether the nearest wall is at least so far, as `of/3` would say, but mostly sooner."
  @spec at_least?(Sim.Floorplan.t(), Sim.Floorplan.point(), number()) :: boolean()
  def at_least?(map, point, limit) do
    case steps(map, point) do
      # Somewhere in a square around the point's cell there is wall.
      steps when steps * map.cell * 1.4143 < limit -> limit <= 0
      steps when (steps - 1) * map.cell >= limit -> true
      _near -> near(map, point, limit) == []
    end
  end

  @doc "See `Sim.Floorplan.near/3`."
  @spec near(Sim.Floorplan.t(), Sim.Floorplan.point(), number()) :: [
          {float(), Sim.Floorplan.point()}
        ]
  def near(map, {x, y} = point, limit) do
    if (steps(map, point) - 1) * map.cell >= limit do
      []
    else
      {px, py} = local(map, point)
      {right, high} = {map.width * map.cell, map.height * map.cell}
      reach = trunc(limit / map.cell) + 1
      {i, j} = {floor(px / map.cell), floor(py / map.cell)}

      borders =
        for {d, bx, by} <- [
              {px, -px, 0.0},
              {right - px, right - px, 0.0},
              {py, 0.0, -py},
              {high - py, 0.0, high - py}
            ],
            d < limit,
            do: {max(d, 0.0), {x + bx, y + by}}

      cells =
        for jj <- max(j - reach, 0)..min(j + reach, map.height - 1)//1,
            ii <- max(i - reach, 0)..min(i + reach, map.width - 1)//1,
            :binary.at(map.field, jj * map.width + ii) == 0,
            dx = nearest(px, ii, map.cell) - px,
            dy = nearest(py, jj, map.cell) - py,
            distance = :math.sqrt(dx * dx + dy * dy),
            distance < limit,
            do: {distance, {x + dx, y + dy}}

      borders ++ cells
    end
  end

  @doc "The byte of the field at a point: 0 in a wall and outside."
  @spec steps(Sim.Floorplan.t(), Sim.Floorplan.point()) :: byte()
  def steps(map, point) do
    {px, py} = local(map, point)
    {i, j} = {floor(px / map.cell), floor(py / map.cell)}

    if i < 0 or j < 0 or i >= map.width or j >= map.height,
      do: 0,
      else: :binary.at(map.field, j * map.width + i)
  end

  defp local(map, {x, y}), do: {x + map.width * map.cell / 2, y + map.height * map.cell / 2}

  defp nearest(p, i, cell) do
    cond do
      p < i * cell -> i * cell
      p > (i + 1) * cell -> (i + 1) * cell
      true -> p
    end
  end
end
