defmodule Swarm.EStop do
  @moduledoc """
  Stops a robot in an emergency: a companion beside its comms process, with high priority and a mailbox of its own.
  Every stop of people and of other nodes arrives here (`:estop`, `:reset`, `:stop` and `:disarm`, calls of
  `Swarm.EStop.Broadcaster`) and goes to the gate at once, even if the comms process is flooded, hangs or is dead.

  It alone owns the state of the emergency stop (`Swarm.EStop.State`), and publishes it on the
  board under `:estop`, for all others to read. The only other copy is the gate's latch, which
  this process sets. Who stops the gate directly (`Robot.Safety.Gate.estop/1`; of ours `mix calibrate` alone) sets
  and clears it, too; the gate reports that by `:latch`, and this process follows.

  Nobody else decides, and nobody waits for this process: the comms process passes on what a
  heartbeat says if that differs from the board (`heard/3`), and is told of each change, so that
  the next heartbeats, which follow at once, spread it.

  A stop goes to gate, executive and pilot at once, so that one that hangs does not delay the
  others. The last of them, the gate, answers when the mission has ended and no older wish can
  follow (`Robot.Control.Pilot.halt/2`); if that does not happen, nobody answers. It
  is `:ok` once the base has reported since; if nothing reaches the wheels, or nobody can say whether it does, the answer
  says so, for stop, disarm and e-stop alike (`Swarm.EStop.Answer`).

  A reset first goes the same way: the gate is released once the robot's mission or order has
  ended, unless somebody stops it again meanwhile.

  A stop is obeyed however old it is; a reset from another node bears a stamp
  (`Swarm.Order.Freshness`), which is requested here.

  This module is the interface; the process is `Swarm.EStop.Server`, its actions are in
  `Swarm.EStop.Actions`.
  """
  alias Hal.HardenedServer
  alias Robot.{Board, Names}
  alias Swarm.EStop
  alias Swarm.Membership.Heartbeat

  @behaviour Robot.Companion

  @impl Robot.Companion
  def child_spec({config, options}),
    do: %{id: __MODULE__, start: {__MODULE__, :start_link, [config, options]}}

  @doc "Starts the e-stop process of a robot, as its supervisor does."
  @spec start_link(Robot.Config.t(), keyword()) :: GenServer.on_start()
  def start_link(%Robot.Config{} = config, _options) do
    HardenedServer.start_link(EStop.Server, config,
      name: Names.via(config.id, :estop),
      spawn_opt: [priority: :high, message_queue_data: :off_heap]
    )
  end

  @doc "Passes on a call to stop that came from a node by datagram, to all robots of this node."
  @spec hear(node(), term()) :: :ok
  def hear(_node, {:estop, call, age_ms} = term) do
    if EStop.Calls.call?(call) and EStop.Calls.age?(age_ms),
      do: Enum.each(Names.all(:estop), &GenServer.cast(&1, term))

    :ok
  end

  def hear(_node, _malformed), do: :ok

  @doc """
  Handles a heartbeat that the robot with this board heard. It goes to the e-stop process if it
  would change the state of the stop; otherwise it is dropped in the caller.
  """
  @spec heard(robot :: atom(), Board.t(), Heartbeat.t()) :: :ok
  def heard(_robot, _board, %Heartbeat{estop: []}), do: :ok

  def heard(robot, board, %Heartbeat{estop: tags}) do
    stop = written(board)

    if EStop.State.hear(stop, tags) != stop,
      do: GenServer.cast(Names.via(robot, :estop), {:beat, tags})

    :ok
  end

  @doc """
  When the robot was last stopped, by any kind of stop (`System.monotonic_time/1`, microseconds);
  `nil` if never.
  """
  @spec stopped(Board.t()) :: integer() | nil
  def stopped(board) do
    with {:ok, at, _at_ms} <- Board.fetch(board, :stopped, :infinity),
         do: at,
         else: (:error -> nil)
  end

  @doc """
  The state of the stop that the e-stop process published.
  """
  @spec written(Board.t()) :: EStop.State.t()
  defdelegate written(board), to: EStop.Actions

  @doc "Whether a request is for the e-stop process; all others are for the comms process."
  @spec takes?(request :: term()) :: boolean()
  def takes?({:estop, _call}), do: true
  def takes?(request), do: request in [:stop, :disarm, :estop, :reset]

  @doc """
  Passes a request to the e-stop process from the robot's comms process, which has determined when
  it was given (`Swarm.Order.Freshness`).
  """
  @spec take(robot :: atom(), request :: term(), {reference(), given_us :: integer()}) :: :ok
  def take(robot, request, {ref, given_us}),
    do: GenServer.cast(Names.via(robot, :estop), {:in_time, request, ref, given_us})

  @doc """
  Says whether the robot takes commands under its name, or no longer does because another of that
  name was first.
  """
  @spec present(robot :: atom(), boolean()) :: :ok
  def present(robot, present?),
    do: GenServer.cast(Names.via(robot, :estop), {:present, present?})
end
