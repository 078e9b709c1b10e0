defmodule Missions.Landmark.Coverage do
  @moduledoc false
  # Remembers what the fleet's cameras have looked at, as one robot knows it: cells of 10 cm of the map frame, looked at from
  # places where a robot turned once around. Pure.
  #
  # From such a place everything counts as looked at that no wall hides, as far as a camera is sure to find the landmark. Of
  # walls a robot knows its floor plan, or what its sonars see; behind what these do not reach there may be a wall, so
  # without a plan only what is near counts.
  alias Hal.Pose
  alias Nav.{Grid, Survey}
  alias Nav.MapFile.Writer

  @cell Survey.cell()
  # A landmark of 30 cm is a blob of 150 pixels at 8 m. Sonars are sure of walls to 3 m.
  @plan 8.0
  @sonar 3.0
  # Keys of cells count from here.
  @zero 1_000_000
  @row 2_000_000
  @free 1
  @wall 2

  defstruct cells: %{}

  @typedoc "The looked at cells by their key, `1` free and `2` wall."
  @type t :: %__MODULE__{cells: %{integer() => 1 | 2}}

  @doc """
  Adds what can be seen from a place, in the map frame.

      iex> grid = Nav.Grid.new(<<0::400>>, {10, 5}, 0.1, {0.0, 0.0})
      iex> coverage = Missions.Landmark.Coverage.look(%Missions.Landmark.Coverage{}, grid, {0.25, 0.25})
      iex> Float.round(Missions.Landmark.Coverage.area(coverage), 2)
      0.5
  """
  @spec look(t(), Grid.t(), Pose.point()) :: t()
  def look(%__MODULE__{cells: cells}, grid, from) do
    far = if grid.closed?, do: @plan, else: @sonar
    steps = round(far / @cell)
    rays = ceil(2 * :math.pi() * steps)

    cells =
      for k <- 0..(rays - 1), reduce: cells do
        cells ->
          angle = 2 * :math.pi() * k / rays
          ray(cells, grid, from, {@cell * :math.cos(angle), @cell * :math.sin(angle)}, steps)
      end

    %__MODULE__{cells: cells}
  end

  # As far as the walls are away none of the cells on the ray is one.
  defp ray(cells, grid, at, step, left) do
    clear = Grid.clearance(grid, at)

    if clear > 0.0,
      do: free(cells, grid, at, step, left, max(trunc(clear / @cell) - 1, 0)),
      else: Map.put(cells, key(at), @wall)
  end

  defp free(cells, grid, {x, y} = at, {dx, dy} = step, left, sure) do
    cells = Map.put(cells, key(at), @free)
    next = {x + dx, y + dy}

    cond do
      left == 0 -> cells
      sure == 0 -> ray(cells, grid, next, step, left - 1)
      true -> free(cells, grid, next, step, left - 1, sure - 1)
    end
  end

  defp key({x, y}), do: (floor(y / @cell) + @zero) * @row + floor(x / @cell) + @zero

  @doc "The free area that has been looked at, m2."
  @spec area(t()) :: float()
  def area(%__MODULE__{cells: cells}),
    do: Enum.count(cells, fn {_key, state} -> state == @free end) * @cell * @cell

  @doc "What has been looked at, as a map of which the rest is unknown; its sides are even numbers of cells."
  @spec raster(t()) :: Writer.raster()
  def raster(%__MODULE__{cells: cells}) when cells == %{},
    do: %{cells: <<>>, width: 0, height: 0, left: 0, low: 0, cell: @cell}

  def raster(%__MODULE__{cells: cells}) do
    {left, right, low, high} = bounds(Map.keys(cells))
    {width, height} = {even(right - left + 1), even(high - low + 1)}

    bytes =
      for j <- low..(low + height - 1),
          i <- left..(left + width - 1),
          into: <<>>,
          do: <<Map.get(cells, j * @row + i, 0)>>

    %{
      cells: bytes,
      width: width,
      height: height,
      left: left - @zero,
      low: low - @zero,
      cell: @cell
    }
  end

  defp bounds([key | keys]) do
    {i, j} = {rem(key, @row), div(key, @row)}

    for key <- keys, i = rem(key, @row), j = div(key, @row), reduce: {i, i, j, j} do
      {left, right, low, high} -> {min(left, i), max(right, i), min(low, j), max(high, j)}
    end
  end

  defp even(count), do: count + rem(count, 2)
end
