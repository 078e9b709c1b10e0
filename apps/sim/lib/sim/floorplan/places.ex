defmodule Sim.Floorplan.Places do
  @moduledoc """
  Chooses where the landmark and the robots of a run stand, if that is not given. Pure.

  The landmark stands in the middle of the map, if the fleet has room about it. If not, in the room
  nearest the middle that takes the whole fleet; else where the fleet has room in several rooms, by
  ways of 0.8 m that lead to the landmark; else by ways that are just as wide as the robot. What
  lies outside of a building comes last: all this is tried with the rooms that do not reach the edge
  of the picture, then with those that do.
  """
  alias Hal.Pose
  alias Sim.Floorplan
  alias Sim.Floorplan.{Cells, Landmark, Maps, Refusal, Rooms, Search, Starts}

  @doc "See `Sim.Floorplan.places/4`."
  @spec choose(
          Floorplan.t(),
          [{atom(), float()}],
          integer(),
          Floorplan.point() | :default | nil
        ) ::
          {:ok, Floorplan.point() | nil, [Pose.t()]} | {:error, String.t()}
  def choose(map, robots, seed, asked) do
    fleet = %{map: map, robots: robots, seed: seed, asked: asked}

    case fleet |> attempts() |> first(0) do
      {:full, most} -> {:error, Refusal.line(map, robots, asked, most)}
      {:ok, landmark, poses} -> {:ok, landmark, poses}
    end
  end

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
      Maps.built_in?(map.name) -> [middle | in_rooms(fleet, fn _room -> true end)]
      outside?(fleet) -> inside ++ [middle] ++ outside
      true -> [middle] ++ inside ++ outside
    end
  end

  defp in_rooms(fleet, which?),
    do: for(level <- Search.levels(fleet), do: fn -> Search.in_rooms(fleet, level, which?) end)

  # Whether the middle of the picture is outside of a building that is in it.
  defp outside?(%{map: map} = fleet) do
    [{_way, start} | _] = Search.levels(fleet)
    middle = Cells.cell(map, Cells.middle(map.room))
    {outside, inside} = map |> Rooms.of(start) |> Enum.split_with(& &1.outer?)
    inside != [] and Enum.any?(outside, &Rooms.in?(map, &1, middle))
  end

  # As on the maps that are made for a fleet: with straight ways to the landmark.
  defp middle(%{map: map, robots: robots, seed: seed}, place) do
    with :ok <- if(place, do: Landmark.check(map, place), else: :ok),
         {:ok, poses} <- Starts.spread(map, robots, seed, place) do
      {:ok, place, poses}
    else
      {:error, _line} -> {:full, 0}
    end
  end
end
