defmodule Sim.Floorplan.DescriptionTest do
  use ExUnit.Case, async: true
  alias Sim.Floorplan

  @moduletag :tmp_dir

  @yaml """
  image: floor.pgm
  mode: trinary
  resolution: 0.050000   # metres
  origin: [-1.000000, -3.0, 0]
  negate: 0
  occupied_thresh: 0.65
  free_thresh: 0.196
  """

  defp with_line(key, line),
    do: String.replace(@yaml, ~r/^#{key}:.*$/m, line)

  # 4 x 3 m of floor with a wall in the lower left corner.
  defp picture do
    "P5 80 60 255\n" <>
      for(
        y <- 0..59,
        x <- 0..79,
        into: <<>>,
        do: if(x < 20 and y >= 50, do: <<0>>, else: <<254>>)
      )
  end

  test "what is not known is wall, and told apart from walls", %{tmp_dir: dir} do
    # 205 is what map_server writes for it.
    row = :binary.copy(<<0>>, 20) <> :binary.copy(<<205>>, 20) <> :binary.copy(<<254>>, 40)
    File.write!(Path.join(dir, "floor.pgm"), "P5 80 60 255\n" <> :binary.copy(row, 60))
    file = Path.join(dir, "map.yaml")

    for {origin, {x, y}, beyond} <- [
          {"[-2.0, -1.5, 0.0]", {1.0, 0.0}, nil},
          {"[-1.0, -1.5, 0.0]", {1.0, 0.0}, {-2.0, 0.0}},
          {"[1.5, -2.0, 1.5707963]", {0.0, 1.0}, nil}
        ] do
      File.write!(file, with_line("origin", "origin: #{origin}"))
      {:ok, map} = Floorplan.open(file, 1)

      # Where the picture's left edge lies: along its rows there are 1 m of wall, 1 m unknown and 2 m of floor.
      [left, low] =
        origin
        |> String.trim("[")
        |> String.split(",")
        |> Enum.take(2)
        |> Enum.map(&String.to_float(String.trim(&1)))

      {dx, dy} = if x == 1.0, do: {0.0, 1.0}, else: {-1.0, 0.0}
      at = fn along -> {left + along * x + 1.2 * dx, low + along * y + 1.2 * dy} end

      for {along, wall?, unknown?} <- [{0.5, true, false}, {1.5, true, true}, {2.5, false, false}] do
        place = at.(along)
        assert {origin, along, Floorplan.wall?(map, place)} == {origin, along, wall?}
        assert {origin, along, Floorplan.unknown?(map, place)} == {origin, along, unknown?}
      end

      if beyond, do: assert(Floorplan.wall?(map, beyond) and Floorplan.unknown?(map, beyond))
    end
  end

  test "places are counted from the origin of the description", %{tmp_dir: dir} do
    File.write!(Path.join(dir, "floor.pgm"), picture())
    file = Path.join(dir, "map.yaml")

    for {{x, y}, size} <- [
          {{-2.0, -1.5}, {4.0, 3.0}},
          {{-1.0, -3.0}, {6.0, 6.0}},
          {{0.0, 0.0}, {8.0, 6.0}},
          {{0.5, -0.25}, {9.0, 5.5}}
        ] do
      File.write!(file, with_line("origin", "origin: [#{x}, #{y}, 0.0]"))
      assert {:ok, map} = Floorplan.open(file, 2)
      assert Floorplan.size(map) == size
      {left, low, right, high} = map.room

      for {a, b} <- [{left, x}, {low, y}, {right, x + 4}, {high, y + 3}],
          do: assert_in_delta(a, b, 1.0e-9)

      for {i, j, wall?} <- [
            {0.5, 0.25, true},
            {1.5, 0.25, false},
            {0.5, 0.75, false},
            {-0.1, 1.0, true}
          ] do
        assert Floorplan.wall?(map, {x + i, y + j}) == wall?
      end

      assert {:ok, {lx, ly}, [_, _]} =
               Floorplan.places(map, [mag1: 0.2, min1: 0.292], 1, :default)

      assert lx > x and lx < x + 4 and ly > y and ly < y + 3
    end
  end

  test "a turned origin turns the plan round the lower left corner of the picture", %{
    tmp_dir: dir
  } do
    File.write!(Path.join(dir, "floor.pgm"), picture())
    file = Path.join(dir, "map.yaml")

    for {x, y, turn} <- [
          {2.0, -1.0, :math.pi() / 2},
          {2.0, 1.5, :math.pi()},
          {-1.0, 2.0, -:math.pi() / 2},
          {1.5, 2.0, 3.14},
          {-1.0, -1.0, 0.5}
        ] do
      File.write!(file, with_line("origin", "origin: [#{x}, #{y}, #{turn}]"))
      assert {:ok, map} = Floorplan.open(file, 2)

      for {i, j, wall?} <- [
            {0.5, 0.25, true},
            {0.2, 0.2, true},
            {1.3, 0.25, false},
            {0.5, 0.75, false},
            {3.7, 2.7, false},
            {3.7, 0.3, false},
            {-0.15, 1.0, true},
            {4.15, 1.0, true},
            {2.0, 3.15, true}
          ] do
        {cos, sin} = {:math.cos(turn), :math.sin(turn)}
        place = {x + i * cos - j * sin, y + i * sin + j * cos}
        assert {turn, i, j, Floorplan.wall?(map, place)} == {turn, i, j, wall?}
      end

      # What robots know is the same floor.
      {:ok, %{grid: grid}} = Nav.MapFile.open(file)

      for i <- -20..20, j <- -20..20, place = {i * 0.2 + 0.05, j * 0.2 + 0.05} do
        if Nav.Grid.clearance(grid, place) > 0.1,
          do: refute(Floorplan.wall?(map, place), inspect({turn, place}))

        if Floorplan.clearance(map, place, 0.3) > 0.2,
          do: assert(Nav.Grid.clearance(grid, place) > 0.0, inspect({turn, place}))
      end
    end
  end

  test "a description that cannot be opened is one line", %{tmp_dir: dir} do
    File.write!(Path.join(dir, "floor.pgm"), picture())
    file = Path.join(dir, "map.yaml")

    for {yaml, pattern} <- [
          {"resolution: 0.05\n", ~r/map.yaml: image is missing/},
          {with_line("image", "image: other.pgm"), ~r/other.pgm: no such file/},
          {with_line("image", "image: map.yaml"), ~r/is no picture that is known: PNG, PGM/},
          {with_line("resolution", "resolution: 0.01"),
           ~r/it is 0.80 x 0.60 m; each side must be at least 1 m/},
          {with_line("origin", "origin: [-1, 9000, 0]"), ~r/origin .* is too far from 0,0/},
          {with_line("origin", "origin: [-9000, -9000, 0]"), ~r/origin .* is too far from 0,0/}
        ] do
      File.write!(file, yaml)
      assert {:error, line} = Floorplan.open(file, 2)
      assert line =~ pattern
      refute line =~ "\n"
    end

    assert {:error, line} = Floorplan.open(Path.join(dir, "none.yml"), 2)
    assert line =~ "no such file"
  end
end
