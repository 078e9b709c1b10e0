defmodule Nav.Grid.Reference do
  @moduledoc false
  # Defines what the kernels of `Nav.Grid` compute, in Elixir: the definition, for small grids and for builds without C.
  # The same bytes and the same ways. Pure.

  @unit 0.02
  @most 255
  @far 16_384
  @straight 10
  @diagonal 14
  @weight 8
  @narrow 16
  @roomy 25
  @side 2
  @corner 3

  @doc "See `Nav.Grid.new/5`: the distance of each cell's centre to the nearest wall, in units of 2 cm."
  @spec clearance(binary(), pos_integer(), pos_integer(), float(), boolean()) :: binary()
  def clearance(cells, width, height, cell, closed?) do
    walls =
      for y <- 0..(height - 1),
          x <- 0..(width - 1),
          :binary.at(cells, y * width + x) == 1,
          do: {x, y}

    for y <- 0..(height - 1), x <- 0..(width - 1), into: <<>> do
      edge = if closed?, do: Enum.min([x + 1, width - x, y + 1, height - y]), else: @far

      walls
      |> Enum.reduce(edge * edge, fn {i, j}, least ->
        min(least, (x - i) * (x - i) + (y - j) * (y - j))
      end)
      |> byte(cell)
    end
  end

  defp byte(0, _cell), do: <<0>>

  # A wall's corner is at most 0.71 cells nearer than its centre.
  defp byte(square, cell) do
    units = (:math.sqrt(square) - 0.71) * cell / @unit
    <<units |> trunc() |> max(1) |> min(@most)>>
  end

  @doc "See `Nav.Grid.overlay/2`: the window's lower left cell is at `{left, low}`."
  @spec overlay(
          binary(),
          pos_integer(),
          pos_integer(),
          binary(),
          pos_integer(),
          pos_integer(),
          integer(),
          integer()
        ) :: binary()
  def overlay(clear, width, height, over, over_width, over_height, left, low) do
    for y <- 0..(height - 1), x <- 0..(width - 1), into: <<>> do
      before = :binary.at(clear, y * width + x)
      {i, j} = {x - left, y - low}

      if i in 0..(over_width - 1) and j in 0..(over_height - 1),
        do: <<min(before, :binary.at(over, j * over_width + i))>>,
        else: <<before>>
    end
  end

  @doc "See `Nav.Grid.Way.find/5`: A* with the octile distance."
  @spec way(
          binary(),
          pos_integer(),
          pos_integer(),
          pos_integer(),
          binary(),
          non_neg_integer(),
          non_neg_integer()
        ) :: [non_neg_integer()]
  def way(clear, width, height, need, discs, start, goal) do
    discs = for <<x::float-native, y::float-native, r::float-native <- discs>>, do: {x, y, r}
    map = %{clear: clear, width: width, height: height, need: need, discs: discs, goal: goal}
    open = :gb_sets.singleton({guess(width, start, goal), start})
    search(open, %{start => {0, nil}}, MapSet.new(), map)
  end

  defp search(open, reached, taken, %{goal: goal} = map) do
    if :gb_sets.is_empty(open) do
      []
    else
      {{_guess, at}, open} = :gb_sets.take_smallest(open)

      cond do
        at == goal -> trace(goal, reached, [])
        MapSet.member?(taken, at) -> search(open, reached, taken, map)
        true -> expand(at, open, reached, MapSet.put(taken, at), map)
      end
    end
  end

  @steps [{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}]

  defp expand(at, open, reached, taken, map) do
    {x, y} = {rem(at, map.width), div(at, map.width)}
    {cost, _from} = Map.fetch!(reached, at)

    steps =
      for {dx, dy} <- @steps,
          passable?(map, x + dx, y + dy),
          straight_or_wide?(map, x, y, dx, dy),
          do: {dx, dy}

    {open, reached} =
      Enum.reduce(steps, {open, reached}, fn {dx, dy}, {open, reached} ->
        next = (y + dy) * map.width + x + dx
        step = if dx != 0 and dy != 0, do: @diagonal, else: @straight
        total = cost + step * weight(:binary.at(map.clear, next), map.need)

        case reached do
          %{^next => {before, _from}} when before <= total ->
            {open, reached}

          _new ->
            {:gb_sets.add({total + guess(map.width, next, map.goal), next}, open),
             Map.put(reached, next, {total, at})}
        end
      end)

    search(open, reached, taken, map)
  end

  # A diagonal step needs both cells beside it.
  defp straight_or_wide?(map, x, y, dx, dy),
    do: dx == 0 or dy == 0 or (passable?(map, x + dx, y) and passable?(map, x, y + dy))

  defp passable?(%{width: width, height: height}, x, y)
       when x < 0 or y < 0 or x >= width or y >= height,
       do: false

  defp passable?(map, x, y) do
    cell = y * map.width + x

    cell == map.goal or
      (:binary.at(map.clear, cell) >= map.need and
         not Enum.any?(map.discs, &within?(&1, x + 0.5, y + 0.5)))
  end

  defp within?({x, y, radius}, px, py),
    do: (px - x) * (px - x) + (py - y) * (py - y) < radius * radius

  defp trace(at, reached, way) do
    case Map.fetch!(reached, at) do
      {_cost, nil} -> [at | way]
      {_cost, from} -> trace(from, reached, [at | way])
    end
  end

  defp guess(width, a, b) do
    {dx, dy} = {abs(rem(a, width) - rem(b, width)), abs(div(a, width) - div(b, width))}
    @weight * (@straight * abs(dx - dy) + @diagonal * min(dx, dy))
  end

  defp weight(clear, need) do
    lacking = (@roomy - (clear - need)) |> max(0) |> min(@roomy)
    @weight + div(lacking * @narrow, @roomy)
  end

  @doc "See `Nav.Grid.costs/3`: Dijkstra's algorithm with a bucket for each cost."
  @spec spread(binary(), pos_integer(), pos_integer(), non_neg_integer()) :: binary()
  def spread(times, width, height, start) do
    costs =
      relax(%{times: times, width: width, height: height}, %{start => 0}, %{0 => [start]}, 0)

    for cell <- 0..(width * height - 1),
        into: <<>>,
        do: <<Map.get(costs, cell, -1)::32-signed-native>>
  end

  defp relax(_map, costs, buckets, _cost) when buckets == %{}, do: costs

  defp relax(map, costs, buckets, cost) do
    {now, buckets} = Map.pop(buckets, cost, [])

    {costs, buckets} =
      for cell <- now,
          costs[cell] == cost,
          {dx, dy} <- @steps,
          next = next(map, cell, dx, dy),
          next != nil,
          reduce: {costs, buckets} do
        {costs, buckets} ->
          side = if dx == 0 or dy == 0, do: @side, else: @corner
          total = cost + side * :binary.at(map.times, next)

          if total < Map.get(costs, next, :infinity),
            do: {Map.put(costs, next, total), Map.update(buckets, total, [next], &[next | &1])},
            else: {costs, buckets}
      end

    relax(map, costs, buckets, cost + 1)
  end

  defp next(%{width: width, height: height, times: times}, cell, dx, dy) do
    {x, y} = {rem(cell, width) + dx, div(cell, width) + dy}

    if x >= 0 and y >= 0 and x < width and y < height and :binary.at(times, y * width + x) > 0,
      do: y * width + x
  end
end
