defmodule Lab.Hardware.JoystickTest do
  @moduledoc "A robot by its file, with the driver of an rFLEX base, whose emulated joystick is held by the test."
  use ExUnit.Case, async: false
  import Swarm.Case, only: [eventually: 1]
  alias Hal.{Pose, Profile, Twist}
  alias Robot.Board
  alias Sim.Emulator
  alias Sim.Emulator.RFlexController
  alias Sim.World
  @moduletag :realtime
  @moduletag :capture_log

  # A robot at an emulated base in a world, by a file with these options of the driver.
  defp robot(id, folder, options) do
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    body = %{id: id, profile: Profile.magellan(), pose: Pose.new(-3, 0)}
    world = World.new!(map: map, robots: [body], landmark: nil, noise: :off)
    start_supervised!({World.Server, name: id, world: world}, id: {:world, id})
    core = {RFlexController, []}
    drive = {Sim.Device.Drive, world: id, robot: id}
    link = Path.join(folder, "base")
    emulator = [core: core, link: link, body: drive]

    base = start_supervised!(%{id: {:base, id}, start: {Emulator, :start_link, [emulator]}})

    file = Path.join(folder, "#{id}.exs")
    conversions = [distance: 31_387.0, angle: 4654.2, range: 1474.0]
    options = [port: link, conversions: conversions] ++ options

    text =
      inspect([id: id, profile: :magellan, arm: :auto, drive: {Hal.RFlex.Driver, options}],
        limit: :infinity
      )

    File.write!(file, text)
    {:ok, file} = Swarm.MemberSpec.load(file)
    {:ok, config} = Swarm.MemberSpec.config(file)
    start_supervised!({Robot.Supervisor, config}, id: {:robot, id}, restart: :temporary)
    eventually(fn -> match?(%Swarm.Status{arming: :armed}, Swarm.status(id)) end)
    base
  end

  defp held?(id, held?),
    do: match?({:ok, %{held?: ^held?}, _at_ms}, Board.fetch(Board.find!(id), :joystick, 300))

  defp wheels?(base, right?), do: eventually(fn -> right?.(Emulator.wheels(base)) end)

  @tag :tmp_dir
  test "its button drives the robot, whatever else it does, and stops it", %{tmp_dir: folder} do
    base = robot(:mag71, folder, joystick: true)
    eventually(fn -> held?(:mag71, false) end)
    # 40 counts ahead are 0.24 m/s, 20 to the right turn it to the right.
    :ok = Emulator.change(base, :stick, [20, 40, 1])
    wheels?(base, &(&1.linear > 0.2 and &1.turn < -0.1))
    :ok = Emulator.change(base, :stick, [0, 0, 1])
    wheels?(base, &Twist.zero?/1)
    :ok = Emulator.change(base, :stick, [0, 40, 1])
    wheels?(base, &(&1.linear > 0.2))
    :ok = Emulator.change(base, :stick, [0, 40, 0])
    wheels?(base, &Twist.zero?/1)
    assert %Swarm.Status{arming: :armed} = Swarm.status(:mag71)
  end

  @tag :tmp_dir
  test "it is not even asked for unless the robot's file wants it", %{tmp_dir: folder} do
    base = robot(:mag72, folder, [])
    :ok = Emulator.change(base, :stick, [0, 40, 0])
    :ok = Emulator.change(base, :stick, [0, 40, 1])
    # By then it would have been asked many times.
    %{sequence: beats} = :sys.get_state(Robot.Names.via(:mag72, :comms)).state

    eventually(fn ->
      :sys.get_state(Robot.Names.via(:mag72, :comms)).state.sequence > beats + 5
    end)

    assert Board.fetch(Board.find!(:mag72), :joystick, :infinity) == :error
    assert Twist.zero?(Emulator.wheels(base))
  end
end
