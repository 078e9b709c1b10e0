defmodule Swarm.EStop do
  @moduledoc """
  A robot's emergency stop: a companion beside its comms process, of high priority, with a mailbox of its
  own. What stops the robot comes here (`:estop`, `:reset`, `:stop` and `:disarm` of people, calls of `Swarm.EStop.Broadcaster`)
  and goes to the gate at once, also where the comms process is flooded, hangs or is dead.

  It alone decides how the emergency stop stands (`Swarm.EStop.State`), and publishes it on the board under
  `:estop`, for all others to read. The only other copy is the gate's latch, which this process sets. A button of the
  gate's own sets and clears it too; the gate says so (`latch/1`), and this process follows.

  Nobody else decides, and nobody waits for this process: the comms process hands on what a heartbeat says where that
  differs from the board (`heard/3`), and is told of each change, so that the next heartbeats, which follow at once,
  spread it.

  A stop goes to gate, executive and pilot at once, so that none that hangs holds up the others. It is
  answered by the last of them, the gate, when the mission is out of command and no older wish can follow
  (`Robot.Control.Pilot.halt/2`); where that does not come, by nobody. Where nothing reaches the wheels, the answer says so
  (`Robot.Safety.Readiness.stopped/1`), to stop, disarm and e-stop alike.

  A reset goes the same way first: the gate is released once what the robot was at has ended, and unless
  somebody stops it again meanwhile.

  A stop is obeyed however old it is; a reset that a person gave on another node bears a stamp
  (`Swarm.Commands.Freshness`), which is asked for here.

  This is its door; the process is `Swarm.EStop.Server`, what it does `Swarm.EStop.Actions`.
  """
  alias Robot.{Board, Config, Names}
  alias Swarm.EStop
  alias Swarm.Membership.Heartbeat

  @behaviour Robot.Companion

  @impl Robot.Companion
  def child_spec({config, options}),
    do: %{id: __MODULE__, start: {__MODULE__, :start_link, [config, options]}}

  @doc "Starts the e-stop process of a robot, as its supervisor does."
  @spec start_link(Config.t(), keyword()) :: GenServer.on_start()
  def start_link(%Config{} = config, _options) do
    GenServer.start_link(EStop.Server, config,
      name: Names.via(config.id, :estop),
      spawn_opt: [priority: :high, message_queue_data: :off_heap]
    )
  end

  @doc "A call to stop came from a node, by datagram: for all robots of this one."
  @spec hear(node(), term()) :: :ok
  def hear(_node, {:estop, call, age_ms} = term) do
    if EStop.Calls.call?(call) and EStop.Calls.age?(age_ms),
      do: Enum.each(Names.all(:estop), &GenServer.cast(&1, term))

    :ok
  end

  def hear(_node, _malformed), do: :ok

  @doc """
  A heartbeat was heard by the robot whose board this is. It goes to the e-stop process where it would change how the
  stop stands, and is dropped in the caller where it would not.
  """
  @spec heard(robot :: atom(), Board.t(), Heartbeat.t()) :: :ok
  def heard(robot, board, %Heartbeat{estop: number, latched: latched?}) do
    stop = written(board)

    if EStop.State.hear(stop, number, latched?) != stop,
      do: GenServer.cast(Names.via(robot, :estop), {:beat, number, latched?})

    :ok
  end

  @doc "The gate has set or cleared its latch, by whatever button; applied by the gate (`Robot.Config`, `:on_latch`)."
  @spec latch(robot :: atom()) :: :ok
  def latch(robot), do: GenServer.cast(Names.via(robot, :estop), :latch)

  @doc "When the robot was stopped last, by whatever stop (`System.monotonic_time/1`, microseconds); `nil` if never."
  @spec stopped(Board.t()) :: integer() | nil
  def stopped(board) do
    with {:ok, at, _at_ms} <- Board.fetch(board, :stopped, :infinity),
         do: at,
         else: (:error -> nil)
  end

  @doc "How the stop stands as the e-stop process published it; before the first did, by the gate's latch."
  @spec written(Board.t()) :: EStop.State.t()
  defdelegate written(board), to: EStop.Actions

  @doc "Whether a request is for the e-stop process; all others are for the comms process."
  @spec takes?(request :: term()) :: boolean()
  def takes?({:estop, _call}), do: true
  def takes?(request), do: request in [:stop, :disarm, :estop, :reset]

  @doc """
  Takes a request for the e-stop process from the robot's comms process, which has determined when it was given
  (`Swarm.Commands.Freshness`).
  """
  @spec take(robot :: atom(), request :: term(), {reference(), given_us :: integer()}) :: :ok
  def take(robot, request, {ref, given_us}),
    do: GenServer.cast(Names.via(robot, :estop), {:in_time, request, ref, given_us})

  @doc "The robot is there for commands by its name, or no longer: another of that name was first."
  @spec present(robot :: atom(), boolean()) :: :ok
  def present(robot, present?),
    do: GenServer.cast(Names.via(robot, :estop), {:present, present?})
end
