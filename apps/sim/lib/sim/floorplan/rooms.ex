defmodule Sim.Floorplan.Rooms do
  @moduledoc false
  # Finds the rooms of a map: areas of places that are far enough from all walls to start there, so that a door ends a
  # room. Pure.
  alias Hal.Pose
  alias Nav.MapFile.Runs
  alias Sim.Floorplan.Cells

  # A landmark has so much space around it if the room has; space that is lacking is as bad as a way
  # this many times as long.
  @space 1.5
  @worth 4.0

  @typedoc "`outer?`: it reaches the edge of the plan, as what surrounds a building does; `around?`: all four edges."
  @type t :: %{area: Runs.area(), outer?: boolean(), around?: boolean(), away: float()}

  @doc """
  The least byte of a map's field at a place whose centre is so far from all walls, in metres.

      iex> {:ok, map} = Sim.Floorplan.open("hall", 6)
      iex> Sim.Floorplan.Rooms.steps(map, 0.7)
      15
  """
  @spec steps(Sim.Floorplan.t(), float()) :: pos_integer()
  def steps(map, metres), do: min(ceil(metres / map.cell + 0.5 - 1.0e-9), 255)

  @doc """
  All rooms of places whose byte in the field is at least `least`: first those within a building,
  each group from the middle of the map outwards.
  """
  @spec of(Sim.Floorplan.t(), pos_integer()) :: [t()]
  def of(map, least) do
    marks = Runs.marks(&(&1 >= least))

    rows =
      for j <- 0..(map.height - 1),
          do: Runs.of(binary_part(map.field, j * map.width, map.width), marks)

    {left, low, right, high} = edges(map, least)

    rooms =
      for %{columns: {a, b}, rows: {c, d}} = area <- Runs.areas(rows, :sides) do
        reached = [a <= left, b >= right, c <= low, d >= high]

        %{
          area: area,
          outer?: Enum.any?(reached),
          around?: Enum.all?(reached),
          away: away(map, area)
        }
      end

    Enum.sort_by(rooms, &{&1.outer?, &1.away, &1.area.runs})
  end

  # The outermost columns and rows that can be free, where only the edge of the picture keeps them
  # from being so.
  defp edges(map, least) do
    {left, low, right, high} = map.room
    cells = &round(&1 / map.cell + &2 / 2)

    {cells.(left, map.width) + least - 1, cells.(low, map.height) + least - 1,
     cells.(right, map.width) - least, cells.(high, map.height) - least}
  end

  defp away(map, area) do
    middle = Cells.middle(map.room)
    column = elem(middle, 0) / map.cell + map.width / 2 - 0.5

    area.runs
    |> Enum.map(fn {j, {a, b}} ->
      nearest = column |> round() |> max(a) |> min(b)
      Pose.distance(Cells.point(map, j * map.width + nearest), middle)
    end)
    |> Enum.min()
  end

  @doc """
  The cells of a room where a landmark would stand, best first: near the middle of the map with
  space around, or in a corner, which leaves most room to the fleet.
  """
  @spec stands(Sim.Floorplan.t(), t()) :: [cell :: non_neg_integer()]
  def stands(map, room) do
    {_cost, best} =
      for({j, {a, b}} <- room.area.runs, i <- a..b, do: j * map.width + i)
      |> Enum.reduce({nil, nil}, fn cell, best ->
        cost = cost(map, cell)
        # Any number is less than an atom.
        if cost < elem(best, 0), do: {cost, cell}, else: best
      end)

    Enum.uniq([best, first(map, room)])
  end

  defp cost(map, cell) do
    clear = min((:binary.at(map.field, cell) - 0.5) * map.cell, @space)
    Pose.distance(Cells.point(map, cell), Cells.middle(map.room)) + @worth * (@space - clear)
  end

  @doc "The first cell of a room, in its lower left corner."
  @spec first(Sim.Floorplan.t(), t()) :: cell :: non_neg_integer()
  def first(map, %{area: %{runs: [{j, {a, _b}} | _]}}), do: j * map.width + a

  @doc "Whether a cell is in a room."
  @spec in?(Sim.Floorplan.t(), t(), cell :: non_neg_integer()) :: boolean()
  def in?(map, room, cell) do
    {i, j} = {rem(cell, map.width), div(cell, map.width)}
    Enum.any?(room.area.runs, fn {row, {a, b}} -> row == j and i in a..b end)
  end
end
