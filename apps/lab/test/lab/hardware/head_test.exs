defmodule Lab.Hardware.HeadTest do
  @moduledoc """
  Tests the driver of real camera heads with the emulated one, which was written from the fact
  sheet alone.
  """
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Hal.{Device, Pose, Profile}
  alias Sim.{Emulator, World}
  @moduletag :realtime
  @moduletag :tmp_dir

  setup %{tmp_dir: folder} = context do
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    robot = %{id: :mag1, profile: Profile.magellan(), pose: Pose.new(-2, 0)}
    world = World.new!(map: map, robots: [robot], landmark: {0.0, 0.0}, noise: :off)
    name = make_ref()
    server = start_supervised!({World.Server, name: name, world: world})
    link = Path.join(folder, "camera")
    lens = {0.1, Profile.magellan().camera.field_of_view}

    emulator =
      start_supervised!(
        {Emulator,
         core: {Sim.Emulator.ViscaCamera, [lens: lens] ++ Map.get(context, :camera, [])},
         link: link,
         body: {Sim.Device.Ptz, world: name, robot: :mag1},
         wire: Map.get(context, :wire, [])}
      )

    device =
      start_supervised!(
        {Device,
         kind: :ptz,
         driver: {Hal.Visca.Driver, port: link, lens: lens},
         sinks: [{__MODULE__, :tell, [self()]}]}
      )

    %{server: server, emulator: emulator, device: device, name: name}
  end

  @doc false
  def tell(test, reading), do: send(test, reading)

  defp body(server), do: World.Server.world(server).robots.mag1

  defp looks?(server, pan, tilt) do
    %{pan: p, tilt: t} = body(server)
    # One unit of the camera is 0.002 rad.
    abs(p - pan) < 0.003 and abs(t - tilt) < 0.003
  end

  # The newest reading.
  defp reading(last \\ nil) do
    receive do
      {:ptz, reading} -> reading(reading)
    after
      0 -> last
    end
  end

  defp told?(pan, tilt) do
    case reading() do
      %{pan: p, tilt: t} -> abs(p - pan) < 0.003 and abs(t - tilt) < 0.003
      nil -> false
    end
  end

  # What was told before, such as that no camera had answered yet, is not what comes later.
  defp online do
    assert_receive {:health, :ptz, {:online, _}}, 10_000
    assert_receive {:ptz, _}, 10_000
    forget_health()
  end

  defp forget_health do
    receive do
      {:health, :ptz, _was} -> forget_health()
    after
      0 -> :ok
    end
  end

  test "the painted picture shows where the driver was told to look, and the driver knows", %{
    server: server,
    device: device
  } do
    online()

    for {pan, tilt} <- [{0.5, 0.1}, {-1.2, -0.3}, {0.0, 0.0}] do
      Device.look(device, pan, tilt)
      eventually(fn -> looks?(server, pan, tilt) end)
      eventually(fn -> told?(pan, tilt) end)
    end
  end

  test "the head follows a moving target without waiting for its moves to end", %{
    server: server,
    device: device
  } do
    online()

    for k <- 1..40 do
      Device.look(device, 0.02 * k, 0.0)
      assert_receive {:ptz, _}
    end

    eventually(fn -> looks?(server, 0.8, 0.0) end)
  end

  @tag wire: [drop: 0.01, double: 0.005, flip: 0.005, seed: 9]
  test "with 2 % of faulty bytes it gets there all the same", %{server: server, device: device} do
    online()

    for {pan, tilt} <- [{0.5, 0.1}, {-0.7, -0.2}, {0.3, 0.2}, {0.0, 0.0}] do
      Device.look(device, pan, tilt)
      eventually(fn -> looks?(server, pan, tilt) end)
      eventually(fn -> told?(pan, tilt) end)
    end
  end

  test "unplugged while it turns, and plugged in again, it gets there", %{
    server: server,
    emulator: emulator,
    device: device
  } do
    online()
    Device.look(device, 1.5, 0.0)
    eventually(fn -> body(server).pan > 0.3 end)
    :ok = Emulator.unplug(emulator)
    assert_receive {:health, :ptz, {{:offline, _reason}, _}}, 10_000
    :ok = Emulator.plug(emulator)
    assert_receive {:health, :ptz, {:online, _}}, 20_000
    Device.look(device, -0.4, 0.1)
    eventually(fn -> looks?(server, -0.4, 0.1) end)
    eventually(fn -> told?(-0.4, 0.1) end)
  end

  test "frozen, it is offline; thawed, it is back", %{
    server: server,
    emulator: emulator,
    device: device
  } do
    online()
    :ok = Emulator.freeze(emulator)
    assert_receive {:health, :ptz, {{:offline, _reason}, _}}, 10_000
    :ok = Emulator.thaw(emulator)
    assert_receive {:health, :ptz, {:online, _}}, 20_000
    Device.look(device, 0.4, 0.1)
    eventually(fn -> looks?(server, 0.4, 0.1) end)
  end

  test "after a power cycle it looks where it was told to, without another command", %{
    server: server,
    emulator: emulator,
    device: device
  } do
    online()
    Device.look(device, 0.4, 0.1)
    eventually(fn -> looks?(server, 0.4, 0.1) end)
    :ok = Emulator.restart(emulator)
    eventually(fn -> body(server).pan < 0.35 end)
    eventually(fn -> looks?(server, 0.4, 0.1) end)
  end

  @tag camera: [power: :off, power_on_ms: 500]
  test "a camera that is switched off is switched on", %{server: server, device: device} do
    online()
    Device.look(device, -0.4, 0.1)
    eventually(fn -> looks?(server, -0.4, 0.1) end)
  end

  @tag camera: [drop: 0.2, seed: 1]
  test "with a fifth of the answers lost it gets there", %{server: server, device: device} do
    online()

    for pan <- [0.3, -0.3, 0.6] do
      Device.look(device, pan, 0.0)
      eventually(fn -> looks?(server, pan, 0.0) end)
    end
  end
end
