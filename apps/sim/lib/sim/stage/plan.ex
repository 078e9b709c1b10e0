defmodule Sim.Stage.Plan do
  @moduledoc """
  Draws the walls of a world file of Stage into the cells of a floor plan. Pure but for reading pictures.

  What is dark in a picture fills the size of its model, as in Stage. Each cell that a wall reaches into is wall. The
  plan covers all pictures, and whatever stands outside of them with a metre of floor round it; what lies beyond is wall.
  """
  alias Hal.Pose
  alias Nav.MapFile
  alias Nav.MapFile.{Picture, Runs}
  alias Sim.{Compute, Stage}
  alias Sim.Stage.Entities

  @most_cells 64_000_000
  @widest 2_000.0
  @most_pixels 16_000_000
  # Metres of floor round what stands in a world.
  @round 1.0
  # Metres: the thickness of the walls along the edges of a picture.
  @edge 0.01
  # Parts of a cell that a wall may reach into the next one.
  @slack 1.0e-3

  @doc "The fields of the floor plan with this name (`t:Sim.Floorplan.t/0`); the error is one line."
  @spec fields(String.t(), Stage.t()) :: {:ok, map()} | {:error, line :: String.t()}
  def fields(name, %Stage{} = world) do
    with {:ok, pictures} <- pictures(world.walls, []),
         models = for({:polygon, points} <- world.walls, do: points),
         around = around(world, pictures, models),
         :ok <- few(name, around) do
      {:ok, draw(name, models ++ pictures, around)}
    end
  end

  defp pictures([], done), do: {:ok, done}
  defp pictures([{:polygon, _points} | rest], done), do: pictures(rest, done)

  defp pictures([{:bitmap, name, files, at, pose, size, boundary?} | rest], done) do
    path = Entities.beside(name, files, &if(File.regular?(&1), do: {:ok, ""}, else: {:error, ""}))

    with {:ok, picture} <- picture(path, at) do
      edges = if boundary?, do: edges(size), else: []

      drawn =
        for points <- edges ++ dark(picture, size), do: Enum.map(points, &Pose.place(pose, &1))

      pictures(rest, drawn ++ done)
    end
  end

  defp picture(path, {file, line, column}) do
    with {:error, text} <- MapFile.picture(path, @most_pixels),
         do: {:error, "#{file}:#{line}:#{column}: bitmap #{text}"}
  end

  defp edges({length, width}) do
    {x, y} = {length / 2, width / 2}

    [
      box(-x, -y, -x + @edge, y),
      box(x - @edge, -y, x, y),
      box(-x, -y, x, -y + @edge),
      box(-x, y - @edge, x, y)
    ]
  end

  defp box(left, low, right, high), do: [{left, low}, {right, low}, {right, high}, {left, high}]

  # The dark runs of all rows as boxes about the middle of the model.
  defp dark({_width, _height, rows}, {length, width}) do
    shades = Picture.shades(nil)
    runs = for {row, j} <- Enum.with_index(rows), {a, b} <- Runs.of(row, shades), do: {j, a, b}

    case runs do
      [] ->
        []

      runs ->
        {top, bottom} = runs |> Enum.map(&elem(&1, 0)) |> Enum.min_max()
        left = runs |> Enum.map(&elem(&1, 1)) |> Enum.min()
        right = runs |> Enum.map(&elem(&1, 2)) |> Enum.max()
        {wide, high} = {length / (right - left + 1), width / (bottom - top + 1)}

        for {j, a, b} <- runs do
          y = width / 2 - (j - top) * high
          box((a - left) * wide - length / 2, y - high, (b + 1 - left) * wide - length / 2, y)
        end
    end
  end

  # The rectangle of all that is there. A picture is a floor plan, with what is in it; round the rest there is floor.
  defp around(world, pictures, models) do
    standing =
      for(robot <- world.robots, do: Pose.point(robot.pose)) ++
        for({x, y, _radius} <- world.balls, do: {x, y}) ++
        for({pose, _length, _width} <- world.boxes, do: Pose.point(pose)) ++
        List.wrap(world.landmark) ++ Enum.concat(models)

    plan = pictures |> Enum.concat() |> bounds()
    outside = Enum.reject(standing, &inside?(&1, plan))

    with_floor =
      for {x, y} <- outside,
          dx <- [-@round, @round],
          dy <- [-@round, @round],
          do: {x + dx, y + dy}

    pictures |> Enum.concat() |> Enum.concat(with_floor) |> bounds()
  end

  defp bounds([]), do: nil

  defp bounds(points) do
    {xs, ys} = Enum.unzip(points)
    {left, right} = Enum.min_max(xs)
    {low, high} = Enum.min_max(ys)
    {left, low, right, high}
  end

  defp inside?(_point, nil), do: false

  defp inside?({x, y}, {left, low, right, high}),
    do: x > left and x < right and y > low and y < high

  defp few(name, {left, low, right, high}) do
    {width, height} = {2 * max(abs(left), abs(right)), 2 * max(abs(low), abs(high))}
    cell = Picture.cell()

    cond do
      max(width, height) > @widest ->
        {:error, "map #{name}: reaches further than #{div(trunc(@widest), 2)} m from 0,0"}

      width * height / (cell * cell) > @most_cells ->
        {:error,
         "map #{name}: too large, at most #{div(@most_cells, 1_000_000)} million cells of 5 cm are allowed"}

      true ->
        :ok
    end
  end

  # The plan has its origin in the middle.
  defp draw(name, polygons, {left, low, right, high} = room) do
    cell = Picture.cell()
    half = fn a, b -> ceil(max(abs(a), abs(b)) / cell - @slack) end
    {half_w, half_h} = {half.(left, right), half.(low, high)}
    {width, height} = {2 * half_w, 2 * half_h}

    runs =
      for points <- polygons,
          inside = Enum.map(points, fn {x, y} -> {x / cell + half_w, y / cell + half_h} end),
          {j, run} <- runs(inside, {width, height}),
          reduce: %{} do
        rows -> Map.update(rows, j, [run], &[run | &1])
      end

    # Beside all that is there.
    first = max(floor(left / cell + half_w + @slack), 0)
    last = min(ceil(right / cell + half_w - @slack), width) - 1
    beside = for {a, b} <- [{0, first - 1}, {last + 1, width - 1}], a <= b, do: {a, b}

    rows =
      max(floor(low / cell + half_h + @slack), 0)..(min(
                                                      ceil(high / cell + half_h - @slack),
                                                      height
                                                    ) - 1)//1

    outside = :binary.copy(<<1>>, width)

    cells =
      for j <- 0..(height - 1)//1, into: <<>> do
        if j in rows, do: Runs.row(beside ++ Map.get(runs, j, []), width), else: outside
      end

    %{
      name: name,
      width: width,
      height: height,
      cell: cell,
      room: room,
      unknown: nil,
      field: Compute.field(cells, width, height)
    }
  end

  # The cells of each row that a polygon reaches into, as far as it is wide there.
  defp runs(points, {width, height}) do
    {low, high} = points |> Enum.map(&elem(&1, 1)) |> Enum.min_max()
    sides = Enum.zip(points, tl(points) ++ [hd(points)])

    for j <-
          max(floor(low + @slack), 0)..min(
            max(ceil(high - @slack) - 1, floor(low + @slack)),
            height - 1
          )//1,
        {left, right} <- [across(sides, j * 1.0, j + 1.0)],
        a = max(floor(left + @slack), 0),
        b = min(max(ceil(right - @slack) - 1, a), width - 1),
        a <= b,
        do: {j, {a, b}}
  end

  # How far the sides reach to the left and to the right between two heights.
  defp across(sides, low, high) do
    xs =
      for {{ax, ay}, {bx, by}} <- sides,
          share <- shares(ay, by, low, high),
          do: ax + share * (bx - ax)

    if xs != [], do: Enum.min_max(xs)
  end

  defp shares(ay, by, low, high) when ay == by,
    do: if(ay >= low and ay <= high, do: [0.0, 1.0], else: [])

  defp shares(ay, by, low, high) do
    [from, to] = Enum.sort([(low - ay) / (by - ay), (high - ay) / (by - ay)])
    if from <= 1.0 and to >= 0.0, do: [max(from, 0.0), min(to, 1.0)], else: []
  end
end
