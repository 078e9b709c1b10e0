defmodule Sim.Floorplan.MapsTest do
  use ExUnit.Case, async: true
  alias Sim.Floorplan
  alias Sim.Floorplan.{Cells, Maps, Rooms}

  # A digest of each map: a run is a function of its options, so a map must not change unnoticed.
  @digests %{
    "hall" => "9ef7c3bb",
    "hospital" => "b6397e1b",
    "arena" => "c428f226",
    "clinic" => "a13d36e0",
    "offices" => "29cff0fd",
    "openplan" => "48fdf0b7",
    "lab" => "ea059efb",
    "cave" => "20f9d02d",
    "ring" => "1158841d",
    "doorway" => "2fdeb273",
    "rooms" => "dee4d0a5"
  }

  defp fleet(count),
    do:
      for(k <- 1..count, do: if(rem(k, 2) == 0, do: {:"mag#{k}", 0.2}, else: {:"min#{k}", 0.292}))

  test "the maps are drawn as ever" do
    drawn =
      for name <- Maps.names(), into: %{} do
        {:ok, map} = Floorplan.open(name, 6)
        {name, map.field |> :erlang.md5() |> Base.encode16(case: :lower) |> binary_part(0, 8)}
      end

    assert drawn == @digests
  end

  test "fleets of up to 20 start on each, the landmark in the middle or near it" do
    for name <- Maps.names(), count <- [1, 5, 8, 20] do
      {:ok, map} = Floorplan.open(name, count)

      for seed <- 1..3 do
        assert {:ok, landmark, poses} = Floorplan.places(map, fleet(count), seed, :default)
        assert length(poses) == count
        if name not in ["ring", "rooms"], do: assert(landmark == {0.0, 0.0})
      end
    end
  end

  test "every room of every map is reached from the landmark, by ways of 0.8 m" do
    for name <- Maps.names() do
      {:ok, map} = Floorplan.open(name, 6)
      {:ok, landmark, _poses} = Floorplan.places(map, fleet(1), 1, :default)
      at = Cells.cell(map, landmark)
      [ways] = map |> Rooms.of(Rooms.steps(map, 0.4)) |> Enum.filter(&Rooms.in?(map, &1, at))

      for room <- Rooms.of(map, Rooms.steps(map, 0.7)), first = Rooms.first(map, room) do
        assert Rooms.in?(map, ways, first),
               "#{name}: #{inspect(Cells.point(map, first))}, #{room.area.cells} cells"
      end
    end
  end

  test "each seed is a building of its own, whose rooms are all reached from each other" do
    maps = for seed <- 1..12, {:ok, map} = Floorplan.open("rooms:#{seed}", 5), do: map
    assert maps |> Enum.uniq_by(& &1.field) |> length() == 12
    assert {:ok, %{field: first}} = Floorplan.open("rooms", 5)
    assert hd(maps).field == first

    for map <- maps do
      [{_map, one} | _] =
        rooms =
        for room <- Rooms.of(map, Rooms.steps(map, 0.7)), do: {map, Rooms.first(map, room)}

      [ways] = map |> Rooms.of(Rooms.steps(map, 0.4)) |> Enum.filter(&Rooms.in?(map, &1, one))
      assert length(rooms) > 3
      for {map, cell} <- rooms, do: assert(Rooms.in?(map, ways, cell), map.name)
    end

    for name <- ["rooms:", "rooms:-1", "rooms:x", "rooms:4294967296"],
        do: assert({:error, "map: expected rooms:SEED" <> _} = Floorplan.open(name, 5))
  end

  test "the narrow door is 0.9 m wide, and diagonal walls are whole" do
    {:ok, doorway} = Floorplan.open("doorway", 6)
    assert_in_delta Floorplan.clearance(doorway, {2.5, 0.0}, 1.0), 0.45, 0.001

    {:ok, lab} = Floorplan.open("lab", 6)
    for k <- 0..99, s = k / 100, do: assert(Floorplan.wall?(lab, {-11 + 3 * s, 1 + 3 * s}))
    assert Floorplan.free?(lab, {-7.55, 4.45}, 0.5)
  end

  test "the landmark passes doors and corridors of the clinic" do
    {:ok, clinic} = Floorplan.open("clinic", 6)

    # Out of the lobby, along the main corridor and a wing, into a ward.
    way = [{0.0, -3.0}, {0.0, 0.0}, {9.0, 0.0}, {9.0, 9.4}, {14.0, 9.3}]

    for {{ax, ay}, {bx, by}} <- Enum.zip(way, tl(way)), k <- 0..100, s = k / 100 do
      assert Floorplan.free?(clinic, {ax + s * (bx - ax), ay + s * (by - ay)}, 0.4)
    end
  end
end
