defmodule Robot.Navigation.MapFileTest do
  use ExUnit.Case, async: true
  alias Robot.Navigation.{Grid, MapFile}
  doctest MapFile
  doctest MapFile.Writer
  doctest Robot.File.Map

  @moduletag :tmp_dir

  # 4 x 3 m, surrounded by 1 m of what is unknown; a wall in the lower left corner of the floor.
  defp picture do
    rows =
      for y <- 0..99 do
        for x <- 0..119, into: <<>> do
          cond do
            x < 20 or x >= 100 or y < 20 or y >= 80 -> <<205>>
            x < 40 and y >= 70 -> <<0>>
            true -> <<254>>
          end
        end
      end

    ["P5 120 100 255\n", rows]
  end

  defp yaml(dir, changes) do
    keys =
      Keyword.merge([image: "floor.pgm", resolution: "0.05", origin: "[-2.0, 5.0, 0.0]"], changes)

    file = Path.join(dir, "map.yaml")
    File.write!(file, for({key, value} <- keys, do: "#{key}: #{value}\n"))
    file
  end

  test "the origin says where the floor lies; what surrounds it takes no cells", %{tmp_dir: dir} do
    File.write!(Path.join(dir, "floor.pgm"), picture())
    file = yaml(dir, [])
    assert {:ok, %MapFile{file: ^file, grid: grid}} = MapFile.open(file)

    assert {grid.width, grid.height} == {40, 30}
    assert_in_delta grid.cell, 0.1, 1.0e-9
    assert_in_delta grid.left, -1.0, 1.0e-9
    assert_in_delta grid.low, 6.0, 1.0e-9

    for {place, wall?} <- [
          {{-0.5, 6.25}, true},
          {{0.5, 6.25}, false},
          {{-0.5, 7.0}, false},
          {{-1.1, 7.0}, true},
          {{1.0, 9.1}, true}
        ],
        do: assert(Grid.clearance(grid, place) == 0.0 == wall?, inspect(place))

    assert [{x, y}] = Grid.Way.find(grid, {-0.5, 7.5}, {2.5, 7.5}, 0.2)
    assert {x, y} == {2.5, 7.5}
  end

  test "a map that robots made is read as it was written", %{tmp_dir: dir} do
    # 5.1 x 2 m with a wall of one cell; what is unknown is wall for who reads it.
    cells =
      for j <- 0..19, i <- 0..50, into: <<>> do
        cond do
          i == 0 or j == 0 or i == 50 or j == 19 -> <<0>>
          i == 20 and j < 10 -> <<2>>
          true -> <<1>>
        end
      end

    map = %{cells: cells, width: 51, height: 20, left: -37, low: 12, cell: 0.1}
    file = Path.join(dir, "found.yaml")
    assert MapFile.save(file, map) == :ok
    assert {:ok, %MapFile{grid: grid}} = MapFile.open(file)

    for j <- 0..19, i <- 0..50 do
      free? = Grid.clearance(grid, {(i - 36.5) * 0.1, (j + 12.5) * 0.1}) > 0.0
      assert free? == (:binary.at(cells, j * 51 + i) == 1), inspect({i, j})
    end

    nowhere = Path.join([dir, "none", "found.yaml"])
    assert {:error, line} = MapFile.save(nowhere, map)
    assert line =~ "none/found.pgm: no such file or directory"
  end

  test "a map that will not do is one line that names the file and what is allowed", %{
    tmp_dir: dir
  } do
    write = &File.write!(Path.join(dir, &1), &2)
    write.("floor.pgm", picture())
    write.("dark.pgm", "P5 60 60 255\n" <> :binary.copy(<<0>>, 3600))
    write.("huge.pgm", "P5 5000 5000 255\n")
    write.("wide.pgm", ["P5 101 101 255\n", :binary.copy(<<254>>, 101 * 101)])
    write.("text.png", "hello")

    for {changes, pattern} <- [
          {[image: "none.png"], ~r/none.png: no such file or directory$/},
          {[image: "text.png"],
           ~r/text.png: is no picture that is known: PNG and PGM \(P2, P5\) are read/},
          {[image: "huge.pgm"], ~r/huge.pgm: 5000 x 5000 pixels are too many/},
          {[image: "dark.pgm"], ~r/map.yaml: shows no floor/},
          {[image: "wide.pgm", resolution: "1.0"],
           ~r/has floor on 101 x 101 m: up to 100 x 100 m, .* are allowed$/},
          {[image: "wide.pgm", resolution: "10"],
           ~r/is 1010.0 x 1010.0 m: 0.1 to 500 m are allowed/},
          {[resolution: "0"], ~r/map.yaml: resolution: expected a number from 0.001/},
          {[resolution: ".nan"], ~r/map.yaml: resolution: expected a number from 0.001/},
          {[origin: "[0, 0, 0.5]"], ~r/map.yaml: origin .* is turned/}
        ] do
      assert {:error, line} = dir |> yaml(changes) |> MapFile.open()
      assert line =~ pattern
      refute line =~ "\n"
    end

    assert MapFile.open(dir) == {:error, "#{dir}: is a directory, not a file"}
  end

  test "a robot's file names its map, which is beside it", %{tmp_dir: dir} do
    File.write!(Path.join(dir, "floor.pgm"), picture())
    yaml(dir, [])
    path = Path.join(dir, "mag1.exs")

    load = fn map, start ->
      File.write!(path, """
      [id: :mag1, profile: :magellan, drive: {Robot.FileDrive, port: "/dev/ttyS1"},
       map: #{map},
       start: #{start}]
      """)

      Robot.File.load(path)
    end

    map = Path.join(dir, "map.yaml")
    assert {:ok, robot} = load.(~s("map.yaml"), "{1.0, 7.5, 0.0}")
    assert {:ok, %Robot.Config{plan: %Grid{width: 40}}} = Robot.File.config(robot)
    assert Enum.join(Robot.File.Summary.lines(robot), " ") =~ "knows     the walls of"

    assert {:ok, %{map: nil} = robot} = load.("nil", "{0, 0, 0}")
    assert {:ok, %Robot.Config{plan: nil}} = Robot.File.config(robot)

    for {map, start, expected} <- [
          {~s("map.yaml"), "{-0.5, 6.25, 0}",
           "#{path}:3: start: expected floor of the map #{map}, got {-0.5, 6.25}: there is a wall"},
          {~s("map.yaml"), "{0, 0, 0}",
           "#{path}:3: start: expected floor of the map #{map}, got {0.0, 0.0}: it is outside of it"},
          {~s("none.yaml"), "{0, 0, 0}",
           "#{path}:2: map: #{Path.join(dir, "none.yaml")}: no such file or directory"},
          {~s("floor.pgm"), "{0, 0, 0}",
           "#{path}:2: map: expected nil or the path of a floor plan's description, \"FILE.yaml\", got \"floor.pgm\""},
          {":known", "{0, 0, 0}",
           "#{path}:2: map: expected nil or the path of a floor plan's description, \"FILE.yaml\", got :known"}
        ],
        do: assert(load.(map, start) == {:error, [expected]})
  end

  test "a start where the body does not fit is a warning", %{tmp_dir: dir} do
    File.write!(Path.join(dir, "floor.pgm"), picture())
    {:ok, map} = dir |> yaml([]) |> MapFile.open()

    odd = fn x ->
      robot = %Robot.File{
        id: :mag1,
        profile: Hal.Profile.magellan(),
        drive: {Robot.FileDrive, []},
        map: map,
        start: Hal.Pose.new(x, 7.5)
      }

      Robot.File.Odd.lines(robot, fn _device -> true end)
    end

    assert odd.(1.0) == []
    assert [line] = odd.(-0.97)

    assert line =~
             ~r/^start: by the map a wall is within 0.120 m, and the body's radius is 0.200 m/
  end
end
