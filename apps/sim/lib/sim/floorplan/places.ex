defmodule Sim.Floorplan.Places do
  @moduledoc """
  Chooses where the landmark and the robots of a run stand, if that is not given. Pure.

  The landmark stands in the middle of the map, if the fleet has room about it, and in a drawing gets past it. If not, in the room
  nearest the middle that takes the whole fleet; else where the fleet has room in several rooms, by
  ways of 0.8 m that lead to the landmark; else by ways that are just as wide as the robot. What
  lies outside of a building comes last: all this is tried with the rooms that do not reach the edge
  of the picture, then with those that do. A landmark that is given outside of a building which takes the fleet is refused.
  """
  alias Hal.Pose
  alias Sim.Floorplan
  alias Sim.Floorplan.{Cells, Landmark, Maps, Rooms, Search, Starts}

  @doc "See `Sim.Floorplan.places/4`."
  @spec choose(
          Floorplan.t(),
          [{atom(), float()}],
          integer(),
          Floorplan.point() | :default | nil
        ) ::
          {:ok, Floorplan.point() | nil, [Pose.t()]} | {:error, String.t()}
  def choose(map, robots, seed, asked) do
    fleet = %{map: map, robots: robots, seed: seed, asked: asked, past?: false}

    case if(astray?(fleet), do: :outside, else: fleet |> past() |> first(0)) do
      :outside ->
        {x, y} = asked

        {:error,
         "the landmark cannot stand at #{x},#{y}: that is outside of the building in map #{map.name}"}

      {:full, most} ->
        {:error, line(map, robots, asked, most)}

      {:ok, landmark, poses} ->
        {:ok, landmark, poses}
    end
  end

  # On a drawing, first places of the landmark that leave ways past it.
  defp past(%{map: map, asked: :default} = fleet) do
    if Maps.built_in?(map.name),
      do: attempts(fleet),
      else: attempts(%{fleet | past?: true}) ++ attempts(fleet)
  end

  defp past(fleet), do: attempts(fleet)

  # Each is tried when those before it have failed; the most robots that one had room for counts.
  defp first([], most), do: {:full, most}

  defp first([attempt | others], most) do
    case attempt.() do
      {:full, fit} -> first(others, max(most, fit))
      found -> found
    end
  end

  defp attempts(%{asked: {_x, _y} = place} = fleet) do
    [_one_room | levels] = Search.levels(fleet)

    [
      fn -> middle(fleet, place) end
      | for(l <- levels, do: fn -> Search.about(fleet, l, place) end)
    ]
  end

  defp attempts(%{map: map} = fleet) do
    place = if fleet.asked == :default, do: Cells.told(Cells.middle(map.room))
    middle = fn -> middle(fleet, place) end
    inside = in_rooms(fleet, &(not &1.outer?))
    outside = in_rooms(fleet, & &1.outer?)

    cond do
      # Without a margin, and made to be used whole.
      Maps.built_in?(map.name) ->
        [middle | in_rooms(fleet, fn _room -> true end)]

      outside?(fleet, Cells.cell(map, Cells.middle(map.room)), :outer?) ->
        inside ++ [middle] ++ outside

      true ->
        [middle] ++ inside ++ outside
    end
  end

  defp in_rooms(fleet, which?),
    do: for(level <- Search.levels(fleet), do: fn -> Search.in_rooms(fleet, level, which?) end)

  # Whether a landmark that is given is in what surrounds a building that would take the fleet.
  defp astray?(%{map: map, asked: {_x, _y} = place} = fleet) do
    [_one_room, level | _] = Search.levels(fleet)

    not Maps.built_in?(map.name) and outside?(fleet, Search.beside(map, level, place), :around?) and
      match?({:ok, _, _}, fleet |> in_rooms(&(not &1.outer?)) |> first(0))
  end

  defp astray?(_chosen), do: false

  # Whether a cell is outside of a building that is in the picture: in a room of this kind.
  defp outside?(%{map: map} = fleet, cell, kind) do
    [{_way, start} | _] = Search.levels(fleet)
    {outside, inside} = map |> Rooms.of(start) |> Enum.split_with(& &1.outer?)

    cell != nil and inside != [] and
      Enum.any?(outside, &(Map.fetch!(&1, kind) and Rooms.in?(map, &1, cell)))
  end

  # As on the maps that are made for a fleet: with straight ways to the landmark.
  defp middle(%{map: map, robots: robots, seed: seed} = fleet, place) do
    with :ok <- if(place, do: Landmark.check(map, place), else: :ok),
         {:ok, poses} <- Starts.spread(map, robots, seed, place),
         true <- not fleet.past? or Search.past?(fleet, place, poses) do
      {:ok, place, poses}
    else
      _wall_or_no_way -> {:full, 0}
    end
  end

  # Words what is said of a fleet for which a map has no room: what would fit. Pure.

  # The line, given how many robots would fit.
  defp line(map, robots, asked, 0) do
    "#{who(length(robots))} cannot start in map #{map.name}: #{why(map, robots, asked)}"
  end

  defp line(map, robots, asked, most) do
    "#{who(length(robots))} cannot start in map #{map.name}: there is room for #{most}#{where(asked)}"
  end

  defp who(1), do: "1 robot"
  defp who(count), do: "#{count} robots"

  defp where({x, y}), do: ", with ways to the landmark at #{x},#{y}"
  defp where(_chosen), do: ""

  defp why(_map, _robots, {x, y}),
    do: "none has a free way to the landmark at #{x},#{y}"

  defp why(map, robots, _chosen) do
    need = 2 * Search.least(robots |> Enum.map(&elem(&1, 1)) |> Enum.max())
    widest = widest(map)

    cond do
      widest == 0.0 ->
        "it is all wall"

      widest < need ->
        {width, height} = Cells.size(map)
        factor = need / widest

        "its widest place is #{metres(widest)} m across, and a robot needs #{metres(need)} m; " <>
          "it would take a map of #{ceil(width * factor)} x #{ceil(height * factor)} m"

      true ->
        "no place is 1.2 m from the landmark and far enough from the walls"
    end
  end

  # Metres across the widest place, as far as a byte counts.
  defp widest(map) do
    steps = map.field |> :binary.bin_to_list() |> Enum.max()
    max(2 * steps - 1, 0) * map.cell
  end

  defp metres(metres), do: :erlang.float_to_binary(metres * 1.0, decimals: 2)
end
