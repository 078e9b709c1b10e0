defmodule Sim.Floorplan.Search do
  @moduledoc false
  # Searches a map for places where a fleet can start together, with ways of a certain width between
  # them. Pure.
  alias Hal.Pose
  alias Sim.Floorplan
  alias Sim.Floorplan.{Clearance, Cells, Landmark, Packing, Rooms}

  # Metres. Half the width of a way, and the distance of a start place from walls: as a rule, and
  # beyond a robot's radius where there is no more room.
  @way 0.4
  @start 0.7
  @tight_way 0.05
  @tight_start 0.1
  # How far from a landmark that stands close to a wall the ways to it may end.
  @beside 3.0
  # So many cells to start on are first looked at, for each robot: 4 m2.
  @cells 1600

  @typedoc """
  `asked` is a landmark's place, `:default` for one to be chosen, or `nil` for none; `past?`: one that is chosen must leave ways
  past it.
  """
  @type fleet :: %{
          map: Floorplan.t(),
          robots: [{atom(), radius :: float()}],
          seed: integer(),
          asked: Floorplan.point() | :default | nil,
          past?: boolean()
        }

  @typedoc "The least bytes of the field on ways and on places to start."
  @type level :: {way :: pos_integer(), start :: pos_integer()}

  @type found ::
          {:ok, Floorplan.point() | nil, [Pose.t()]} | {:full, most :: non_neg_integer()}

  @doc """
  What is asked of ways and places, the best first: all in one room; with doors of 0.8 m between;
  with ways that are just as wide as the robot.
  """
  @spec levels(fleet()) :: [level()]
  def levels(%{map: map, robots: robots}) do
    radius = robots |> Enum.map(&elem(&1, 1)) |> Enum.max()
    steps = &Rooms.steps(map, &1)

    [
      {steps.(@start), steps.(@start)},
      {steps.(@way), steps.(@start)},
      {steps.(radius + @tight_way), steps.(least(radius))}
    ]
  end

  @doc "How far from walls a robot of this radius must at least start, in metres."
  @spec least(float()) :: float()
  def least(radius), do: radius + @tight_start

  @doc "The fleet and its landmark in one of these rooms, or reached from it: the first that will do."
  @spec in_rooms(fleet(), level(), (Rooms.t() -> boolean())) :: found()
  def in_rooms(fleet, {_way, start} = level, which?),
    do:
      any_room(
        fleet,
        level,
        fleet.map |> Rooms.of(start) |> Enum.filter(which?),
        {MapSet.new(), 0}
      )

  defp any_room(_fleet, _level, [], {_passed, most}), do: {:full, most}

  defp any_room(fleet, {way, start} = level, [room | rooms], {passed, most}) do
    # Where the fleet did not fit before, it will not do so from here.
    if MapSet.member?(passed, Rooms.first(fleet.map, room)) or
         (way == start and too_small?(fleet, room)) do
      any_room(fleet, level, rooms, {passed, most})
    else
      case in_room(fleet, level, Rooms.stands(fleet.map, room), {passed, most}) do
        {:ok, _landmark, _poses} = found -> found
        tried -> any_room(fleet, level, rooms, tried)
      end
    end
  end

  defp in_room(_fleet, _level, [], tried), do: tried

  defp in_room(fleet, level, [cell | cells], {passed, most}) do
    landmark = if fleet.asked == :default, do: Cells.told(Cells.point(fleet.map, cell))

    case around(fleet, level, cell, landmark) do
      {:ok, poses} ->
        if not fleet.past? or past?(fleet, landmark, poses),
          do: {:ok, landmark, poses},
          else: in_room(fleet, level, cells, {passed, most})

      {:full, fit, area} ->
        in_room(fleet, level, cells, {MapSet.union(passed, area), max(most, fit)})
    end
  end

  # Robots a metre apart, each with a disc of half a metre of its own, in a rectangle that is wider
  # than the room by as much.
  defp too_small?(fleet, %{area: %{columns: {a, b}, rows: {c, d}}}) do
    side = &((&2 - &1 + 1) * fleet.map.cell + 1.0)
    length(fleet.robots) * 0.785 > side.(a, b) * side.(c, d)
  end

  @doc """
  The fleet about a landmark's place. It may be closer to a wall than a robot comes; then the ways
  end beside it.
  """
  @spec about(fleet(), level(), Floorplan.point()) :: found()
  def about(%{map: map} = fleet, {way, _start} = level, place) do
    with cell when is_integer(cell) <- beside(map, {way, way}, place),
         {:ok, poses} <- around(fleet, level, cell, place) do
      {:ok, place, poses}
    else
      {:full, fit, _passed} -> {:full, fit}
      nil -> {:full, 0}
    end
  end

  @doc "The first cell, 3 m away at most, whose byte is at least `good`, by ways that are as wide as asked, or as the place."
  @spec beside(Floorplan.t(), {way :: pos_integer(), good :: pos_integer()}, Floorplan.point()) ::
          (cell :: non_neg_integer()) | nil
  def beside(map, {way, good}, place) do
    low = min(way, Clearance.steps(map, place))
    near? = fn cell -> Pose.distance(Cells.point(map, cell), place) <= @beside end

    if low > 0 do
      {_which, cells, _passed} = reach(map, Cells.cell(map, place), low, good, 1)
      Enum.find(cells, near?)
    end
  end

  @doc """
  Whether the robots get past a landmark to each other, by ways as wide as the widest of them: one in the middle of a corridor
  may leave none.
  """
  @spec past?(fleet(), Floorplan.point(), [Pose.t()]) :: boolean()
  def past?(%{map: map, robots: robots} = fleet, landmark, [first | others]) do
    [_one_room, _doors, {way, _start}] = levels(fleet)
    off = Landmark.radius() + (robots |> Enum.map(&elem(&1, 1)) |> Enum.max()) + @tight_way
    from = Cells.cell(map, Pose.point(first))
    {:all, _none, passed} = wave(map, [from], around(map, landmark, off), way, 256, {1, 0, []})
    Enum.all?(others, &MapSet.member?(passed, Cells.cell(map, Pose.point(&1))))
  end

  # The cells that are nearer to a place than this (metres).
  defp around(map, {x, y} = place, off) do
    steps = ceil(off / map.cell)

    for i <- -steps..steps,
        j <- -steps..steps,
        at = {x + i * map.cell, y + j * map.cell},
        cell = Cells.cell(map, at),
        Pose.distance(Cells.point(map, cell), place) < off,
        into: MapSet.new(),
        do: cell
  end

  # On places reached from a cell; more of them if the nearest do not suffice.
  defp around(fleet, level, cell, landmark),
    do: around(fleet, level, cell, landmark, @cells * max(length(fleet.robots), 10))

  defp around(fleet, {way, start} = level, cell, landmark, enough) do
    {which, cells, passed} = reach(fleet.map, cell, way, start, enough)

    case Packing.place(fleet.map, cells, length(fleet.robots), fleet.seed, landmark) do
      {:ok, poses} -> {:ok, poses}
      {:full, _fit} when which == :some -> around(fleet, level, cell, landmark, 4 * enough)
      {:full, fit} -> {:full, fit, passed}
    end
  end

  # Finds what can be reached from a place by free ways of a certain width. Pure.

  # The cells that are reached from cell `from` over cells whose byte in the field is at least
  # `way`, and whose own is at least `good`: at least `enough` of them unless there are no more, then
  # `:all`. With both the whole area that was passed.
  defp reach(map, from, way, good, enough) do
    if :binary.at(map.field, from) >= way,
      do: wave(map, [from], MapSet.new([from]), way, good, {enough, 0, []}),
      else: {:all, [], MapSet.new()}
  end

  defp wave(_map, [], seen, _way, _good, {_enough, _count, found}),
    do: {:all, Enum.reverse(found), seen}

  defp wave(_map, _front, seen, _way, _good, {enough, count, found}) when count >= enough,
    do: {:some, Enum.reverse(found), seen}

  defp wave(map, front, seen, way, good, {enough, count, found}) do
    {count, found} =
      Enum.reduce(front, {count, found}, fn cell, {count, found} ->
        if :binary.at(map.field, cell) >= good,
          do: {count + 1, [cell | found]},
          else: {count, found}
      end)

    {next, seen} =
      Enum.reduce(front, {[], seen}, fn cell, acc ->
        Enum.reduce([-map.width, -1, 1, map.width], acc, &step(map, cell + &1, cell, way, &2))
      end)

    wave(map, Enum.reverse(next), seen, way, good, {enough, count, found})
  end

  # A neighbour on the plan: a row neither ends in the next one, nor does the plan go on.
  defp step(map, to, from, way, {next, seen}) do
    if to >= 0 and to < byte_size(map.field) and
         abs(rem(to, map.width) - rem(from, map.width)) <= 1 and
         :binary.at(map.field, to) >= way and not MapSet.member?(seen, to),
       do: {[to | next], MapSet.put(seen, to)},
       else: {next, seen}
  end
end
