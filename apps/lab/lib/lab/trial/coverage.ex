defmodule Lab.Trial.Coverage do
  @moduledoc """
  Measures how much of a building is on the map that robots make of it, by the true floor plan. Pure.

  The area is where the middle of a Magellan can come to from the robots' starts, in the cells of their maps. A cell is seen
  when a map knows it, by the poses that the robots estimate; the robot whose map has most counts.
  """
  alias Hal.Pose
  alias Robot.Mission.Runner
  alias Nav.{Grid, MapFile, Reach, Survey}
  alias Lab.Trial
  alias Swarm.Member

  @cell Survey.cell()
  # A wall on the map that is so near to a true one (metres) is in its place.
  @near_m 0.2
  @radius Hal.Profile.magellan().radius

  @enforce_keys [:rows, :left, :count]
  defstruct @enforce_keys

  @typedoc "`rows` have a byte for each cell from column `left` on, 1 for those of the area, of which there are `count`."
  @type t :: %__MODULE__{
          rows: %{integer() => binary()},
          left: integer(),
          count: pos_integer()
        }

  @doc "The area that robots can come to from where they start."
  @spec area(Sim.Floorplan.t(), [Pose.point()]) :: t()
  def area(map, starts) do
    cells = for {x, y} <- starts, do: {floor(x / @cell), floor(y / @cell)}
    area = flood(cells, MapSet.new(cells), Sim.Floorplan.grid(map), Reach.room(@radius))
    {left, right} = area |> Enum.map(&elem(&1, 0)) |> Enum.min_max()

    rows =
      for {j, cells} <- Enum.group_by(area, &elem(&1, 1), &elem(&1, 0)), into: %{} do
        cells = MapSet.new(cells)
        {j, for(i <- left..right, into: <<>>, do: if(i in cells, do: <<1>>, else: <<0>>))}
      end

    %__MODULE__{rows: rows, left: left, count: MapSet.size(area)}
  end

  defp flood([], seen, _plan, _room), do: seen

  defp flood([{i, j} | more], seen, plan, room) do
    next =
      for {a, b} = at <- [{i - 1, j}, {i + 1, j}, {i, j - 1}, {i, j + 1}],
          not MapSet.member?(seen, at),
          Grid.free?(plan, {(a + 0.5) * @cell, (b + 0.5) * @cell}, room),
          do: at

    flood(next ++ more, Enum.reduce(next, seen, &MapSet.put(&2, &1)), plan, room)
  end

  @doc "Its size, m2."
  @spec size_m2(t()) :: float()
  def size_m2(%__MODULE__{count: count}), do: count * @cell * @cell

  @doc "The share of the area that this map knows."
  @spec share(t(), MapFile.Writer.raster() | nil) :: float()
  def share(_area, nil), do: 0.0

  def share(%__MODULE__{rows: rows, left: left, count: count}, map) do
    seen =
      for {j, row} <- rows,
          j >= map.low and j < map.low + map.height,
          from = max(left, map.left),
          upto = min(left + byte_size(row), map.left + map.width),
          from < upto,
          reduce: 0 do
        seen ->
          known = binary_part(map.cells, (j - map.low) * map.width + from - map.left, upto - from)
          both(known, binary_part(row, from - left, upto - from), seen)
      end

    seen / count
  end

  defp both(<<0, known::binary>>, <<_, row::binary>>, n), do: both(known, row, n)
  defp both(<<_, known::binary>>, <<1, row::binary>>, n), do: both(known, row, n + 1)
  defp both(<<_, known::binary>>, <<_, row::binary>>, n), do: both(known, row, n)
  defp both(<<>>, <<>>, n), do: n

  @doc "The map of the living robot that knows most; `nil` of a mission that makes none."
  @spec fullest(Trial.t()) :: MapFile.Writer.raster() | nil
  def fullest(trial) do
    maps =
      for id <- Trial.living(trial),
          map = Runner.map(Member.runner(Trial.robot(trial, id))),
          do: map

    Enum.max_by(maps, &known(&1.cells), fn -> nil end)
  end

  defp known(cells), do: for(<<state <- cells>>, state != 0, reduce: 0, do: (n -> n + 1))

  @doc "The share of the map's cells of wall that are within so many metres of a true wall; `nil` of a map without a wall."
  @spec walls(MapFile.Writer.raster(), Grid.t(), near :: float()) :: float() | nil
  def walls(map, plan, near) do
    true? =
      for {2, k} <- map.cells |> :binary.bin_to_list() |> Enum.with_index() do
        x = (map.left + rem(k, map.width) + 0.5) * map.cell
        y = (map.low + div(k, map.width) + 0.5) * map.cell
        Grid.clearance(plan, {x, y}) <= near
      end

    if true? != [], do: Enum.count(true?, & &1) / length(true?)
  end

  @doc """
  The area of a run that began there, the share of it that was seen, and that of the map's walls that are within 0.2 m of true
  ones, `nil` of a map without a wall; `nil` of a mission that makes no map.
  """
  @spec of(Trial.t(), [Pose.point()]) ::
          %{area_m2: float(), share: float(), walls: float() | nil} | nil
  def of(trial, starts) do
    with %{} = map <- fullest(trial) do
      area = area(trial.map, starts)
      walls = walls(map, Sim.Floorplan.grid(trial.map), @near_m)
      %{area_m2: size_m2(area), share: share(area, map), walls: walls}
    end
  end
end
