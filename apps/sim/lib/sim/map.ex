defmodule Sim.Map do
  @moduledoc """
  A floor plan of square cells, wall or free. The origin is at the centre, x right, y up, in metres;
  outside of the plan all is wall. Pure.

  `field` has one byte a cell, rows from the lowest y: the distance to the nearest wall in cells,
  counted as a king moves in chess and at most 255; 0 is wall. Rays and bodies jump by it.
  `room` is the rectangle round the origin where a fleet starts.
  """
  alias Sim.Map.{Drawing, Image, Starts}

  @enforce_keys [:name, :width, :height, :cell, :field, :room]
  defstruct @enforce_keys

  @type point :: {x :: float(), y :: float()}
  @type rectangle :: {left :: float(), low :: float(), right :: float(), high :: float()}
  @type t :: %__MODULE__{
          name: String.t(),
          width: pos_integer(),
          height: pos_integer(),
          cell: float(),
          field: binary(),
          room: rectangle()
        }

  @doc """
  A map by its name, with room for a fleet of this size: `"hall"`, `"hospital"`, `"arena"`, or a
  bitmap with its size in metres, such as `"floor.png:16x12"`.

      iex> {:ok, map} = Sim.Map.open("hall", 6)
      iex> Sim.Map.size(map)
      {18.0, 18.0}
      iex> Sim.Map.open("mars", 6)
      {:error, "unknown map mars: hall, hospital, arena or FILE.png:WIDTHxHEIGHT in metres"}
  """
  @spec open(String.t(), pos_integer()) :: {:ok, t()} | {:error, String.t()}
  def open(name, fleet) when name in ["hall", "hospital", "arena"] and fleet > 0,
    do: {:ok, Drawing.draw(name, fleet)}

  def open(name, _fleet), do: Image.open(name)

  @doc "Width and height in metres."
  @spec size(t()) :: {float(), float()}
  def size(%__MODULE__{} = map),
    do: {Float.round(map.width * map.cell, 6), Float.round(map.height * map.cell, 6)}

  @doc """
  Whether there is wall at this point.

      iex> {:ok, map} = Sim.Map.open("hall", 6)
      iex> {Sim.Map.wall?(map, {0.0, 0.0}), Sim.Map.wall?(map, {99.0, 0.0})}
      {false, true}
  """
  @spec wall?(t(), point()) :: boolean()
  def wall?(%__MODULE__{} = map, point), do: steps(map, point) == 0

  @doc """
  Whether a disc of this radius fits here.

      iex> {:ok, map} = Sim.Map.open("hall", 6)
      iex> {Sim.Map.free?(map, {8.5, 0.0}, 0.4), Sim.Map.free?(map, {8.5, 0.0}, 0.6)}
      {true, false}
  """
  @spec free?(t(), point(), number()) :: boolean()
  def free?(%__MODULE__{} = map, point, radius), do: clearance(map, point, radius) >= radius

  @doc """
  Distance from a point to the nearest wall, exact where it is less than `limit`, else at least
  `limit`; 0 inside a wall.

      iex> {:ok, map} = Sim.Map.open("hall", 6)
      iex> Sim.Map.clearance(map, {8.5, 0.0}, 1.0)
      0.5
  """
  @spec clearance(t(), point(), number()) :: float()
  def clearance(%__MODULE__{} = map, point, limit) do
    case steps(map, point) do
      0 ->
        0.0

      steps when (steps - 1) * map.cell >= limit ->
        (steps - 1) * map.cell

      _near ->
        map |> near(point, limit) |> Enum.reduce(limit * 1.0, fn {d, _}, m -> min(d, m) end)
    end
  end

  @doc "The nearest points of all wall cells closer than `limit`, each with its distance."
  @spec near(t(), point(), number()) :: [{distance :: float(), point()}]
  def near(%__MODULE__{} = map, {x, y} = point, limit) do
    if (steps(map, point) - 1) * map.cell >= limit do
      []
    else
      {px, py} = local(map, point)
      {right, high} = size(map)
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

  @doc """
  Poses to start from: in the room, at least 1.0 m between centres, 0.7 m from walls, 1.2 m from
  the landmark, headings at random. One for each `{id, radius}`, all from the seed.

      iex> {:ok, map} = Sim.Map.open("hall", 2)
      iex> {:ok, [a, b]} = Sim.Map.starts(map, [mag1: 0.2, mag2: 0.2], 1, {0.0, 0.0})
      iex> Hal.Pose.distance(a, b) >= 1.0
      true
  """
  @spec starts(t(), [{atom(), float()}], integer(), point() | nil) ::
          {:ok, [Hal.Pose.t()]} | {:error, String.t()}
  def starts(%__MODULE__{} = map, robots, seed, landmark),
    do: Starts.spread(map, robots, seed, landmark)

  @doc """
  Whether the landmark, 0.15 m in radius, can stand here.

      iex> {:ok, map} = Sim.Map.open("hall", 6)
      iex> Sim.Map.check_landmark(map, {9.0, 0.0})
      {:error, "the landmark cannot stand at 9.0,0.0 of map hall: there is a wall"}
  """
  @spec check_landmark(t(), point()) :: :ok | {:error, String.t()}
  def check_landmark(%__MODULE__{} = map, {x, y}) do
    {right, high} = size(map)

    cond do
      abs(x) > right / 2 or abs(y) > high / 2 ->
        {:error,
         "the landmark cannot stand at #{x},#{y}: map #{map.name} is #{right} x #{high} m round its centre"}

      free?(map, {x * 1.0, y * 1.0}, 0.15) ->
        :ok

      true ->
        {:error, "the landmark cannot stand at #{x},#{y} of map #{map.name}: there is a wall"}
    end
  end

  # The byte of the field; outside is wall.
  defp steps(map, point) do
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
