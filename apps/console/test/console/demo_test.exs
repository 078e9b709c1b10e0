defmodule Console.DemoTest do
  # It captures what goes to stderr, which is one device for all tests.
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Console.{Demo, FakeTrial, Runs}
  doctest Demo

  defp demo(line, words \\ []) do
    {status, text} = with_io(fn -> Demo.run(Runs.options(line, words), FakeTrial) end)
    {status, text}
  end

  test "prints each stage once, then the outcome" do
    {status, text} = demo("--kill mag2@40")
    assert status == 0
    lines = String.split(text, "\n", trim: true)
    assert hd(lines) =~ "6 robots (mag1 to mag3, min1 to min3) in hall, seed 1"
    assert Enum.count(lines, &(&1 =~ "elected ")) == 1
    assert Enum.count(lines, &(&1 =~ "killed ")) == 1
    assert text =~ "In formation"
    refute text =~ "\e["
  end

  defp first(line, words \\ []) do
    options = Runs.options(line <> " --duration 1 --blobs direct --noise off", words)
    {_status, text} = with_io(fn -> Demo.run(options, Lab.Trial) end)
    text |> String.split("\n") |> hd()
  end

  @tag :tmp_dir
  test "the first line says where all stand in a drawing, and that its grey is wall", %{
    tmp_dir: dir
  } do
    # Grey, a frame of wall, and floor, in pixels of half a metre.
    shade = fn n ->
      cond do
        n < 4 -> 204
        n == 4 -> 0
        true -> 255
      end
    end

    pixels =
      for j <- 0..27, i <- 0..35, into: <<>>, do: <<shade.(Enum.min([i, 35 - i, j, 27 - j]))>>

    file = Path.join(dir, "plan.pgm")
    File.write!(file, "P5 36 28 255\n" <> pixels)
    places = "-?\\d+\\.\\d\\d,-?\\d+\\.\\d\\d"

    assert first("--robots 3", ["--map", file <> ":18x14"]) =~
             ~r/plan.pgm:18x14 \(grey is wall; --grey floor makes it floor\), seed 1, column with 1.0 m spacing; the landmark stands at 0.00,0.00; the robots start between #{places} and #{places}$/

    assert first("--robots 1 --grey floor --landmark 1,1", ["--map", file <> ":18x14"]) =~
             ~r/plan.pgm:18x14, seed 1, column with 1.0 m spacing; the robot starts at #{places}$/
  end

  test "the first line says where the landmark stands if that was chosen, off the origin" do
    first = &first(&1 <> " --robots 1")

    assert first.("--map ring") =~
             ~r/1.0 m spacing; the landmark stands at -?\d+\.\d\d,-?\d+\.\d\d$/

    for line <- ["--map hall", "--map ring --landmark 0,7"],
        do: assert(first.(line) =~ ~r/1.0 m spacing$/)
  end

  test "ends with 2 when there is no formation" do
    assert {2, text} = demo("--landmark none --duration 10")
    assert text =~ "No formation"
  end

  test "without a leader, it says what those who looked for the landmark have looked at" do
    options =
      Runs.options("--map doorway --robots 2 --landmark none --duration 90 --blobs direct")

    assert {2, text} = with_io(fn -> Demo.run(options, Lab.Trial) end)
    assert text =~ ~r/ mag1, min1: no landmark: has looked at all that it can reach, \d+ m²\./
  end

  test "refuses in one line the options that the trial refuses" do
    options = %{Runs.options("") | map: "nowhere"}

    assert capture_io(:stderr, fn -> assert Demo.run(options, FakeTrial) == 1 end) ==
             "demo: the map \"nowhere\" cannot be read\n"
  end

  @tag :tmp_dir
  test "a run that ended before its time is reported, and ends with 1", %{tmp_dir: folder} do
    json = Path.join(folder, "run.json")
    options = Runs.options("", ["--json", json])
    test = self()
    hooks = [ended: fn _trial -> "the world is gone" end, stop: &send(test, {:stopped, &1})]

    told =
      capture_io(:stderr, fn ->
        capture_io(fn -> send(test, {:status, Demo.run(options, FakeTrial, hooks)}) end)
      end)

    assert_received {:status, 1}
    assert_received {:stopped, _trial}
    assert told == "demo: the world is gone\n"
    assert File.read!(json) =~ ~s({"version":")
  end

  @tag :tmp_dir
  test "writes report and picture", %{tmp_dir: folder} do
    json = Path.join(folder, "run.json")
    svg = Path.join(folder, "run.svg")
    assert {0, text} = demo("", ["--json", json, "--picture", svg])
    assert text =~ "Wrote #{json}"
    assert File.read!(json) =~ ~s({"version":")
    assert File.read!(svg) =~ "<svg"
  end

  @tag :tmp_dir
  test "a map that robots have made is one in which the next ones drive", %{tmp_dir: folder} do
    words = ["--save-map", Path.join(folder, "found.yaml")]

    line = "--headless --robots 1 --map doorway --landmark none --mission explore --duration 30"
    options = Runs.options(line <> " --blobs direct", words)
    {_status, text} = with_io(fn -> Demo.run(options, Lab.Trial) end)
    assert text =~ "Wrote #{options.save_map}"

    assert text =~
             ~r/explore: the goal is not reached: mag1 is not done \(\d+ m² explored, .+\)\./

    assert [_, seen, all, percent] =
             Regex.run(~r/ Seen: (\d+) of the (\d+) m² .+ \((.+) %\)/, text)

    assert_in_delta String.to_float(percent),
                    100 * String.to_integer(seen) / String.to_integer(all),
                    1.0

    assert {:ok, %{grid: grid}} = Nav.MapFile.open(options.save_map)
    assert {:ok, true_map} = Sim.Floorplan.open("doorway", 1)
    assert {:ok, found} = Sim.Floorplan.open(options.save_map, 1)
    {width, height} = Sim.Floorplan.size(true_map)

    free =
      for x <- 1..round(width * 5),
          y <- 1..round(height * 5),
          at = {x / 5 - width / 2, y / 5 - height / 2},
          Nav.Grid.clearance(grid, at) > 0.3,
          do: at

    assert length(free) > 100
    assert Enum.all?(free, &(not Sim.Floorplan.wall?(true_map, &1)))
    assert Enum.all?(free, &(not Sim.Floorplan.wall?(found, &1)))
  end

  test "with --json - only the report goes to standard output" do
    told = capture_io(:stderr, fn -> send(self(), demo("--json -")) end)
    assert_received {0, text}
    assert [json] = String.split(text, "\n", trim: true)
    assert json =~ ~r/^\{"version".*\}$/
    assert told =~ "elected"
  end
end
