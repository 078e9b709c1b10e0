defmodule Sim.DriveCaseTest do
  @moduledoc "Our drivers at emulated bases, by the kit that any driver must pass."
  use ExUnit.Case, async: true
  alias Hal.{DriveCase, Pose, Profile}
  alias Sim.World
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag timeout: 600_000

  defp emulated(core, options \\ []), do: {Sim.Emulator, [core: core] ++ options}

  # A body in a world with much floor.
  defp body do
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    robot = %{id: :mag1, profile: Profile.magellan(), pose: Pose.new(-2, 0), infrared: true}
    world = World.new!(map: map, robots: [robot], landmark: {0.0, 0.0}, noise: :off)
    name = make_ref()
    start_supervised!({World.Server, name: name, world: world})
    {Sim.Device.Drive, world: name, robot: :mag1}
  end

  test "an rFLEX base" do
    driver = {Hal.RFlex.Driver, conversions: [distance: 31_387.0, angle: 4654.2, range: 1474.0]}
    base = emulated({Sim.Emulator.RFlexController, []}, body: body())
    assert DriveCase.problems(driver, base, sonar: true) == []
  end

  test "a Kobuki" do
    driver = {Hal.Kobuki.Driver, limits: [max_linear: 0.3, max_turn: 1.0]}
    base = emulated({Sim.Emulator.Kobuki, []})
    assert DriveCase.problems(driver, base, max_linear: 0.3, max_turn: 1.0) == []
  end

  test "a TurtleBot3" do
    driver = {Hal.TurtleBot3.Driver, calibrate: false}
    base = emulated({Sim.Emulator.TurtleBot3, []})
    assert DriveCase.problems(driver, base, max_linear: 0.22, max_turn: 2.84) == []
  end

  test "a Create 2" do
    base = emulated({Sim.Emulator.Create, []})

    assert DriveCase.problems({Hal.Create.Driver, []}, base, max_linear: 0.5, max_turn: 4.25) ==
             []
  end

  test "an Arduino's base" do
    driver = {Hal.Arduino.Driver, ticks: 1_440, wheel_radius: 0.033, wheel_base: 0.2}
    base = emulated({Sim.Emulator.Arduino, []})
    assert DriveCase.problems(driver, base, max_linear: 1.0, max_turn: 6.0) == []
  end

  # A driver with one fault, at a base that obeys at once and for ever.
  defp faults(fault, rules) do
    driver = {Sim.FaultyDrive, fault: fault}
    DriveCase.problems(driver, emulated({Sim.PlainBase, []}), only: rules, wait_ms: 3_000)
  end

  test "a driver without a fault has none" do
    assert faults(nil, [:options, :missing, :drives, :limits, :close, :junk, :unplug]) == []
  end

  test "each fault is found by its rule" do
    for {fault, rule, words} <- [
          {:lenient, :options, "no_such_option: 1 is not refused"},
          {:wordy, :missing, "expected one line that names /"},
          {:moves, :stands, "moves untold"},
          {:mirrored, :drives, "does not go left"},
          {:fast, :limits, "drives faster than 0.5 m/s"},
          {:no_stop, :stop, "does not stand after a stop"},
          {:no_words, :close, "does not stand after the end of its device"},
          {:no_words, :killed, "does not stand after the killing of its process"},
          {:hoards, :junk, "its state has"},
          {:picky, :messages, "and has ended"},
          {:blind, :unplug, "nobody has acknowledged"},
          {:forgets, :unplug, "odometry jumps"}
        ] do
      assert {^fault, [line]} = {fault, faults(fault, [rule])}
      assert line =~ "#{rule}: "
      assert line =~ words
    end
  end
end
