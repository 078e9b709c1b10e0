defmodule Sim.World.ServerTest do
  @moduledoc "A world in real time, and the devices that find it by its name."
  use ExUnit.Case, async: false
  @moduletag :realtime
  @moduletag :capture_log
  import Hal.Lines, only: [eventually: 1]
  alias Hal.{Device, Pose, Profile, Twist}
  alias Sim.World

  setup do
    unless World.Directory.running?(), do: start_supervised!(World.Directory)
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    robot = %{id: :mag1, profile: Profile.magellan(), pose: Pose.new(-2, 0)}
    world = World.new!(map: map, robots: [robot], landmark: {0.0, 0.0}, noise: :off)
    %{world: world, name: make_ref()}
  end

  defp serve(name, world),
    do: start_supervised!({World.Server, name: name, world: world}, id: name, restart: :temporary)

  defp device(kind, driver, options) do
    sink = {__MODULE__, :tell, [self(), kind]}
    device = [kind: kind, driver: {driver, options}, sinks: [sink]]
    start_supervised!({Device, device}, restart: :temporary, id: {kind, make_ref()})
  end

  @doc false
  def tell(test, kind, reading), do: send(test, {kind, reading})

  defp x(server), do: World.truth(World.Server.world(server), :mag1).x

  test "a device waits for its world, and for the next one when it ends", %{
    world: world,
    name: name
  } do
    drive = device(:drive, Sim.Device.Drive, world: name, robot: :mag1)
    assert_receive {:drive, {:health, :drive, {{:offline, :no_world}, _}}}
    server = serve(name, world)
    assert_receive {:drive, {:health, :drive, {:online, _}}}, 5_000
    assert_receive {:drive, {:odometry, _}}
    assert_receive {:drive, {:sonar, sonar}}
    assert length(sonar) == 16
    refute_received {:drive, {:ptz, _}}

    Process.exit(server, :kill)
    assert_receive {:drive, {:health, :drive, {{:offline, :no_world}, _}}}, 5_000
    stop_supervised(name)
    serve(name, world)
    assert_receive {:drive, {:health, :drive, {:online, _}}}, 5_000
    assert Process.alive?(drive)
  end

  test "a device that attaches again and again is monitored once, and not after it has left", %{
    world: world,
    name: name
  } do
    server = serve(name, world)

    watched = fn ->
      server |> Process.info(:monitors) |> elem(1) |> Enum.count(&(&1 == {:process, self()}))
    end

    for _ <- 1..3 do
      {:ok, line} = World.Server.attach(name, :mag1, :drive)
      # The call comes after the cast, so the cast has been carried out.
      %World{} = World.Server.world(server)
      assert watched.() == 1
      World.Server.detach(line, :mag1, :drive)
    end

    {:ok, line} = World.Server.attach(name, :mag1, :drive)
    {:ok, _again} = World.Server.attach(name, :mag1, :drive)
    %World{} = World.Server.world(server)
    assert watched.() == 1
    World.Server.detach(line, :mag1, :drive)
    %World{} = World.Server.world(server)
    assert watched.() == 0
  end

  test "wheels do as asked, and stand when their driver is gone", %{
    world: world,
    name: name
  } do
    server = serve(name, world)
    drive = device(:drive, Sim.Device.Drive, world: name, robot: :mag1)
    assert_receive {:drive, {:odometry, _}}

    eventually(fn ->
      Device.drive(drive, Twist.new(0.3, 0))
      x(server) > -1.98
    end)

    monitor = Process.monitor(drive)
    Process.exit(drive, :kill)
    assert_receive {:DOWN, ^monitor, _, _, :killed}
    eventually(fn -> World.Server.world(server).robots.mag1.speed == {0.0, 0.0} end)
    assert x(server) < -1.5
  end

  test "wheels stand 200 ms after the last speed: a robot that is frozen says nothing", %{
    world: world,
    name: name
  } do
    server = serve(name, world)
    World.Server.drive(server, :mag1, Twist.new(0.3, 0))
    %{step: told, robots: robots} = World.Server.world(server)
    assert robots.mag1.wanted == Twist.new(0.3, 0)
    # In the time of the world, however late its steps are, and however seldom this process looks.
    {moved, stood} = stood(server, told)
    assert moved - told <= 5
    assert stood - told >= 3
  end

  defp stood(server, moved) do
    %{step: step, robots: %{mag1: %{wanted: wanted}}} = World.Server.world(server)
    if Twist.zero?(wanted), do: {moved, step}, else: stood(server, step)
  end

  test "a world that goes on from where another was killed has nobody at the wheels", %{
    world: world,
    name: name
  } do
    moving = world |> World.drive(:mag1, Twist.new(0.5, 0.3)) |> World.step(50)
    server = serve(name, moving)
    assert World.Server.world(server).robots.mag1.wanted == Twist.zero()
  end

  test "a camera paints its pictures, or finds blobs without painting", %{
    world: world,
    name: name
  } do
    serve(name, world)
    device(:camera, Sim.Device.Camera, world: name, robot: :mag1)
    assert_receive {:camera, {:frame, %Hal.Frame{format: :i420} = frame}}
    {:ok, [%{colour: "YellowLandmark"} = painted]} = Vision.blobs(frame, World.colours())

    device(:camera, Sim.Device.Camera, world: name, robot: :mag1, blobs: :direct)

    assert_receive {:camera,
                    {:detections, %{blobs: [%{colour: "YellowLandmark"} = direct]} = seen}}

    assert_in_delta painted.x, direct.x, 3
    assert seen.pan == 0.0

    for _ <- 1..3, do: assert_receive({:camera, {:detections, _}})
  end

  test "a pan-tilt unit turns and reports where it looks", %{world: world, name: name} do
    serve(name, world)
    ptz = device(:ptz, Sim.Device.Ptz, world: name, robot: :mag1)
    assert_receive {:ptz, {:ptz, %{pan: pan}}}
    assert pan == 0.0
    Device.look(ptz, 0.5, 0.0)
    assert_receive {:ptz, {:ptz, %{pan: pan}}} when pan > 0.45, 5_000
  end

  test "a robot that is not in the world gets an error", %{world: world, name: name} do
    serve(name, world)
    device(:drive, Sim.Device.Drive, world: name, robot: :mag9)
    assert_receive {:drive, {:health, :drive, {{:offline, :unknown_robot}, _}}}
  end

  test "the pace does not drift", %{world: world, name: name} do
    server = serve(name, world)
    before = {World.Server.world(server).at_ms, System.monotonic_time(:millisecond)}
    eventually(fn -> World.Server.world(server).at_ms >= elem(before, 0) + 1_500 end)
    took = System.monotonic_time(:millisecond) - elem(before, 1)
    assert took >= 1_400
  end
end
