defmodule Sim.World.LineTest do
  use ExUnit.Case, async: true
  import Hal.Lines, only: [eventually: 1]
  alias Hal.{Pose, Profile, Twist}
  alias Sim.World
  alias Sim.World.{Line, Server}

  @moduletag :tmp_dir

  setup %{tmp_dir: folder} do
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    body = %{id: :mag1, profile: Profile.magellan(), pose: Pose.new(-1.7, 0.0)}
    world = World.new!(map: map, robots: [body], landmark: {0.0, 0.0}, noise: :off)
    unless World.Directory.running?(), do: start_supervised!(World.Directory)
    # Paths of sockets are short.
    path = Path.join(System.tmp_dir!(), "line-#{System.unique_integer([:positive])}")
    on_exit(fn -> File.rm(path) end)
    far = make_ref()
    start_supervised!({Server, name: far, world: world}, id: :world)
    start_supervised!(Line.world(path, far), id: :far)
    %{path: path, far: far, folder: folder}
  end

  defp attach(near, kind),
    do: eventually(fn -> with({:error, _} <- Server.attach(near, :mag1, kind), do: nil) end)

  defp speed(far), do: Server.world(World.Directory.find(far)).robots.mag1.speed

  test "a robot's devices have its body at the other end, and stop its wheels when they end",
       context do
    near = make_ref()
    start_supervised!(Line.robot(context.path, near), id: :near)
    assert {:ok, {server, _monitor}} = attach(near, :drive)
    assert server == World.Directory.find(near)
    assert server != World.Directory.find(context.far)
    assert_receive {:world, ^server, {:readings, _sent_ms, [_ | _] = readings}}
    assert readings[:odometry]

    # A camera asks for each view, and has the ground before.
    me = self()

    camera =
      spawn_link(fn ->
        {:ok, {server, _monitor}} = Server.attach(near, :mag1, :camera)
        receive do: ({:world, ^server, {:ground, _ground}} -> Server.next(server, :mag1))
        receive do: ({:world, ^server, {:view, _moving}} -> send(me, :seen))
        receive do: (:never -> :ok)
      end)

    assert_receive :seen
    assert Process.alive?(camera)

    driver =
      spawn(fn ->
        {:ok, line} = Server.attach(near, :mag1, :drive)
        drive(line)
      end)

    eventually(fn -> speed(context.far) != {0.0, 0.0} end)
    Process.exit(driver, :kill)
    eventually(fn -> speed(context.far) == {0.0, 0.0} end)
  end

  defp drive({server, _monitor} = line) do
    Server.drive(server, :mag1, Twist.new(0.2, 0.0))
    receive(do: (:never -> :ok), after: (20 -> drive(line)))
  end

  test "a world that has ended is one that is not there, until the next one comes", context do
    near = make_ref()
    start_supervised!(Line.robot(context.path, near), id: :near)
    assert {:ok, {server, monitor}} = attach(near, :ptz)
    world = Server.world(World.Directory.find(context.far))
    :ok = stop_supervised(:world)
    assert_receive {:DOWN, ^monitor, :process, ^server, _reason}
    :ok = stop_supervised(:far)
    eventually(fn -> Server.attach(near, :mag1, :ptz) == {:error, :no_world} end)
    start_supervised!({Server, name: context.far, world: world}, id: :world)
    start_supervised!(Line.world(context.path, context.far), id: :far)
    assert {:ok, {again, _monitor}} = attach(near, :ptz)
    assert again != server
    assert_receive {:world, ^again, {:readings, _sent_ms, [ptz: _]}}
    assert :ok = Server.detach({again, make_ref()}, :mag1, :ptz)
  end
end
