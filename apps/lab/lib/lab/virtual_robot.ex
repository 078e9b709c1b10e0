defmodule Lab.VirtualRobot do
  @moduledoc "Configures and starts one robot of a simulated fleet on this node, and reads its claims."
  alias Robot.Board
  alias Robot.Control.Pilot
  alias Lab.VirtualRobot.Hardware
  alias Sim.World
  alias Robot.Mission.{Claim, Manual}
  alias Swarm.EStop

  @armed_ms 5_000
  @look_ms 10
  # What it does is told ten times a second.
  @recent_ms 1_000
  @devices [:camera, :drive, :ptz, :scan]

  @typedoc """
  What all robots of a fleet have in common: the name of their world, their clock and radio, the
  kind of blobs, the marks that they look for, their mission, the walls that they know, the trace of inputs and outputs (`{m, f, a}`, called with the id
  first), and the run's folder, which holds the serial
  lines of robots with real drivers.
  """
  @type common :: %{
          world: term(),
          clock: Robot.Config.call(),
          transport: Robot.Config.call(),
          blobs: :painted | :direct,
          marks: keyword() | nil,
          mission: Robot.Config.module_options(),
          plan: Elixir.Nav.Grid.t() | Elixir.Nav.OccupancyGrid.t() | nil,
          trace: Robot.Config.call() | nil,
          folder: Path.t() | nil
        }

  @doc "Starts a robot of `Lab.Trial.Setup` in a `Robot.Fleet`."
  @spec start(Supervisor.supervisor(), Lab.Trial.Setup.robot(), common(), restart) :: {:ok, pid()}
        when restart: :temporary | :permanent
  def start(fleet, robot, common, restart \\ :temporary) do
    config = Swarm.Comms.join(config(robot, common), transport: common.transport)
    {:ok, _pid} = Robot.Fleet.start_robot(fleet, config, restart)
  end

  @doc "A clock for robots: milliseconds since this call."
  @spec clock() :: Robot.Config.call()
  def clock, do: {__MODULE__, :now, [Hal.Clock.now_ms()]}

  @doc "The time of such a clock."
  @spec now(integer()) :: non_neg_integer()
  def now(epoch_ms), do: Hal.Clock.now_ms() - epoch_ms

  @doc """
  Starts its mission, once its drive has armed itself; waits 5 s for that. The error says in a line why
  its wheels may not turn.
  """
  @spec begin(atom()) :: :ok | {:error, line :: String.t()}
  def begin(id) do
    :ok = await_armed([id])
    with :ok <- Pilot.start(id), do: Pilot.command(id, :start)
  end

  @doc """
  Waits until all of them are armed, 5 s at most: drives arm by themselves once they have reported, and
  till then a robot refuses what would move it.
  """
  @spec await_armed([atom()]) :: :ok
  def await_armed(ids), do: await_armed(ids, Hal.Clock.now_ms() + @armed_ms)

  defp await_armed(ids, until_ms) do
    late = Enum.reject(ids, &armed?/1)

    if late != [] and Hal.Clock.now_ms() < until_ms do
      Process.sleep(@look_ms)
      await_armed(late, until_ms)
    else
      :ok
    end
  end

  defp armed?(id) do
    with {:ok, board} <- Board.find(id),
         {:ok, %{state: :armed}, _at_ms} <- Board.fetch(board, :arming, :infinity),
         do: true,
         else: (_not_yet -> false)
  end

  @doc """
  What it claims about itself, as in lockstep, but read from its board, and, as in its heartbeats,
  without a leadership whose time is over.
  """
  @spec claim(atom()) :: map()
  def claim(id) do
    with {:ok, board} <- Board.find(id),
         {:ok, %{state: state, claim: claim, ticked_ms: ticked_ms} = mission, at_ms} <-
           Board.fetch(board, :mission, :infinity) do
      claim = timely(state, claim, Board.now(board) - (ticked_ms || at_ms))
      claim = Map.put_new_lazy(claim, :uncertainty, fn -> uncertainty(board) end)
      claim = Map.merge(claim, %{believed: believed(board), layer: mission.layer})
      claim = if Board.latched?(board), do: Map.put(claim, :estop, callers(board)), else: claim
      claim = for {key, why} <- faults(board), why != nil, into: claim, do: {key, why}

      Manual.shown(state, claim)
    else
      # Between the crash of a board and the next one.
      :error -> %{}
    end
  end

  defp timely({mission, _phase}, claim, age_ms), do: Claim.timely(mission, claim, age_ms)
  defp timely(:idle, claim, _age_ms), do: claim

  defp callers(board), do: board |> EStop.written() |> EStop.State.callers()

  # What keeps it from its work, as a status says it.
  defp faults(board) do
    crashed =
      for part <- [:pilot, :executive],
          {:ok, line, at_ms} <- [Board.fetch(board, {:crashed, part}, :infinity)],
          do: {at_ms, line}

    arming =
      with {:ok, %{state: state, why: why}, _at_ms} when state != :armed <-
             Board.fetch(board, :arming, :infinity),
           do: {if(state == :disarmed, do: :disarmed, else: :line_lost), why},
           else: (_armed_or_not_known -> nil)

    [
      crashed: with({_at_ms, line} <- Enum.max(crashed, fn -> nil end), do: line),
      arming: arming,
      fault: fault(board),
      offline: offline(board)
    ]
  end

  # An executive that is being started again stands for nothing.
  defp fault(board) do
    with {:ok, %{fault: fault}, _at_ms} <- Board.fetch(board, :doing, @recent_ms),
         do: fault,
         else: (_unknown -> nil)
  end

  defp offline(board) do
    offline =
      for device <- @devices,
          {:ok, {:offline, _reason}, _at_ms} <- [
            Board.fetch(board, {:health, device}, :infinity)
          ],
          do: device

    if offline != [], do: offline
  end

  defp believed(board) do
    with {:ok, pose, _at_ms} <- Board.fetch(board, :pose, :infinity),
         do: pose,
         else: (_unknown -> nil)
  end

  defp uncertainty(board) do
    with {:ok, %{radius: radius}, _at_ms} <- Board.fetch(board, :uncertainty, :infinity),
         do: radius,
         else: (_unknown -> nil)
  end

  defp config(%{id: id} = robot, common) do
    device = [world: common.world, robot: id]

    Robot.Config.new!(
      [
        id: id,
        profile: robot.profile,
        start: robot.start,
        clock: common.clock,
        colours: World.colours(),
        marks: robot.profile.camera && common.marks,
        mission: common.mission,
        plan: common.plan,
        replace: true,
        trace: trace(common.trace, id)
      ] ++
        camera(robot.profile, device, common) ++
        scan(robot, device, common.folder) ++ drivers(robot, device, common.folder)
    )
  end

  defp camera(%{camera: nil}, _device, _common), do: []

  defp camera(_profile, device, common),
    do: [camera: {Sim.Device.Camera, device ++ [blobs: common.blobs, clock: common.clock]}]

  defp scan(%{profile: %{scan: nil}}, _device, _folder), do: []

  defp scan(%{hardware?: true, profile: %{scan: %{model: model}}} = robot, _device, folder)
       when model != nil,
       do: Hardware.scan(robot, folder)

  defp scan(_simulated, device, _folder), do: [scan: {Sim.Device.Scan, device}]

  defp drivers(%{hardware?: true} = robot, _device, folder), do: Hardware.drivers(robot, folder)

  defp drivers(%{profile: %{camera: nil}}, device, _folder),
    do: [drive: {Sim.Device.Drive, device}]

  defp drivers(_simulated, device, _folder),
    do: [drive: {Sim.Device.Drive, device}, ptz: {Sim.Device.Ptz, device}]

  defp trace(nil, _id), do: nil
  defp trace({m, f, a}, id), do: {m, f, a ++ [id]}
end
