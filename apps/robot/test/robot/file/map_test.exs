defmodule Robot.File.MapTest do
  use ExUnit.Case, async: true
  alias Nav.{Grid, MapFile}
  doctest Robot.File.Map

  @moduletag :tmp_dir

  # 4 x 3 m, surrounded by 1 m of what is unknown; a wall in the lower left corner of the floor.
  defp floor_plan(dir) do
    rows = for y <- 0..99, x <- 0..119, into: <<>>, do: pixel(x, y)
    File.write!(Path.join(dir, "floor.pgm"), ["P5 120 100 255\n", rows])
    file = Path.join(dir, "map.yaml")
    File.write!(file, "image: floor.pgm\nresolution: 0.05\norigin: [-2.0, 5.0, 0.0]\n")
    file
  end

  defp pixel(x, y) when x < 20 or x >= 100 or y < 20 or y >= 80, do: <<205>>
  defp pixel(x, y) when x < 40 and y >= 70, do: <<0>>
  defp pixel(_x, _y), do: <<254>>

  test "a robot's file names its map, which is beside it", %{tmp_dir: dir} do
    map = floor_plan(dir)
    path = Path.join(dir, "mag1.exs")

    load = fn plan, start ->
      File.write!(path, """
      [id: :mag1, profile: :magellan, drive: {Robot.FileDrive, port: "/dev/ttyS1"},
       map: #{plan},
       start: #{start}]
      """)

      Robot.File.load(path)
    end

    assert {:ok, robot} = load.(~s("map.yaml"), "{1.0, 7.5, 0.0}")
    assert {:ok, %Robot.Config{plan: %Grid{width: 40}}} = Robot.File.config(robot)
    assert Enum.join(Robot.File.Summary.lines(robot), " ") =~ "knows     the walls of"

    assert {:ok, %{map: nil} = robot} = load.("nil", "{0, 0, 0}")
    assert {:ok, %Robot.Config{plan: nil}} = Robot.File.config(robot)

    for {plan, start, expected} <- [
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
        do: assert(load.(plan, start) == {:error, [expected]})
  end

  test "a start where the body does not fit is a warning", %{tmp_dir: dir} do
    {:ok, map} = dir |> floor_plan() |> MapFile.open()

    odd = fn x ->
      robot = %Robot.File{
        id: :mag1,
        profile: Hal.Profile.magellan(),
        drive: {Robot.FileDrive, []},
        map: map,
        start: Hal.Pose.new(x, 7.5)
      }

      Robot.File.Warnings.lines(robot, fn _device -> true end)
    end

    assert odd.(1.0) == []
    assert [line] = odd.(-0.97)

    assert line =~
             ~r/^start: by the map a wall is within 0.120 m, and the body's radius is 0.200 m/
  end
end
