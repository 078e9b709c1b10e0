defmodule Tools.CalibrateRangesTest do
  @moduledoc "A robot is put before a wall at known distances: real driver, emulated base, a person who types."
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Console.Person
  alias Hal.{Pose, Profile}
  alias Sim.{Emulator, World}
  alias Tools.Calibrate.Ranges
  @moduletag :realtime
  @moduletag :tmp_dir

  doctest Ranges
  doctest Robot.Calibration.Ranges

  # The base has the published units, 1474 per metre of sonar, and the law 4000, -2.
  defp base(folder, wrong) do
    {:ok, _apps} = Application.ensure_all_started(:swarm)
    unless World.Directory.running?(), do: start_supervised!(World.Directory)
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    pose = Pose.new(0, 0, 0)
    robot = %{id: :mag1, profile: Profile.magellan(), pose: pose, infrared: true}
    name = make_ref()
    world = World.new!(map: map, robots: [robot], noise: :off)
    server = start_supervised!({World.Server, name: name, world: world})
    link = Path.join(folder, "base")

    start_supervised!(
      {Emulator,
       core: {Sim.Emulator.RFlexController, kind: :magellan},
       link: link,
       body: {Sim.Device.Drive, world: name, robot: :mag1}}
    )

    file = Path.join(folder, "mag1.exs")

    File.write!(file, """
    [
      id: :mag1,
      profile: :magellan,
      drive: {Hal.RFlex.Driver, port: "#{link}",
        conversions: [distance: 31387.0, angle: 4654.2, #{wrong}]}
    ]
    """)

    {server, file}
  end

  defp run(words, person) do
    {:ok, options} = Ranges.parse(words)

    Task.async(fn ->
      Process.group_leader(self(), person)
      Ranges.run(options)
    end)
    |> Task.await(120_000)
  end

  # The right wall of the hall is 8 m away; a sensor sits 0.2 m ahead of the middle.
  defp place(server) do
    Person.start(fn text ->
      case Regex.run(~r/is ([\d.]+) m from a flat wall/, text) do
        [_all, metres] -> Process.put(:metres, String.to_float(metres))
        nil -> nil
      end

      cond do
        text =~ "go, skip or quit" ->
          pose = Pose.new(8.0 - Process.get(:metres) - 0.2, 0, 0)
          :ok = World.Server.change(server, {:displace, :mag1, pose})
          "go"

        text =~ "write it?" ->
          "yes"

        true ->
          nil
      end
    end)
  end

  test "the units of the sonars are found, and written into the file", %{tmp_dir: folder} do
    {server, file} = base(folder, "range: 1600.0, ir_a: 4000.0, ir_b: -2.0")
    person = place(server)
    assert run([file, "--at", "0.6,1.2,2.0"], person) == :ok
    assert Person.heard(person) =~ "sonar 11"
    {:ok, %{drive: {_driver, options}}} = Swarm.MemberSpec.load(file)
    assert_in_delta options[:conversions][:range], 1474.0, 15.0
    assert options[:conversions][:angle] == 4654.2
  end

  test "the law of the infrareds is found", %{tmp_dir: folder} do
    {server, file} = base(folder, "range: 1474.0, ir_a: 4400.0, ir_b: -2.0")
    assert run([file, "--sensor", "infrared", "--at", "0.3,0.45,0.6"], place(server)) == :ok
    {:ok, %{drive: {_driver, options}}} = Swarm.MemberSpec.load(file)
    {a, b} = {options[:conversions][:ir_a], options[:conversions][:ir_b]}

    for voltage <- [85, 100, 115],
        do: assert_in_delta(a * :math.pow(voltage, b), 4000 * :math.pow(voltage, -2), 0.02)
  end

  test "what was typed needs no robot, and nothing is written unasked", %{tmp_dir: folder} do
    {_server, file} = base(folder, "range: 1474.0")
    before = File.read!(file)
    {:ok, options} = Ranges.parse([file, "--at", "0.5,1", "--told", "0.54,1.08"])
    said = capture_io(fn -> assert Ranges.run(options) == :ok end)
    assert said =~ "range: 1591.92: the distances would be told within 0.000 m"
    assert said =~ "not written; --write writes it"
    assert File.read!(file) == before

    {:ok, options} = Ranges.parse([file, "--at", "0.5,1", "--told", "0.54,5.1"])
    assert Ranges.run(options) == {:error, "at 1.0 m it told 5.1 m: that was not the wall"}
  end

  test "bad input is one line", %{tmp_dir: folder} do
    {_server, file} = base(folder, "range: 1474.0")
    {:ok, options} = Ranges.parse([file, "--number", "16"])
    assert Ranges.run(options) == {:error, "--number: expected 0 to 15, got 16"}
    assert {:error, [line]} = Ranges.parse([file, "--at", "0.5,x"])
    assert line =~ "up to 20 distances from 0.05 to 10 m"
    assert {:error, ["--told needs" <> _]} = Ranges.parse([file, "--told", "0.5"])
  end
end
