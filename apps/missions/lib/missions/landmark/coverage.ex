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
  # Numbers of columns and rows count from here; a tile has so many cells a side.
  @zero 1_000_000
  @row 2_000_000
  @tile 16
  @fresh <<0::size(@tile * @tile)-unit(8)>>
  @free 1
  @wall 2

  defstruct tiles: %{}, bounds: nil, free: 0

  @typedoc """
  `tiles` have a byte for each cell, rows from the lowest y: 0 not looked at, `1` free, `2` wall. `bounds` are the first and last
  column and row of those that were looked at, `free` is the number of free ones.
  """
  @type t :: %__MODULE__{
          tiles: %{{integer(), integer()} => binary()},
          bounds: {integer(), integer(), integer(), integer()} | nil,
          free: non_neg_integer()
        }

  @doc """
  Adds what can be seen from a place, in the map frame.

      iex> grid = Nav.Grid.new(<<0::400>>, {10, 5}, 0.1, {0.0, 0.0})
      iex> coverage = Missions.Landmark.Coverage.look(%Missions.Landmark.Coverage{}, grid, {0.25, 0.25})
      iex> Float.round(Missions.Landmark.Coverage.area(coverage), 2)
      0.5
  """
  @spec look(t(), Grid.t(), Pose.point()) :: t()
  def look(%__MODULE__{} = coverage, grid, from) do
    far = if grid.closed?, do: @plan, else: @sonar
    steps = round(far / @cell)
    rays = ceil(2 * :math.pi() * steps)

    cells =
      for k <- 0..(rays - 1), reduce: %{} do
        cells ->
          angle = 2 * :math.pi() * k / rays
          ray(cells, grid, from, {@cell * :math.cos(angle), @cell * :math.sin(angle)}, steps)
      end

    cells
    |> Enum.group_by(&tile/1, &within/1)
    |> Enum.reduce(%{coverage | bounds: bounds(Map.keys(cells), coverage.bounds)}, &put/2)
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

  defp tile({key, _state}), do: {div(rem(key, @row), @tile), div(div(key, @row), @tile)}

  defp within({key, state}),
    do: {rem(div(key, @row), @tile) * @tile + rem(rem(key, @row), @tile), state}

  defp put({at, cells}, coverage) do
    before = Map.get(coverage.tiles, at, @fresh)
    now = lay(before, Enum.sort(cells), 0, <<>>)
    free = coverage.free - count(before) + count(now)
    %{coverage | tiles: Map.put(coverage.tiles, at, now), free: free}
  end

  defp lay(<<_before, rest::binary>>, [{n, state} | cells], n, done),
    do: lay(rest, cells, n + 1, <<done::binary, state>>)

  defp lay(<<before, rest::binary>>, cells, n, done),
    do: lay(rest, cells, n + 1, <<done::binary, before>>)

  defp lay(<<>>, [], _n, done), do: done

  defp count(states), do: for(<<@free <- states>>, reduce: 0, do: (count -> count + 1))

  defp bounds([key | _] = keys, before) do
    {i, j} = {rem(key, @row), div(key, @row)}

    for key <- keys, i = rem(key, @row), j = div(key, @row), reduce: before || {i, i, j, j} do
      {left, right, low, high} -> {min(left, i), max(right, i), min(low, j), max(high, j)}
    end
  end

  @doc "The free area that has been looked at, m2."
  @spec area(t()) :: float()
  def area(%__MODULE__{free: free}), do: free * @cell * @cell

  @doc "What has been looked at, as a map of which the rest is unknown; its sides are even numbers of cells."
  @spec raster(t()) :: Writer.raster()
  def raster(%__MODULE__{bounds: nil}),
    do: %{cells: <<>>, width: 0, height: 0, left: 0, low: 0, cell: @cell}

  def raster(%__MODULE__{tiles: tiles, bounds: {left, right, low, high}}) do
    {width, height} = {even(right - left + 1), even(high - low + 1)}
    {first, last} = {div(left, @tile), div(left + width - 1, @tile)}

    bytes =
      for row <- div(low, @tile)..div(low + height - 1, @tile), into: <<>> do
        across = for column <- first..last, do: Map.get(tiles, {column, row}, @fresh)
        {from, upto} = {max(low - row * @tile, 0), min(low + height - 1 - row * @tile, @tile - 1)}

        for k <- from..upto, into: <<>> do
          line = for tile <- across, into: <<>>, do: binary_part(tile, k * @tile, @tile)
          binary_part(line, left - first * @tile, width)
        end
      end

    %{
      cells: bytes,
      width: width,
      height: height,
      left: left - @zero,
      low: low - @zero,
      cell: @cell
    }
  end

  defp even(count), do: count + rem(count, 2)
end
