defmodule Lab.VmRobots do
  @moduledoc """
  Robots on real drivers in a VM of their own, to be frozen; their bases, which are emulated, and the world stay in
  the VM of the test, and hear what comes on the lines meanwhile.
  """
  import ExUnit.Callbacks
  import Swarm.Case, only: [eventually: 1]
  alias Hal.{Pose, Profile}
  alias Sim.{Emulator, HeardController, World}

  @conversions [distance: 31_387.0, angle: 4654.2, range: 1474.0, ir_a: 4000.0, ir_b: -2.0]

  @doc "A VM with one robot of each of these: `[{id, arm: :manual or :auto}]`; `folder` gets the links of their lines."
  def start(robots, folder) do
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    ids = Keyword.keys(robots)

    bodies =
      for {id, n} <- Enum.with_index(ids),
          do: %{
            id: id,
            profile: Profile.magellan(),
            pose: Pose.new(-4, 2 - 2 * n),
            infrared: true
          }

    world = make_ref()
    settings = [name: world, world: World.new!(map: map, robots: bodies, noise: :off)]
    server = start_supervised!({World.Server, settings}, id: world)

    bases =
      for id <- ids, into: %{} do
        link = Path.join(folder, "#{id}.base")
        body = {Sim.Device.Drive, world: world, robot: id}
        settings = [core: {HeardController, []}, link: link, body: body]
        {id, start_supervised!({Emulator, settings}, id: {Emulator, id})}
      end

    vm = Vm.start_one()
    # Whatever becomes of the test.
    on_exit(fn -> Vm.signal(vm, "KILL") end)
    :ok = Vm.start_apps(vm, [:swarm], logger: [level: :none], swarm: [mesh: false])
    robots = %{vm: vm, server: server, bases: bases, folder: folder, arms: Map.new(robots)}
    for id <- ids, do: start_robot(robots, id)
    robots
  end

  @doc "Starts a robot there."
  def start_robot(%{vm: vm, folder: folder, arms: arms}, id) do
    driver = {Hal.RFlex.Driver, port: Path.join(folder, "#{id}.base"), conversions: @conversions}
    options = [id: id, drive: driver, arm: arms[id], profile: Profile.magellan()]
    config = options |> Robot.Config.new!() |> Swarm.Comms.join([])
    {:ok, _robot} = Vm.call(vm, Robot.Fleet, :start_robot, [Robot.Fleet, config])
    :ok
  end

  @doc "What a command of `Swarm` answers in that VM."
  def swarm(%{vm: vm}, command, arguments), do: Vm.call(vm, Swarm, command, arguments, 30_000)

  @doc "A robot's status there; `nil` if it does not answer."
  def status(robots, id) do
    with {:error, _line} <- swarm(robots, :status, [id]), do: nil
  end

  @doc "Whether its body stands."
  def still?(%{server: server}, id),
    do: World.Server.world(server).robots[id].speed == {0.0, 0.0}

  @doc "When speeds other than zero came on its line since then, newest first."
  def moves(%{bases: bases}, id, since_ms),
    do: bases |> Map.fetch!(id) |> Emulator.core() |> HeardController.moves(since_ms)

  @doc "Drives it, however its wheels have come to stand, to a far place, until it rolls."
  def roll(robots, id) do
    eventually(fn ->
      with %{arming: arming, state: state} <- status(robots, id),
           do: roll(robots, id, arming, state)

      not still?(robots, id) and moves(robots, id, now_ms() - 200) != []
    end)
  end

  defp roll(robots, id, {:error, _lost}, _state), do: swarm(robots, :acknowledge, [id])
  defp roll(robots, id, :disarmed, _state), do: swarm(robots, :arm, [id])
  # To and fro, so that it always has a long way to go.
  defp roll(robots, id, :armed, state) when state in [:idle, :done, :ready],
    do: swarm(robots, :tell, [id, "goto:#{Enum.random([4, -4])}:0"])

  defp roll(_robots, _id, _arming, _under_way), do: :ok

  @doc "The process id of the port program of a robot's drive; `nil` while its line is closed."
  def port_program(%{vm: vm}, id), do: Vm.call(vm, __MODULE__, :port_program, [id])

  @doc false
  def port_program(id) do
    drive = Robot.Names.whereis(id, :drive)
    port = Enum.find(Port.list(), &(Port.info(&1, :connected) == {:connected, drive}))
    with {:os_pid, pid} <- port && Port.info(port, :os_pid), do: "#{pid}"
  end

  @doc "Sends a signal to the VM, and waits until it has come."
  def signal(%{vm: vm}, "STOP"), do: Vm.freeze(vm)
  def signal(%{vm: vm}, signal), do: Vm.signal(vm, signal)

  @doc "Checks for so many milliseconds, every 10, and returns the first that is not `nil` or `false`."
  def watch(ms, look), do: watch_until(now_ms() + ms, look)

  defp watch_until(until_ms, look) do
    cond do
      seen = look.() -> seen
      now_ms() >= until_ms -> nil
      true -> receive(do: (:never -> :ok), after: (10 -> watch_until(until_ms, look)))
    end
  end

  @doc "Waits so long."
  def pass(ms), do: receive(do: (:never -> :ok), after: (ms -> :ok))

  @doc "Now, by the clock of `moves/3`."
  def now_ms, do: Hal.Clock.now_ms()
end
