defmodule Nav.Grid.Way do
  @moduledoc """
  Finds the cheapest way of a robot over a grid of walls. Pure.

  It is found by A* (Hart, Nilsson and Raphael 1968) over the cells with enough clearance, 8 neighbours, no corner cut;
  cells near walls cost more. Then it is pulled straight: from each of its corners the robot sees the next.
  """
  alias Hal.Pose
  alias Nav.{Grid, PathPlanner}

  # A robot or a goal nearer to a wall than a way needs begins and ends its way at the nearest cell that has room, if
  # that is not farther off than this (metres).
  @escape 1.0

  @doc """
  The corners of the cheapest way for a disc of this radius round walls and further discs, the goal last; `nil` if there is
  none. A wall or disc at either end does not count.

      iex> row = fn k -> if k == 3, do: <<1, 1, 1, 1, 1, 1, 0>>, else: <<0::56>> end
      iex> cells = for k <- 0..6, into: <<>>, do: row.(k)
      iex> grid = Nav.Grid.new(cells, {7, 7}, 1.0, {0.0, 0.0}, closed?: false)
      iex> [{x, _y} | _] = way = Nav.Grid.Way.find(grid, {0.5, 0.5}, {0.5, 6.5}, 0.2)
      iex> {x > 5.0, List.last(way)}
      {true, {0.5, 6.5}}
      iex> Nav.Grid.Way.find(grid, {0.5, 0.5}, {0.5, 6.5}, 0.4)
      nil
  """
  @spec find(Grid.t(), Pose.point(), Pose.point(), radius :: float(), [PathPlanner.disc()]) ::
          [Pose.point(), ...] | nil
  def find(grid, from, goal, radius, discs \\ []) do
    with {:ok, start} <- nearest(grid, from, radius),
         {:ok, last} <- nearest(grid, goal, radius),
         [_ | _] = cells <- cells(grid, start, last, radius, discs) do
      points = Enum.map(cells, &centre(grid, &1))
      from |> pull(points ++ [goal], grid, radius, discs) |> tl()
    else
      _none -> nil
    end
  end

  defp cells(grid, start, goal, radius, discs) do
    # A robot that touches a disc, or shall go to one, gets off it.
    packed =
      for {x, y, r} <- discs, into: <<>> do
        {x, y} = {(x - grid.left) / grid.cell, (y - grid.low) / grid.cell}
        ends = min(far(grid, start, x, y), far(grid, goal, x, y))
        r = (r / grid.cell) |> min(ends) |> max(0.0)
        <<x::float-native, y::float-native, r::float-native>>
      end

    Grid.kernel().way(
      grid.clear,
      grid.width,
      grid.height,
      Grid.needed(radius),
      packed,
      start,
      goal
    )
  end

  defp far(grid, cell, x, y) do
    {dx, dy} = {rem(cell, grid.width) + 0.5 - x, div(cell, grid.width) + 0.5 - y}
    max(:math.sqrt(dx * dx + dy * dy) - 0.01, 0.0)
  end

  @doc "The centre of the nearest cell that has room for a disc of this radius, within a metre."
  @spec near(Grid.t(), Pose.point(), radius :: float()) :: {:ok, Pose.point()} | :error
  def near(grid, point, radius),
    do: with({:ok, cell} <- nearest(grid, point, radius), do: {:ok, centre(grid, cell)})

  # The nearest cell with room, by rings round that of the point; among equally near ones the first. What is outside of an
  # open grid is approached by the nearest of its edge.
  defp nearest(grid, point, radius) do
    {i, j} = grid |> Grid.index(point) |> inside(grid)
    need = Grid.needed(radius)

    Enum.find_value(0..ceil(@escape / grid.cell), :error, fn ring ->
      case for(
             {x, y} <- ring(i, j, ring),
             Grid.inside?(grid, x, y),
             enough?(grid, x, y, need),
             do: {x, y}
           ) do
        [] -> nil
        found -> {:ok, found |> Enum.min_by(&square(&1, i, j)) |> number(grid)}
      end
    end)
  end

  defp inside(cell, %{closed?: true}), do: cell

  defp inside({i, j}, grid),
    do: {i |> max(0) |> min(grid.width - 1), j |> max(0) |> min(grid.height - 1)}

  defp ring(i, j, 0), do: [{i, j}]

  defp ring(i, j, k) do
    for(x <- (i - k)..(i + k), y <- [j - k, j + k], do: {x, y}) ++
      for y <- (j - k + 1)..(j + k - 1)//1, x <- [i - k, i + k], do: {x, y}
  end

  defp square({x, y}, i, j), do: (x - i) * (x - i) + (y - j) * (y - j)
  defp number({x, y}, grid), do: y * grid.width + x
  defp enough?(grid, x, y, need), do: :binary.at(grid.clear, y * grid.width + x) >= need

  defp centre(grid, cell) do
    {grid.left + (rem(cell, grid.width) + 0.5) * grid.cell,
     grid.low + (div(cell, grid.width) + 0.5) * grid.cell}
  end

  # The points that are needed, `from` first: from each the robot sees the next, past walls and discs. Where even a neighbour
  # is not in sight, as at the beginning of a way out of a niche, it is kept.
  defp pull(from, [only], _grid, _radius, _discs), do: [from, only]

  defp pull(from, points, grid, radius, discs) do
    rest = farthest(from, points, grid, radius, discs)
    [next | more] = rest
    if more == [], do: [from, next], else: [from | pull(next, more, grid, radius, discs)]
  end

  # The points from the last one in sight on: by doubling steps, then by halves.
  defp farthest(from, points, grid, radius, discs) do
    points = List.to_tuple(points)
    seen? = fn k -> seen?(from, elem(points, k), grid, radius, discs) end
    last = tuple_size(points) - 1
    {low, high} = bracket(seen?, 0, 1, last)
    k = halve(seen?, low, high)
    points |> Tuple.to_list() |> Enum.drop(k)
  end

  defp bracket(seen?, low, step, last) do
    next = min(low + step, last)

    cond do
      low == last -> {last, last}
      seen?.(next) -> bracket(seen?, next, 2 * step, last)
      true -> {low, next}
    end
  end

  defp halve(_seen?, low, high) when high - low <= 1, do: low

  defp halve(seen?, low, high) do
    middle = div(low + high, 2)
    if seen?.(middle), do: halve(seen?, middle, high), else: halve(seen?, low, middle)
  end

  defp seen?(from, to, grid, radius, discs),
    do: Grid.free_line?(grid, from, to, radius) and PathPlanner.blocker(from, to, discs) == nil
end
