defmodule Nav.Grid do
  @moduledoc """
  Describes what a robot knows of walls: a grid of square cells, each with its clearance, and the ways over it. Pure; metres, in the
  frame of the map.

  `clear` has one byte for each cell, rows from the lowest y: at most the distance from the cell's centre to the nearest
  wall, in units of 2 cm, up to 5.1 m; 0 is wall. What is outside the grid is wall if it is `closed?`, else free.

  Ways over it are those of `Nav.Grid.Way`. The kernels are in C, with a reference in Elixir (`.Reference`) that
  gives the same bytes and the same ways.
  """
  alias Hal.Pose
  alias Nav.Grid
  alias Nav.Grid.Reference

  @unit 0.02
  @units 255
  # A point is at most this share of a cell from the centre of its cell, whose clearance counts.
  @off 0.71

  @enforce_keys [:clear, :width, :height, :cell, :left, :low]
  defstruct @enforce_keys ++ [closed?: true]

  @type t :: %__MODULE__{
          clear: binary(),
          width: pos_integer(),
          height: pos_integer(),
          cell: float(),
          left: float(),
          low: float(),
          closed?: boolean()
        }

  @doc """
  The grid of these cells (one byte each, 1 is wall, rows from the lowest y), `cell` metres wide, with its lower left corner
  at `{left, low}`. Options: `closed?`, whether what is outside is wall (true).

      iex> grid = Nav.Grid.new(<<0, 0, 0, 0, 1>>, {5, 1}, 0.1, {0.0, 0.0}, closed?: false)
      iex> for x <- [0.05, 0.35, 0.45], do: Nav.Grid.clearance(grid, {x, 0.05})
      [0.32, 0.02, 0.0]
  """
  @spec new(binary(), {pos_integer(), pos_integer()}, float(), Pose.point(), keyword()) :: t()
  def new(cells, {width, height}, cell, {left, low}, options \\ [])
      when byte_size(cells) == width * height do
    closed? = Keyword.get(options, :closed?, true)

    %__MODULE__{
      clear: kernel().clearance(cells, width, height, cell, closed?),
      width: width,
      height: height,
      cell: cell,
      left: left,
      low: low,
      closed?: closed?
    }
  end

  # The cells (metres) over which robots find their ways.
  @plan 0.1

  @doc "The width of a cell of `plan/4`, metres."
  @spec plan_cell() :: float()
  def plan_cell, do: @plan

  @doc "The grid of a floor plan that is drawn in smaller cells, as robots use it: of cells about 10 cm wide."
  @spec plan(binary(), {pos_integer(), pos_integer()}, float(), Pose.point()) :: t()
  def plan(cells, size, cell, corner),
    do: cells |> new(size, cell, corner) |> coarsen(max(round(@plan / cell), 1))

  @doc """
  The grid with cells `times` as wide. Each has the least clearance of the cells in it, so that nothing is wider than it was.

      iex> cells = <<0, 0, 0, 1, 0, 0, 0, 0>>
      iex> grid = Nav.Grid.new(cells, {4, 2}, 0.1, {0.0, 0.0}, closed?: false)
      iex> coarse = Nav.Grid.coarsen(grid, 2)
      iex> {coarse.width, coarse.height, coarse.cell, for(<<c <- coarse.clear>>, do: c > 0)}
      {2, 1, 0.2, [true, false]}
  """
  @spec coarsen(t(), pos_integer()) :: t()
  def coarsen(grid, 1), do: grid

  def coarsen(%__MODULE__{} = grid, times) do
    {width, height} = {div(grid.width, times), div(grid.height, times)}

    clear =
      for j <- 0..(height - 1), into: <<>> do
        rows =
          for k <- 0..(times - 1),
              do: binary_part(grid.clear, (j * times + k) * grid.width, width * times)

        for(i <- 0..(width - 1), into: <<>>, do: <<least(rows, i * times, times)>>)
      end

    %{grid | clear: clear, width: width, height: height, cell: grid.cell * times}
  end

  defp least(rows, from, times) do
    for row <- rows, k <- from..(from + times - 1), reduce: @units do
      least -> min(least, :binary.at(row, k))
    end
  end

  @doc """
  The grid with the walls of another one, a window of cells that lie on its own, as its walls too: each cell has the lesser
  clearance.

      iex> grid = Nav.Grid.new(<<0, 0, 0, 0, 0>>, {5, 1}, 0.1, {0.0, 0.0}, closed?: false)
      iex> window = Nav.Grid.new(<<0, 1>>, {2, 1}, 0.1, {0.2, 0.0}, closed?: false)
      iex> for <<c <- Nav.Grid.overlay(grid, window).clear>>, do: c
      [255, 255, 1, 0, 255]
  """
  @spec overlay(t(), window :: t()) :: t()
  def overlay(%__MODULE__{} = grid, window) do
    {left, low} = index(grid, {window.left + grid.cell / 2, window.low + grid.cell / 2})
    {width, height} = {grid.width, grid.height}

    clear =
      kernel().overlay(
        grid.clear,
        width,
        height,
        window.clear,
        window.width,
        window.height,
        left,
        low
      )

    %{grid | clear: clear}
  end

  @doc "The clearance at a point: not more than its distance to the nearest wall, in metres."
  @spec clearance(t(), Pose.point()) :: float()
  def clearance(grid, point), do: @unit * units(grid, point)

  @doc "Whether a disc of this radius fits here."
  @spec free?(t(), Pose.point(), radius :: float()) :: boolean()
  def free?(grid, point, radius), do: units(grid, point) >= needed(radius)

  @doc """
  Whether a disc of this radius can move straight from one point to another.

      iex> grid = Nav.Grid.new(<<0, 0, 0, 0, 1, 0, 0, 0, 0>>, {9, 1}, 0.1, {0.0, 0.0}, closed?: false)
      iex> for x <- [0.25, 0.75], do: Nav.Grid.free_line?(grid, {0.05, 0.05}, {x, 0.05}, 0.1)
      [true, false]
  """
  @spec free_line?(t(), Pose.point(), Pose.point(), radius :: float()) :: boolean()
  def free_line?(grid, from, to, radius),
    do: along?(grid, from, to, radius, Pose.distance(from, to), 0.0)

  # As far as the walls are away nothing need be looked at.
  defp along?(grid, from, to, radius, length, way) do
    clear = clearance(grid, point(from, to, length, way))

    cond do
      clear < radius -> false
      way >= length -> true
      true -> along?(grid, from, to, radius, length, next(grid, clear - radius, way, length))
    end
  end

  defp next(grid, room, way, length) do
    step = max(room - @off * grid.cell, grid.cell / 2)
    if way + step > length, do: length, else: way + step
  end

  defp point(from, _to, length, _way) when length == 0.0, do: from

  defp point({ax, ay}, {bx, by}, length, way),
    do: {ax + (bx - ax) * way / length, ay + (by - ay) * way / length}

  @doc """
  The same, but an end that is nearer to a wall than the radius needs only as much room as it has: a robot there must be able
  to leave. Inside of a wall there is none.
  """
  @spec passes?(t(), Pose.point(), Pose.point(), radius :: float()) :: boolean()
  def passes?(grid, from, to, radius) do
    room = min(clearance(grid, from), clearance(grid, to))
    room > 0.0 and free_line?(grid, from, to, min(radius, room))
  end

  @doc """
  The column and row of the cell in which a point is, which may be outside.

      iex> grid = Nav.Grid.new(<<0>>, {1, 1}, 0.5, {1.0, 0.0})
      iex> for x <- [0.9, 1.2], do: Nav.Grid.index(grid, {x, 0.2})
      [{-1, 0}, {0, 0}]
  """
  @spec index(t(), Pose.point()) :: {integer(), integer()}
  def index(grid, {x, y}),
    do: {floor((x - grid.left) / grid.cell), floor((y - grid.low) / grid.cell)}

  @doc "Whether the grid has a cell of this column and row."
  @spec inside?(t(), integer(), integer()) :: boolean()
  def inside?(grid, i, j), do: i >= 0 and j >= 0 and i < grid.width and j < grid.height

  defp units(grid, point) do
    {i, j} = index(grid, point)

    cond do
      inside?(grid, i, j) -> :binary.at(grid.clear, j * grid.width + i)
      grid.closed? -> 0
      true -> @units
    end
  end

  @doc """
  The costs of the cheapest ways from a cell to all others of a grid of this size, four bytes each (signed, native), -1 where none
  leads: 2 for a step to a side, 3 for one to a corner, each as many times as `times` has for the cell that it leads to, a byte
  each, 8 at most; 0 means that none does.

      iex> costs = Nav.Grid.costs(<<1, 5, 0, 1, 1, 1>>, {3, 2}, 0)
      iex> for <<cost::32-signed-native <- costs>>, do: cost
      [0, 10, -1, 2, 3, 5]
  """
  @spec costs(times :: binary(), {pos_integer(), pos_integer()}, start :: non_neg_integer()) ::
          binary()
  def costs(times, {width, height}, start) when byte_size(times) == width * height,
    do: kernel().spread(times, width, height, start)

  @doc "The units of clearance that a disc of this radius needs, for the kernels."
  @spec needed(radius :: float()) :: pos_integer()
  def needed(radius), do: radius |> Kernel./(@unit) |> ceil() |> max(1) |> min(@units)

  @doc false
  @spec kernel() :: module()
  def kernel, do: if(Grid.Native.loaded?(), do: Grid.Native, else: Reference)
end
