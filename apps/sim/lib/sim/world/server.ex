defmodule Sim.World.Server do
  @moduledoc """
  Runs a world in real time, in steps of 50 ms. Simulated devices attach to it; it sends them their readings, and
  carries out their requests. It does not know processes of robots, only devices.

  After each step a drive and a pan-tilt unit get their readings, and a lidar what it saw in its turn; after every second step a camera
  that has asked gets what moves, and paints its picture itself on the static ground that it got
  when it attached (`Sim.World.CameraView`). A message to a device is `{:world, server, what}`
  with `{:readings, sent_ms, list}`, `{:ground, ground}`, `{:view, moving}` or
  `{:error, :unknown_robot}`.

  Devices may be on other nodes. The server never waits for a device once it is attached: what
  cannot be sent at once is lost, and what arrives late counts as old (`Sim.Lateness`).

  Wheels stop when the process of their drive ends, and also when no speed has come for 200 ms: a
  robot that is frozen can send nothing any more, and on a real one the port program of the serial line, whose
  keep-alive this is, writes its last words then. (If only the gate of a real robot hangs, its driver goes on for 500 ms
  until the watchdog of its device; here it stands sooner.)

  Steps are scheduled at absolute times, so the pace does not drift. A late step is not made up
  for: then the world is slow, and reports it by the event `[:sim, :server, :late]` with
  `late_ms`.
  """
  use GenServer
  alias Hal.{Event, Pose, Ticker, Twist}
  alias Sim.World
  alias Sim.World.CameraView

  @step_ms 50
  @late_ms 50
  @watchdog_steps 4

  @enforce_keys [:name, :world, :ticker]
  defstruct @enforce_keys ++
              [devices: %{}, owners: %{}, driven: %{}, asked: MapSet.new()]

  @type kind :: :drive | :ptz | :scan | :camera
  @type change ::
          {:kill, robot :: atom()}
          | {:displace, robot :: atom(), Pose.t()}
          | {:place, object :: String.t(), Pose.t()}
          | {:move, Pose.point() | nil}

  @doc "Starts a world's server. Options: `name` (any term), `world` (`Sim.World`)."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options) do
    options = Keyword.validate!(options, [:name, :world])
    GenServer.start_link(__MODULE__, {options[:name], options[:world]})
  end

  @doc """
  Attaches the calling process to a robot's body in a world, as its drive, pan-tilt unit, lidar or
  camera, in place of the previous one. The calling process monitors the server; returns the
  reference of that monitor.
  """
  @spec attach(name :: term(), robot :: atom(), kind()) ::
          {:ok, {pid(), reference()}} | {:error, :no_world}
  def attach(name, robot, kind) do
    case World.Directory.find(name) do
      nil ->
        {:error, :no_world}

      server ->
        post(server, {:attach, robot, kind, self()})
        {:ok, {server, Process.monitor(server)}}
    end
  end

  @doc "Detaches the calling process."
  @spec detach({pid(), reference()}, robot :: atom(), kind()) :: :ok
  def detach({server, monitor}, robot, kind) do
    Process.demonitor(monitor, [:flush])
    post(server, {:detach, robot, kind, self()})
  end

  @doc "Sets the wanted speed of a robot's wheels."
  @spec drive(pid(), robot :: atom(), Twist.t()) :: :ok
  def drive(server, robot, twist), do: post(server, {:drive, robot, twist})

  @doc "Sets where a robot's camera should look."
  @spec look(pid(), robot :: atom(), float(), float()) :: :ok
  def look(server, robot, pan, tilt), do: post(server, {:look, robot, pan, tilt})

  @doc "Sets the field of view of a robot's camera, in radians."
  @spec zoom(pid(), robot :: atom(), float()) :: :ok
  def zoom(server, robot, angle), do: post(server, {:zoom, robot, angle})

  @doc "Asks for the next view for the attached camera."
  @spec next(pid(), robot :: atom()) :: :ok
  def next(server, robot), do: post(server, {:next, robot})

  @doc "The current world."
  @spec world(GenServer.server()) :: World.t()
  def world(server), do: GenServer.call(server, :world)

  @doc """
  Applies an intervention to a world, without waiting for its server, which may be on another
  node.
  """
  @spec change(pid(), change()) :: :ok
  def change(server, change), do: post(server, {:change, change})

  @doc """
  Applies an intervention to a world as a value: a robot's body stops for ever, or is lifted to
  another pose; the landmark glides to a place, or `nil` removes it.
  """
  @spec changed(World.t(), change()) :: World.t()
  def changed(world, {:kill, robot}), do: World.kill(world, robot)
  def changed(world, {:displace, robot, pose}), do: World.displace(world, robot, pose)
  # Where a robot has driven since, it stays where it was.
  def changed(world, {:place, object, pose}) do
    case World.Pushing.place(world, object, pose) do
      {:ok, world} -> world
      {:error, _line} -> world
    end
  end

  def changed(world, {:move, nil}), do: World.place_landmark(world, nil)
  def changed(world, {:move, place}), do: World.move_landmark(world, place)

  @impl GenServer
  def init({name, %World{} = world}) do
    # Time does not wait for the devices.
    Process.flag(:priority, :high)
    :ok = World.Directory.enter(name, self())
    ticker = Ticker.start(:step, @step_ms, @step_ms)
    # No robot drives its wheels yet, whatever a world that goes on was told last.
    world = Enum.reduce(world.order, world, &stand(&2, &1))
    {:ok, %__MODULE__{name: name, world: world, ticker: ticker}}
  end

  @impl GenServer
  def handle_call(:world, _from, s), do: {:reply, s.world, s}

  @impl GenServer
  def handle_cast({:attach, robot, kind, pid}, s) do
    if is_map_key(s.world.robots, robot) do
      s = disown(s, {robot, kind, pid})
      owners = Map.put(s.owners, Process.monitor(pid), {robot, kind, pid})
      if kind == :camera, do: hand(pid, {:ground, CameraView.ground(s.world, robot)})
      {:noreply, %{s | devices: Map.put(s.devices, {robot, kind}, pid), owners: owners}}
    else
      hand(pid, {:error, :unknown_robot})
      {:noreply, s}
    end
  end

  def handle_cast({:detach, robot, kind, pid}, s),
    do: {:noreply, s |> disown({robot, kind, pid}) |> release(robot, kind, pid)}

  def handle_cast({:drive, robot, twist}, s) do
    world = World.drive(s.world, robot, twist)
    {:noreply, %{s | world: world, driven: Map.put(s.driven, robot, world.step)}}
  end

  def handle_cast({:change, change}, s), do: {:noreply, %{s | world: changed(s.world, change)}}

  def handle_cast({:look, robot, pan, tilt}, s),
    do: {:noreply, %{s | world: World.look(s.world, robot, pan, tilt)}}

  def handle_cast({:zoom, robot, angle}, s),
    do: {:noreply, %{s | world: World.zoom(s.world, robot, angle)}}

  def handle_cast({:next, robot}, s), do: {:noreply, %{s | asked: MapSet.put(s.asked, robot)}}

  @impl GenServer
  def handle_info(:step, s) do
    begun = System.monotonic_time(:microsecond)
    s = watch(s)
    s = %{s | world: World.step(s.world, @step_ms)}
    tell(s)
    s = show(s)
    {:noreply, s |> note(begun) |> schedule()}
  end

  def handle_info({:DOWN, monitor, :process, _pid, _reason}, s) do
    case Map.pop(s.owners, monitor) do
      {{robot, kind, pid}, owners} ->
        {:noreply, release(%{s | owners: owners}, robot, kind, pid)}

      {nil, _owners} ->
        {:noreply, s}
    end
  end

  # Counted in steps of the world: on a busy machine everything is slow together.
  defp watch(%{world: %{step: step}} = s) do
    silent = for {id, at} <- s.driven, step - at >= @watchdog_steps, do: id
    world = Enum.reduce(silent, s.world, &stand(&2, &1))
    %{s | world: world, driven: Map.drop(s.driven, silent)}
  end

  defp stand(world, id), do: World.drive(world, id, Twist.zero())

  # A device that fails attaches again and again from the same process.
  defp disown(s, owner) do
    monitors = for {monitor, ^owner} <- s.owners, do: monitor
    Enum.each(monitors, &Process.demonitor(&1, [:flush]))
    %{s | owners: Map.drop(s.owners, monitors)}
  end

  # Another process may have attached meanwhile.
  defp release(s, robot, kind, pid) do
    case s.devices do
      %{{^robot, ^kind} => ^pid} ->
        world = if kind == :drive, do: stand(s.world, robot), else: s.world
        %{s | world: world, devices: Map.delete(s.devices, {robot, kind})}

      _another ->
        s
    end
  end

  defp tell(%{devices: devices, world: world}) do
    for id <- world.order do
      readings = world |> World.readings(id) |> Enum.group_by(&device/1)

      for kind <- [:drive, :ptz, :scan],
          do: tell(devices, {id, kind}, Map.get(readings, kind, []))
    end
  end

  defp device({kind, _reading}) when kind in [:ptz, :scan], do: kind
  defp device(_reading), do: :drive

  defp tell(_devices, _device, []), do: :ok

  defp tell(devices, device, readings) do
    case devices do
      %{^device => pid} -> hand(pid, {:readings, Hal.Clock.now_ms(), readings})
      _none -> :ok
    end
  end

  # Ten pictures a second.
  defp show(%{world: %{at_ms: at_ms}} = s) when rem(at_ms, 2 * @step_ms) != 0, do: s

  defp show(%{world: world} = s) do
    poses = CameraView.poses(world)

    told =
      for id <- s.asked, pid = s.devices[{id, :camera}] do
        alive? = World.alive?(world, id)
        if not alive? or hand(pid, {:view, CameraView.moving(world, poses, id)}) == :ok, do: id
      end

    %{s | asked: MapSet.difference(s.asked, MapSet.new(told))}
  end

  # Without these options, a send waits while the buffer is full, or dials a node that is gone.
  defp hand(pid, what) do
    :erlang.send(pid, {:world, self(), what}, [:nosuspend, :noconnect])
  end

  defp post(server, request) do
    :erlang.send(server, {:"$gen_cast", request}, [:nosuspend, :noconnect])
    :ok
  end

  defp note(s, begun) do
    late_ms = div(begun, 1_000) - s.ticker.due_ms
    about = %{world: s.name}
    if late_ms > @late_ms, do: Event.execute([:sim, :server, :late], %{late_ms: late_ms}, about)
    s
  end

  defp schedule(s), do: %{s | ticker: Ticker.next(s.ticker)}
end
