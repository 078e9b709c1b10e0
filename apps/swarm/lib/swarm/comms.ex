defmodule Swarm.Comms do
  @moduledoc """
  Sends and receives all messages of a robot; a companion of its pilot (`Robot.Companion`).

  In: `Swarm.Message.check/1` checks every message; malformed ones are dropped and counted.
  Heartbeats become peers on the robot's board, everything else goes to the pilot. Out: the
  mission's messages and, five times a second, a heartbeat with the robot's state from the board.

  An e-stop spreads with the heartbeats. `Swarm.EStop`, which is started beside the comms process,
  owns the state of the stop and is told of each heartbeat that differs from it. Of two robots
  with the same name, the later one (`Swarm.Comms.NameClaim`) stops and falls silent, with the
  event `[:swarm, :comms, :duplicate_id]`, as long as there is the other.

  | part | what it does |
  |---|---|
  | `Swarm.Message.Receiver` | checks and sorts incoming messages |
  | `Swarm.Comms.PeerWriter` | writes the peers to the board |
  | `Swarm.Comms.Sender` | sends messages and heartbeats |
  | `Swarm.Comms.CommandHandler` | answers people's commands that are not too old (`Swarm.Order.Freshness`), or passes them on |
  | `Swarm.Comms.LoadShedder` | keeps the mailbox short |

  `join/2` makes a config with a comms process. Its options:

    * `:transport` - `{m, f, a}`; a message goes to `apply(m, f, a ++ [from, to, message])`, with `to` a list of
      robots or, for heartbeats, `:all`, and
      arrives by `hear/2`. Default: `Swarm.Transport.transmit/3`
    * `:boot` - a number that grows with every start; by default the time of day
  """
  use GenServer
  alias Hal.{Event, Ticker}
  alias Robot.Mission.{Claim, Letter}
  alias Robot.{Board, Names}
  alias Robot.Control.Pilot
  alias Mesh.Nonblocking
  alias Swarm.{EStop, Message, Replacement}
  alias Swarm.Order.Freshness
  alias Swarm.Transport
  alias Swarm.Discovery.RobotInfo
  alias Swarm.Message.Receiver
  alias Swarm.Wire
  alias Swarm.Comms.{CommandHandler, LoadShedder, NameClaim, PeerWriter, Sender}

  @behaviour Robot.Companion

  @tick_ms 100
  @rivals_every 10
  # The number of messages that are handled between two checks of the mailbox's length.
  @look_every 64

  @doc """
  Adds to the config of a robot a comms process, through which its mission sends messages, and an
  e-stop process, which its gate notifies of its latch.
  """
  @spec join(Robot.Config.t(), keyword()) :: Robot.Config.t()
  def join(%Robot.Config{} = config, options \\ []) do
    options = Keyword.validate!(options, [:boot, transport: {Transport, :transmit, []}])
    # The e-stop process first: a companion that is listed later restarts with those before it,
    # but never restarts them.
    companions = config.companions ++ [{EStop, []}, EStop.entry(), {__MODULE__, options}]

    %{
      config
      | send: {__MODULE__, :say, [config.id]},
        companions: companions
    }
  end

  @impl Robot.Companion
  def child_spec({config, options}),
    do: %{id: __MODULE__, start: {__MODULE__, :start_link, [config, options]}}

  @doc "Starts the comms process of a robot, as its supervisor does."
  @spec start_link(Robot.Config.t(), keyword()) :: GenServer.on_start()
  def start_link(%Robot.Config{} = config, options) do
    GenServer.start_link(__MODULE__, {config, options},
      name: Names.via(config.id, :comms),
      spawn_opt: [message_queue_data: :off_heap]
    )
  end

  @doc """
  Sends a message to one robot, to several, or to all others, and returns the addressees: for
  `:all` those that are known here (`Swarm.Transport.robots/0`). It waits for nobody, and
  nobody confirms the message.
  """
  @spec say(robot :: atom(), to, Message.t() | Letter.t() | Claim.t()) :: [atom()]
        when to: atom() | [atom()] | :all
  def say(robot, to, message) do
    ids = List.delete(addressed(to), robot)
    GenServer.cast(Names.via(robot, :comms), {:say, ids, Message.of(robot, message)})
    ids
  end

  @doc "Passes on a message that arrived for a robot of this node, by any transport."
  @spec hear(robot :: atom(), term()) :: :ok
  def hear(robot, term), do: GenServer.cast(Names.via(robot, :comms), {:hear, term})

  @doc """
  Reports a heartbeat from another node of a robot with the same name, and the number of its life.
  """
  @spec rival(robot :: atom(), NameClaim.identity()) :: :ok
  def rival(robot, {_boot, _node} = other),
    do: GenServer.cast(Names.via(robot, :comms), {:rival, other, nil})

  @impl GenServer
  def init({%Robot.Config{id: id} = config, options}) do
    board = Board.find!(id)
    boot = options[:boot] || System.system_time(:millisecond)
    transport = options[:transport] || {Transport, :transmit, []}

    s = %{
      config: config,
      id: id,
      board: board,
      receiver: Receiver.new(id),
      peer_writer: PeerWriter.new(board),
      sender: Sender.new(config, board, transport, boot),
      name: NameClaim.new(id, {boot, node()}),
      unseen: 0,
      noted: nil,
      ticker: Robot.Config.ticker(config, :tick, @tick_ms)
    }

    EStop.present(id, true)
    Replacement.present(config, board)
    {:ok, s, {:continue, :enter}}
  end

  @impl GenServer
  def handle_continue(:enter, s), do: {:noreply, %{s | name: NameClaim.enter(s.name)}}

  # Comms processes are found in the directory, so anything may arrive from anywhere: what would
  # crash this process is counted instead.
  @impl GenServer
  def handle_call(_unknown, _from, s), do: {:noreply, reject(s)}

  @impl GenServer
  def handle_cast({:say, ids, %Message{} = message}, s) do
    if Wire.names?(ids),
      do: {:noreply, %{s | sender: Sender.speak(s.sender, ids, message)}},
      else: {:noreply, reject(s)}
  end

  def handle_cast({:hear, term}, s) do
    at_ms = Robot.Config.now(s.config)
    {heard, receiver} = Receiver.hear(s.receiver, term, at_ms)
    {:noreply, %{s | receiver: receiver} |> heard(heard, at_ms) |> relieve()}
  end

  def handle_cast({:command, request, ref}, s) when is_reference(ref),
    do: {:noreply, command(s, request, ref, nil)}

  def handle_cast({:command, request, ref, order}, s) when is_reference(ref),
    do: {:noreply, command(s, request, ref, order)}

  def handle_cast({:stamp, ref}, s) when is_reference(ref) do
    Nonblocking.answer(ref, Freshness.stamp(s.sender.boot, now_us()))
    {:noreply, s}
  end

  def handle_cast(:stop, s), do: {:noreply, %{s | sender: Sender.urge(s.sender, s.receiver)}}

  def handle_cast({:rejected, why}, s) when is_atom(why),
    do: {:noreply, %{s | receiver: Receiver.reject(s.receiver, why)}}

  def handle_cast({:rival, {boot, node} = other, comms}, s)
      when is_integer(boot) and is_atom(node) and (is_pid(comms) or comms == nil) do
    case NameClaim.rival(s.name, other, comms, Robot.Config.now(s.config)) do
      {false, name} -> {:noreply, %{s | name: name}}
      {true, name} -> {:noreply, give_way(%{s | name: name}, node)}
    end
  end

  def handle_cast(_unknown, s), do: {:noreply, reject(s)}

  @impl GenServer
  def handle_info(:tick, s), do: {:noreply, s |> tick(Robot.Config.now(s.config)) |> schedule()}

  # The time for the drive's answer is over.
  def handle_info({:unanswered, ref, answer}, s) when is_reference(ref) do
    Nonblocking.answer(ref, answer)
    {:noreply, s}
  end

  def handle_info(message, s) do
    case NameClaim.arrived(s.name, message) do
      {:ok, name} -> {:noreply, %{s | name: name}}
      :other -> {:noreply, reject(s)}
    end
  end

  defp heard(s, {:heartbeat, id, beat}, at_ms) do
    EStop.heard(s.id, s.board, beat)
    %{s | peer_writer: PeerWriter.heard(s.peer_writer, s.receiver.peers, id, at_ms)}
  end

  defp heard(s, {:message, message}, _at_ms) do
    Pilot.hear(s.id, {:message, message})
    s
  end

  defp heard(s, :nothing, _at_ms), do: s

  defp tick(s, at_ms) do
    s = note(s)
    s = %{s | peer_writer: PeerWriter.grow_old(s.peer_writer, s.receiver.peers, at_ms)}
    counts = %{sent: s.sender.sent, heard: s.receiver.heard, rejected: s.receiver.rejected}
    Board.put(s.board, :comms, :radio, counts, at_ms)
    s = %{s | sender: Sender.tick(s.sender, s.receiver, at_ms)}
    if rem(s.sender.ticks, @rivals_every) == 0, do: rivals(s, at_ms), else: s
  end

  defp rivals(s, at_ms) do
    NameClaim.challenge(s.name)

    case NameClaim.take_back(s.name, at_ms) do
      {true, name} -> take_back(%{s | name: name})
      {false, name} -> %{s | name: name}
    end
  end

  defp note(s) do
    noted =
      if NameClaim.left?(s.name),
        do: RobotInfo.leave(s.noted, s.id),
        else: RobotInfo.note(s.noted, s.config, s.board, s.sender.boot, s.receiver)

    %{s | noted: noted}
  end

  # A sender that knows only the comms process reaches the e-stop process through it.
  defp command(s, request, ref, order) do
    here? = node(ref) == node()
    # The e-stop process itself knows what a reset is meant for.
    stopped = if EStop.takes?(request), do: nil, else: EStop.stopped(s.board)

    case Freshness.judge(s.sender.boot, request, order, here?, now_us(), stopped) do
      {:ok, asked} ->
        cond do
          EStop.takes?(request) -> EStop.take(s.id, request, {ref, asked})
          Replacement.takes?(request) -> Replacement.take(s.id, request, order, ref)
          true -> CommandHandler.take(request, {ref, asked}, s.config, s.board, s.receiver)
        end

        s

      {:error, why} ->
        Nonblocking.answer(ref, Freshness.refusal(s.id, why))
        %{s | receiver: Receiver.reject(s.receiver, :too_old)}
    end
  end

  defp now_us, do: System.monotonic_time(:microsecond)

  defp give_way(s, other) do
    EStop.present(s.id, false)
    Pilot.halt(s.id)
    Event.execute([:swarm, :comms, :duplicate_id], %{}, %{robot: s.id, other: other})
    %{s | sender: %{s.sender | silent?: true}}
  end

  # It stands until somebody gives it an order.
  defp take_back(s) do
    EStop.present(s.id, true)
    Event.execute([:swarm, :comms, :unique_id], %{}, %{robot: s.id})
    %{s | sender: %{s.sender | silent?: false}}
  end

  defp addressed(:all), do: Transport.robots()
  defp addressed(ids) when is_list(ids), do: ids
  defp addressed(id), do: [id]

  defp reject(s), do: relieve(%{s | receiver: Receiver.reject(s.receiver, :not_a_message)})

  defp relieve(%{unseen: unseen} = s) when unseen < @look_every, do: %{s | unseen: unseen + 1}

  defp relieve(s) do
    case LoadShedder.relieve([:tick | NameClaim.timers(s.name)]) do
      0 -> %{s | unseen: 0}
      dropped -> %{s | unseen: 0, receiver: Receiver.reject(s.receiver, :flooded, dropped)}
    end
  end

  defp schedule(s), do: %{s | ticker: Ticker.next(s.ticker)}
end
