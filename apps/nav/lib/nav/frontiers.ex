defmodule Nav.Frontiers do
  @moduledoc """
  Finds frontiers: where what is known to be free meets what is unknown, and how far it is there (Yamauchi 1997). Pure;
  metres, in the frame of the map.

  They are looked for on squares of 20 cm, each of which is open if the robot has room somewhere in it, narrow if it has some
  but not enough, and unknown if nothing of it is known. A frontier is open, can be reached, and has an unknown
  neighbour. Of those that hang together, which are at least three, the nearest in each field of 1.6 m stands for all.

  Ways lead over narrow squares, too, but seldom: the echo of a door's post may come from anywhere in the cone of a sonar, so
  that a door seems too narrow until the robot stands before it and looks through.
  """
  alias Hal.Pose
  alias Nav.{Grid, Reach, Survey}
  alias Nav.MapFile.Writer

  # A square has two cells a side.
  @square 2 * Survey.cell()
  # Squares that hang together and are too few let no robot through.
  @least 3
  # Squares along a field.
  @field 8
  # A robot whose own square is not open begins at the next within so many squares.
  @escape 5
  # It goes for a point that is so far ahead at most, as far as it sees the way free of walls.
  @ahead 3.0
  @least_ahead 0.5
  # The room (metres) of a narrow square, and how many times as long a step to one is.
  @narrow 0.08
  @times 5
  @some ceil(@narrow / 0.02)
  # Steps of `Nav.Grid.costs/3`.
  @neighbours [
    {-1, -1, 3},
    {0, -1, 2},
    {1, -1, 3},
    {-1, 0, 2},
    {1, 0, 2},
    {-1, 1, 3},
    {0, 1, 2},
    {1, 1, 3}
  ]

  @enforce_keys [:squares, :width, :height, :left, :low, :grid, :room, :costs, :found]
  defstruct @enforce_keys

  @typedoc "Where a frontier is, how far to go there, and how many squares it has there."
  @type frontier :: %{at: Pose.point(), far: float(), size: pos_integer(), square: integer()}

  @typedoc """
  `squares` has a byte for each: 0 unknown, 1 open, 2 wall, 3 narrow, 4 free without room for the robot; `costs` are ways from the robot in steps of 10 cm
  (`Nav.Grid.costs/3`), by the number of the square.
  """
  @type t :: %__MODULE__{
          squares: binary(),
          width: non_neg_integer(),
          height: non_neg_integer(),
          left: float(),
          low: float(),
          grid: Grid.t(),
          room: float(),
          costs: binary(),
          found: [frontier()]
        }

  @doc "All frontiers of a robot that is there; `nil` if it has no room on the map."
  @spec find(Writer.raster(), Pose.point(), radius :: float()) :: t() | nil
  def find(%{width: 0}, _from, _radius), do: nil

  def find(raster, from, radius) do
    cell = Survey.cell()
    room = Reach.room(radius)
    walls = for <<state <- raster.cells>>, into: <<>>, do: if(state == 2, do: <<1>>, else: <<0>>)
    corner = {raster.left * cell, raster.low * cell}
    grid = Grid.new(walls, {raster.width, raster.height}, cell, corner, closed?: false)

    field = %__MODULE__{
      squares: squares(raster, grid.clear, Grid.needed(room)),
      width: div(raster.width, 2),
      height: div(raster.height, 2),
      left: raster.left * cell,
      low: raster.low * cell,
      grid: grid,
      room: room,
      costs: <<>>,
      found: []
    }

    with start when start != nil <- start(field, from) do
      times = for <<kind <- field.squares>>, into: <<>>, do: <<times(kind)>>
      field = %{field | costs: Grid.costs(times, {field.width, field.height}, start)}
      %{field | found: found(field, [1])}
    end
  end

  defp squares(%{cells: cells, width: width, height: height}, clear, need) do
    for j <- 0..(height - 2)//2, into: <<>> do
      [a, b, c, d] =
        for {bytes, row} <- [{cells, j}, {cells, j + 1}, {clear, j}, {clear, j + 1}],
            do: binary_part(bytes, row * width, width)

      row(a, b, c, d, need, <<>>)
    end
  end

  defp row(
         <<s1, s2, a::binary>>,
         <<s3, s4, b::binary>>,
         <<c1, c2, c::binary>>,
         <<c3, c4, d::binary>>,
         need,
         done
       ) do
    square =
      cond do
        s1 == 0 and s2 == 0 and s3 == 0 and s4 == 0 -> 0
        open?(s1, c1, need) or open?(s2, c2, need) -> 1
        open?(s3, c3, need) or open?(s4, c4, need) -> 1
        open?(s1, c1, @some) or open?(s2, c2, @some) -> 3
        open?(s3, c3, @some) or open?(s4, c4, @some) -> 3
        s1 == 1 or s2 == 1 or s3 == 1 or s4 == 1 -> 4
        true -> 2
      end

    row(a, b, c, d, need, <<done::binary, square>>)
  end

  defp row(<<>>, <<>>, <<>>, <<>>, _need, done), do: done

  defp open?(state, clear, need), do: state == 1 and clear >= need

  defp at(field, i, j) do
    if i >= 0 and j >= 0 and i < field.width and j < field.height,
      do: :binary.at(field.squares, j * field.width + i),
      else: 0
  end

  defp start(field, {x, y}) do
    {i, j} = {floor((x - field.left) / @square), floor((y - field.low) / @square)}

    near =
      for a <- (i - @escape)..(i + @escape),
          b <- (j - @escape)..(j + @escape),
          at(field, a, b) == 1,
          do: {(a - i) * (a - i) + (b - j) * (b - j), b * field.width + a}

    with {_square, number} <- Enum.min(near, fn -> nil end), do: number
  end

  defp times(1), do: 1
  defp times(3), do: @times
  defp times(_no_room), do: 0

  defp cost(%{costs: costs}, number) do
    <<cost::32-signed-native>> = binary_part(costs, 4 * number, 4)
    cost
  end

  @doc """
  The share of the edge of what is known to be free, along which nothing is known: 0 where walls are all round, 1 where none
  was seen. What is left of it where no frontier is left is what the robot does not get to. Only places that count are
  looked at.
  """
  @spec unknown(t(), counts? :: (Pose.point() -> boolean())) :: float()
  def unknown(%{squares: squares, width: width} = field, counts?) do
    {unknown, walls} =
      for {kind, number} <- Enum.with_index(:binary.bin_to_list(squares)),
          kind in [1, 3, 4],
          counts?.(centre(field, number)),
          {i, j} = {rem(number, width), div(number, width)},
          {di, dj} <- [{-1, 0}, {1, 0}, {0, -1}, {0, 1}],
          reduce: {0, 0} do
        {unknown, walls} ->
          case at(field, i + di, j + dj) do
            0 -> {unknown + 1, walls}
            2 -> {unknown, walls + 1}
            _free -> {unknown, walls}
          end
      end

    unknown / max(unknown + walls, 1)
  end

  @doc "The frontiers that have narrow squares, too: the second choice."
  @spec narrow(t()) :: [frontier()]
  def narrow(field), do: found(field, [1, 3])

  defp found(field, kinds) do
    edge = field.squares |> edge(field.costs, 0, field, kinds) |> MapSet.new()

    for {group, k} <- edge |> groups(field) |> Enum.with_index(),
        number <- group do
      {{k, div(rem(number, field.width), @field), div(div(number, field.width), @field)}, number}
    end
    |> Enum.group_by(&elem(&1, 0), &elem(&1, 1))
    |> Enum.map(fn {_part, numbers} -> frontier(field, numbers) end)
    |> Enum.sort_by(&{&1.far, &1.square})
  end

  # The squares of these kinds, to which a way leads, beside what is unknown.
  defp edge(<<kind, squares::binary>>, <<cost::32-signed-native, costs::binary>>, n, field, kinds) do
    if cost >= 0 and kind in kinds and edge?(field, n),
      do: [n | edge(squares, costs, n + 1, field, kinds)],
      else: edge(squares, costs, n + 1, field, kinds)
  end

  defp edge(<<>>, <<>>, _number, _field, _kinds), do: []

  defp edge?(field, number) do
    {i, j} = {rem(number, field.width), div(number, field.width)}

    at(field, i - 1, j) == 0 or at(field, i + 1, j) == 0 or at(field, i, j - 1) == 0 or
      at(field, i, j + 1) == 0
  end

  # Those that hang together, by their least number.
  defp groups(edge, field) do
    {groups, _left} =
      edge
      |> Enum.sort()
      |> Enum.reduce({[], edge}, fn number, {groups, left} ->
        if MapSet.member?(left, number) do
          {group, left} = flood([number], [], MapSet.delete(left, number), field.width)
          {[group | groups], left}
        else
          {groups, left}
        end
      end)

    groups |> Enum.reverse() |> Enum.filter(&(length(&1) >= @least))
  end

  defp flood([], group, left, _width), do: {group, left}

  defp flood([number | more], group, left, width) do
    near = for {di, dj, _far} <- @neighbours, do: number + dj * width + di
    near = Enum.filter(near, &MapSet.member?(left, &1))
    flood(near ++ more, [number | group], Enum.reduce(near, left, &MapSet.delete(&2, &1)), width)
  end

  defp frontier(field, numbers) do
    number = Enum.min_by(numbers, &{cost(field, &1), &1})

    %{
      at: centre(field, number),
      far: cost(field, number) * @square / 2,
      size: length(numbers),
      square: number
    }
  end

  defp centre(field, number) do
    {field.left + (rem(number, field.width) + 0.5) * @square,
     field.low + (div(number, field.width) + 0.5) * @square}
  end

  @doc """
  The point for which to go on the way from there to a frontier: half a metre to 3 m ahead, unless the frontier is
  nearer, and no wall that is known before it, where that can be had.
  """
  @spec ahead(t(), frontier(), Pose.point()) :: Pose.point()
  def ahead(field, frontier, from) do
    points =
      field
      |> back(frontier.square, [])
      |> Enum.take(round(@ahead / @square))
      |> Enum.map(&centre(field, &1))
      |> Enum.filter(&(Pose.distance(&1, from) >= @least_ahead))

    points
    |> Enum.reverse()
    |> Enum.find(List.first(points) || frontier.at, &passes?(field, from, &1))
  end

  defp passes?(field, from, to), do: Grid.passes?(field.grid, from, to, field.room)

  # The squares of the way, that of the robot first.
  defp back(%{width: width} = field, number, way) do
    cost = cost(field, number)

    if cost == 0 do
      [number | way]
    else
      {i, j} = {rem(number, width), div(number, width)}
      kind = :binary.at(field.squares, number)

      before =
        Enum.find_value(@neighbours, fn {di, dj, far} ->
          next = (j + dj) * width + i + di

          if at(field, i + di, j + dj) in [1, 3] and
               cost(field, next) == cost - times(kind) * far,
             do: next
        end)

      back(field, before, [number | way])
    end
  end
end
