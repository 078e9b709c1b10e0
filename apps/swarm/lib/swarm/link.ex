defmodule Swarm.Link do
  @moduledoc """
  A robot's ear and mouth, a companion of its pilot (`Robot.Companion`).

  Ear: whatever arrives passes `Swarm.Message.check/1`; what is malformed is dropped and counted.
  Heartbeats become peers on the robot's board, everything else goes to the pilot. Mouth: what the
  mission says goes out, and five times a second a heartbeat, with what the board says of the robot.

  An e-stop spreads with the heartbeats (`Swarm.Stop`), also one that was pressed on the robot's
  gate. Of two robots of one name the later one leaves the directory, stops and falls silent, with
  the event `[:swarm, :link, :duplicate_id]`.

  What people ask is answered by `Swarm.Link.Desk`; what is heard is judged by `Swarm.Link.Ear`.

  `join/2` makes a config with a link. Its options:

    * `:transport` - `{m, f, a}`; a message goes to `apply(m, f, a ++ [from, ids, message])`, and
      arrives by `hear/2`. Default: straight to the links of these robots, wherever they are
    * `:boot` - a number that grows with every start; default the time of day

  Messages between nodes are sent so that nothing ever waits for a robot that has gone silent.
  """
  use GenServer
  alias Hal.Event
  alias Robot.{Board, Config, Gate, Names, Percept, Pilot}
  alias Swarm.{Directory, Heartbeat, Message, Peers, Shape, Stop}
  alias Swarm.Link.{Desk, Ear}

  @behaviour Robot.Companion

  @tick_ms 100
  @beat_every 2
  @rivals_every 10
  @odometry_ms 300
  @retry_ms 100
  @longest_retry_ms 5_000

  @doc "The config of a robot that talks: with a link, which its mission speaks through."
  @spec join(Config.t(), keyword()) :: Config.t()
  def join(%Config{} = config, options \\ []) do
    options = Keyword.validate!(options, [:boot, transport: {__MODULE__, :transmit, []}])
    companions = config.companions ++ [{__MODULE__, options}]
    %{config | send: {__MODULE__, :say, [config.id]}, companions: companions}
  end

  @impl Robot.Companion
  def child_spec({config, options}),
    do: %{id: __MODULE__, start: {__MODULE__, :start_link, [config, options]}}

  @doc "Starts the link of a robot, as its supervisor does."
  @spec start_link(Config.t(), keyword()) :: GenServer.on_start()
  def start_link(%Config{} = config, options),
    do: GenServer.start_link(__MODULE__, {config, options}, name: Names.via(config.id, :link))

  @doc """
  Says something to one robot, to several, or to all others, and returns who is addressed: of `:all`
  those that the directory knows. Nobody is waited for, and nobody says whether it was heard.
  """
  @spec say(robot :: atom(), to :: atom() | [atom()] | :all, Message.t()) :: [atom()]
  def say(robot, to, message) do
    ids = List.delete(addressed(to), robot)
    GenServer.cast(Names.via(robot, :link), {:say, ids, message})
    ids
  end

  @doc "Something arrived for a robot of this node, by whatever transport."
  @spec hear(robot :: atom(), term()) :: :ok
  def hear(robot, term), do: GenServer.cast(Names.via(robot, :link), {:hear, term})

  @doc "The transport between links: lost where a robot is not to be reached now."
  @spec transmit(from :: atom(), [atom()], Message.t()) :: :ok
  def transmit(_from, ids, message) do
    for id <- ids, link <- Directory.members({:robot, id}), do: post(link, {:hear, message})
    :ok
  end

  # Without these options a send waits for a full buffer, or dials a robot that is gone.
  defp post(link, message) do
    :erlang.send(link, {:"$gen_cast", message}, [:nosuspend, :noconnect])
    :ok
  end

  @impl GenServer
  def init({%Config{id: id} = config, options}) do
    board = Board.find!(id)

    stop =
      case Board.fetch(board, :estop, :infinity) do
        {:ok, stop, _at_ms} -> stop
        :error -> Stop.new(Board.latched?(board))
      end

    s = %{
      config: config,
      id: id,
      board: board,
      transport: options[:transport] || {__MODULE__, :transmit, []},
      boot: options[:boot] || System.system_time(:millisecond),
      ear: Ear.new(id, stop),
      gone: MapSet.new(),
      ticks: 0,
      sequence: 0,
      sent: 0,
      scope: nil,
      gave_way?: false,
      retry_ms: @retry_ms,
      next: System.monotonic_time(:millisecond)
    }

    {:ok, schedule(s), {:continue, :enter}}
  end

  @impl GenServer
  def handle_continue(:enter, s) do
    # A stop that was written down by the link before this one may not have reached the gate.
    if s.ear.stop.latched?, do: :ok = Gate.estop(s.id)
    {:noreply, enter(s)}
  end

  # Links are found in the directory, so anything may come here from anywhere: what would make this
  # process fall is counted instead.
  @impl GenServer
  def handle_call(_unknown, _from, s), do: {:noreply, reject(s)}

  @impl GenServer
  def handle_cast({:say, ids, %Message{} = message}, s) do
    if Shape.names?(ids), do: {:noreply, speak(s, ids, message)}, else: {:noreply, reject(s)}
  end

  def handle_cast({:hear, term}, s) do
    at_ms = Config.now(s.config)
    {heard, ear} = Ear.hear(s.ear, term, at_ms)
    {:noreply, s |> stop(ear) |> heard(heard, at_ms)}
  end

  def handle_cast({:command, command, reply_to}, s) when is_reference(reply_to) do
    {answer, ear} = Desk.answer(command, s.config, s.board, s.ear)
    s = stop(s, ear)
    :erlang.send(reply_to, {reply_to, answer}, [:nosuspend, :noconnect])
    {:noreply, s}
  end

  def handle_cast({:rival, {boot, node} = other, link}, s)
      when is_integer(boot) and is_atom(node) and is_pid(link),
      do: {:noreply, rival(s, other, link)}

  def handle_cast(_unknown, s), do: {:noreply, reject(s)}

  @impl GenServer
  def handle_info(:tick, s), do: {:noreply, s |> tick(Config.now(s.config)) |> schedule()}
  def handle_info(:enter, s), do: {:noreply, enter(s)}

  def handle_info({:DOWN, scope, :process, _scope, _reason}, %{scope: scope} = s),
    do: {:noreply, retry(%{s | scope: nil})}

  def handle_info(_unknown, s), do: {:noreply, reject(s)}

  # One row for each heartbeat: a hundred robots tell each other fifty thousand times a second.
  defp heard(s, {:peer, id}, at_ms) do
    show(s, id, at_ms)
    %{s | gone: MapSet.delete(s.gone, id)}
  end

  defp heard(s, {:message, message}, _at_ms) do
    Pilot.hear(s.id, {:message, message})
    s
  end

  defp heard(s, :nothing, at_ms), do: count(s, at_ms)

  defp tick(s, at_ms) do
    s =
      %{s | ticks: s.ticks + 1} |> stop(Ear.follow(s.ear, Board.latched?(s.board))) |> age(at_ms)

    count(s, at_ms)
    if rem(s.ticks, @rivals_every) == 0, do: challenge(s)
    if rem(s.ticks, @beat_every) == 1, do: beat(s, at_ms), else: s
  end

  # Of a robot that is gone nothing arrives, so somebody has to write down that it is.
  defp age(s, at_ms) do
    for id <- Peers.gone(s.ear.peers, at_ms), id not in s.gone, reduce: s do
      s ->
        show(s, id, at_ms)
        %{s | gone: MapSet.put(s.gone, id)}
    end
  end

  defp show(s, id, at_ms) do
    peer = Peers.percept(s.ear.peers, id, at_ms)
    Board.put(s.board, :link, {:peer, id}, peer, peer.at_ms)
  end

  # A robot that has no pose yet has nothing to say; one whose executive fell stands where it was.
  defp beat(s, at_ms) do
    case Board.fetch(s.board, :pose, :infinity, at_ms) do
      {:ok, pose, _then} ->
        percept = %Percept{
          robot: s.id,
          at_ms: at_ms,
          profile: s.config.profile,
          pose: pose,
          odometry: odometry(s.board, at_ms)
        }

        sender = {s.boot, s.sequence + 1}
        heard = Peers.heard(s.ear.peers, at_ms)
        beat = Heartbeat.new(sender, percept, claim(s.board), heard, s.ear.stop)
        message = Message.new(s.id, :heartbeat, beat)
        speak(%{s | sequence: s.sequence + 1}, List.delete(Directory.robots(), s.id), message)

      :error ->
        s
    end
  end

  defp odometry(board, at_ms) do
    case Board.fetch(board, :odometry, @odometry_ms, at_ms) do
      {:ok, odometry, _then} -> odometry
      :error -> nil
    end
  end

  defp claim(board) do
    case Board.fetch(board, :mission, :infinity) do
      {:ok, %{state: :idle}, _at_ms} -> %{standing: true}
      {:ok, %{claim: claim}, _at_ms} -> claim
      :error -> %{}
    end
  end

  defp speak(%{gave_way?: true} = s, _ids, _message), do: s

  defp speak(s, ids, message) do
    {m, f, a} = s.transport
    apply(m, f, a ++ [s.id, ids, message])
    %{s | sent: s.sent + length(ids)}
  end

  defp addressed(:all), do: Directory.robots()
  defp addressed(ids) when is_list(ids), do: ids
  defp addressed(id), do: [id]

  # Written down before the gate is told: a link that restarts in between knows that there is a
  # stop to spread.
  defp stop(%{ear: %{stop: stop}} = s, %{stop: stop} = ear), do: %{s | ear: ear}

  defp stop(s, ear) do
    Board.put(s.board, :link, :estop, ear.stop, Config.now(s.config))

    # The mission ends with it: after the reset nothing moves until somebody says so.
    if ear.stop.latched? and not Board.latched?(s.board) do
      :ok = Gate.estop(s.id)
      :ok = Pilot.hear(s.id, {:command, :stop})
    end

    %{s | ear: ear}
  end

  defp groups(s), do: [:robots, {:robot, s.id}]

  defp enter(%{gave_way?: true} = s), do: s

  defp enter(s) do
    scope = Directory.monitor()

    case Directory.enter(self(), groups(s)) do
      :ok ->
        challenge(s)
        %{s | scope: scope, retry_ms: @retry_ms}

      {:error, :down} ->
        Process.demonitor(scope, [:flush])
        retry(s)
    end
  end

  defp retry(s) do
    Process.send_after(self(), :enter, s.retry_ms)
    %{s | retry_ms: min(2 * s.retry_ms, @longest_retry_ms)}
  end

  # Two robots of one name: both tell each other who they are, and the later one gives way.
  defp challenge(s) do
    for link <- Directory.members({:robot, s.id}),
        link != self(),
        not s.gave_way?,
        do: post(link, {:rival, {s.boot, node()}, self()})
  end

  defp rival(s, other, link) do
    mine = {s.boot, node()}

    cond do
      mine > other ->
        Directory.leave(self(), groups(s))
        Pilot.stop(s.id)
        Event.execute([:swarm, :link, :duplicate_id], %{}, %{robot: s.id, other: node(link)})
        %{s | gave_way?: true}

      mine < other ->
        post(link, {:rival, mine, self()})
        s

      true ->
        s
    end
  end

  defp count(s, at_ms) do
    counts = %{sent: s.sent, heard: s.ear.heard, rejected: s.ear.rejected}
    Board.put(s.board, :link, :radio, counts, at_ms)
    s
  end

  defp reject(s), do: count(%{s | ear: Ear.reject(s.ear, :not_a_message)}, Config.now(s.config))

  defp schedule(%{config: %{pace: :manual}} = s), do: s

  defp schedule(s) do
    next = max(s.next + @tick_ms, System.monotonic_time(:millisecond))
    Process.send_after(self(), :tick, next, abs: true)
    %{s | next: next}
  end
end
