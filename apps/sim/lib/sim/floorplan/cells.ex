defmodule Sim.Floorplan.Cells do
  @moduledoc "Converts between the cells of a map and its places in metres. Pure."

  @doc "Width and height in metres."
  @spec size(Sim.Floorplan.t()) :: {float(), float()}
  def size(map),
    do: {Float.round(map.width * map.cell, 6), Float.round(map.height * map.cell, 6)}

  @doc """
  The middle of a rectangle.

      iex> Sim.Floorplan.Cells.middle({-3.0, -2.0, 5.0, 2.0})
      {1.0, 0.0}
  """
  @spec middle(Sim.Floorplan.rectangle()) :: Sim.Floorplan.point()
  def middle({left, low, right, high}), do: {(left + right) / 2, (low + high) / 2}

  @doc "The centre of a cell."
  @spec point(Sim.Floorplan.t(), cell :: non_neg_integer()) :: Sim.Floorplan.point()
  def point(map, cell) do
    {i, j} = {rem(cell, map.width), div(cell, map.width)}
    {(i + 0.5 - map.width / 2) * map.cell, (j + 0.5 - map.height / 2) * map.cell}
  end

  @doc "The cell that a point of the plan is in."
  @spec cell(Sim.Floorplan.t(), Sim.Floorplan.point()) :: non_neg_integer()
  def cell(map, {x, y}) do
    {i, j} = {floor(x / map.cell + map.width / 2), floor(y / map.cell + map.height / 2)}
    min(max(j, 0), map.height - 1) * map.width + min(max(i, 0), map.width - 1)
  end

  @doc """
  A place as precisely as it is told to people.

      iex> Sim.Floorplan.Cells.told({1.234, -0.001})
      {1.23, 0.0}
  """
  @spec told(Sim.Floorplan.point()) :: Sim.Floorplan.point()
  def told({x, y}), do: {Float.round(x, 2) + 0.0, Float.round(y, 2) + 0.0}
end
