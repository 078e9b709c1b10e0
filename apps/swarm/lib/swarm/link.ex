defmodule Swarm.Link do
  @moduledoc """
  A robot's ear and mouth, a companion of its pilot (`Robot.Companion`).

  Ear: whatever arrives passes `Swarm.Message.check/1`; what is malformed is dropped and counted.
  Heartbeats become peers on the robot's board, everything else goes to the pilot. Mouth: what the
  mission says goes out, and five times a second a heartbeat, with what the board says of the robot.

  An e-stop spreads with the heartbeats, also one that was pressed on the robot's gate; how it
  stands is `Swarm.Brake`'s to say, which is started beside the link. When it changes, heartbeats go
  out at once and ten times a second for a second. Of two robots of one name the later one leaves the
  directory, stops and falls silent, with the event `[:swarm, :link, :duplicate_id]`.

  What people ask is answered by `Swarm.Link.Desk`, if it is not too old (`Swarm.Stamp`); what is
  heard is judged by `Swarm.Link.Ear`; `Swarm.Link.Flood` keeps the mailbox short.

  `join/2` makes a config with a link. Its options:

    * `:transport` - `{m, f, a}`; a message goes to `apply(m, f, a ++ [from, ids, message])`, and
      arrives by `hear/2`. Default: `Swarm.Transport.transmit/3`
    * `:boot` - a number that grows with every start; default the time of day
  """
  use GenServer
  alias Hal.Event
  alias Robot.{Board, Config, Names, Pilot}
  alias Swarm.{Brake, Directory, Message, Peers, Post, Shape, Stamp, Stop}
  alias Swarm.Link.{Beat, Desk, Ear, Flood, Presence}

  @behaviour Robot.Companion

  @tick_ms 100
  @beat_every 2
  @rivals_every 10
  @urgent_ticks 10
  @look_every 64

  @doc "The config of a robot that talks: with a link, which its mission speaks through, and a brake."
  @spec join(Config.t(), keyword()) :: Config.t()
  def join(%Config{} = config, options \\ []) do
    options = Keyword.validate!(options, [:boot, transport: {Swarm.Transport, :transmit, []}])
    # The brake first: whoever is listed later falls with those before, never takes them along.
    companions = config.companions ++ [{Brake, []}, {__MODULE__, options}]
    %{config | send: {__MODULE__, :say, [config.id]}, companions: companions}
  end

  @impl Robot.Companion
  def child_spec({config, options}),
    do: %{id: __MODULE__, start: {__MODULE__, :start_link, [config, options]}}

  @doc "Starts the link of a robot, as its supervisor does."
  @spec start_link(Config.t(), keyword()) :: GenServer.on_start()
  def start_link(%Config{} = config, options) do
    GenServer.start_link(__MODULE__, {config, options},
      name: Names.via(config.id, :link),
      spawn_opt: [message_queue_data: :off_heap]
    )
  end

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

  @doc "A heartbeat of a robot of this one's name came from another node, from that life of it."
  @spec rival(robot :: atom(), Presence.identity()) :: :ok
  def rival(robot, {_boot, _node} = other),
    do: GenServer.cast(Names.via(robot, :link), {:rival, other, nil})

  @impl GenServer
  def init({%Config{id: id} = config, options}) do
    board = Board.find!(id)
    boot = options[:boot] || System.system_time(:millisecond)

    s = %{
      config: config,
      id: id,
      board: board,
      transport: options[:transport] || {Swarm.Transport, :transmit, []},
      ear: Ear.new(id, written(board)),
      stamps: Stamp.new(boot),
      presence: Presence.new([:robots, {:robot, id}]),
      gone: MapSet.new(),
      ticks: 0,
      urgent: 0,
      sent: 0,
      unseen: 0,
      next: System.monotonic_time(:millisecond)
    }

    Brake.present(id, true)
    {:ok, schedule(s), {:continue, :enter}}
  end

  @impl GenServer
  def handle_continue(:enter, s), do: {:noreply, enter(s)}

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
    {:noreply, s |> stop(ear, term) |> heard(heard, at_ms) |> relieve()}
  end

  def handle_cast({:command, request, ref}, s) when is_reference(ref),
    do: {:noreply, command(s, request, ref, nil)}

  def handle_cast({:command, request, ref, stamp}, s) when is_reference(ref),
    do: {:noreply, command(s, request, ref, stamp)}

  def handle_cast({:stamp, ref}, s) when is_reference(ref) do
    {stamp, stamps} = Stamp.issue(s.stamps, Config.now(s.config))
    Post.answer(ref, stamp)
    {:noreply, %{s | stamps: stamps}}
  end

  def handle_cast(:stop, s), do: {:noreply, latch(s, written(s.board))}

  def handle_cast({:rejected, why}, s) when is_atom(why),
    do: {:noreply, %{s | ear: Ear.reject(s.ear, why)}}

  def handle_cast({:rival, {boot, node} = other, link}, s)
      when is_integer(boot) and is_atom(node) and (is_pid(link) or link == nil),
      do: {:noreply, rival(s, other, link)}

  def handle_cast(_unknown, s), do: {:noreply, reject(s)}

  @impl GenServer
  def handle_info(:tick, s), do: {:noreply, s |> tick(Config.now(s.config)) |> schedule()}
  def handle_info(:enter, s), do: {:noreply, enter(s)}

  def handle_info({:DOWN, ref, :process, _scope, _reason}, s) do
    case Presence.down(s.presence, ref) do
      {:ok, presence} -> {:noreply, %{s | presence: presence}}
      :error -> {:noreply, reject(s)}
    end
  end

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

  defp heard(s, :nothing, _at_ms), do: s

  defp tick(s, at_ms) do
    s = grow_old(follow(%{s | ticks: s.ticks + 1}), at_ms)
    count(s, at_ms)
    if rem(s.ticks, @rivals_every) == 0, do: challenge(s)
    s = if s.urgent > 0 or rem(s.ticks, @beat_every) == 1, do: beat(s, at_ms), else: s
    %{s | urgent: max(s.urgent - 1, 0)}
  end

  # Of a robot that is gone nothing arrives, so somebody has to write down that it is.
  defp grow_old(s, at_ms) do
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

  defp beat(s, at_ms) do
    sequence = Stamp.last(s.stamps) + 1

    case Beat.message(s.config, s.board, s.ear, {s.stamps.boot, sequence}, at_ms) do
      {:ok, message} ->
        s = %{s | stamps: Stamp.sent(s.stamps, sequence, at_ms)}
        speak(s, List.delete(Directory.robots(), s.id), message)

      :error ->
        s
    end
  end

  defp speak(%{presence: %{left?: true}} = s, _ids, _message), do: s

  defp speak(s, ids, message) do
    {m, f, a} = s.transport
    apply(m, f, a ++ [s.id, ids, message])
    %{s | sent: s.sent + length(ids)}
  end

  defp addressed(:all), do: Directory.robots()
  defp addressed(ids) when is_list(ids), do: ids
  defp addressed(id), do: [id]

  defp command(s, request, ref, stamp) do
    case age(s, request, ref, stamp) do
      :ok ->
        # Who knows no better way than the link finds the brake through it.
        if Brake.takes?(request),
          do: Brake.take(s.id, request, ref),
          else: Post.answer(ref, Desk.answer(request, s.config, s.board, s.ear))

        s

      {:error, age} ->
        Post.answer(ref, Stamp.refusal(s.id, age))
        %{s | ear: Ear.reject(s.ear, :too_old)}
    end
  end

  # What was said on this node was not queued on the way.
  defp age(s, request, ref, stamp) do
    if Stamp.needed?(request) and node(ref) != node(),
      do: Stamp.check(s.stamps, stamp, Config.now(s.config)),
      else: :ok
  end

  # The brake knows best; it is only asked where a heartbeat seems to change something.
  defp stop(%{ear: %{stop: stop}} = s, %{stop: stop} = ear, _term), do: %{s | ear: ear}

  defp stop(s, ear, %Message{body: beat}),
    do: latch(%{s | ear: %{ear | stop: s.ear.stop}}, Brake.beat(s.id, beat.estop, beat.latched))

  defp follow(s) do
    if Board.latched?(s.board) == s.ear.stop.latched?,
      do: s,
      else: latch(s, Brake.follow(s.id))
  end

  defp latch(%{ear: ear} = s, stop) do
    changed? = stop.latched? != ear.stop.latched?
    s = %{s | ear: %{ear | stop: stop}}
    if changed? and s.config.pace != :manual, do: urgent(s), else: s
  end

  defp urgent(s), do: beat(%{s | urgent: @urgent_ticks}, Config.now(s.config))

  defp written(board) do
    case Board.fetch(board, :estop, :infinity) do
      {:ok, stop, _at_ms} -> stop
      :error -> Stop.new(Board.latched?(board))
    end
  end

  defp enter(s) do
    {in?, presence} = Presence.enter(s.presence)
    if in?, do: challenge(s)
    %{s | presence: presence}
  end

  # Two robots of one name: both tell each other who they are, and the later one gives way.
  defp challenge(%{presence: %{left?: true}}), do: :ok

  defp challenge(s) do
    for link <- Directory.members({:robot, s.id}),
        link != self(),
        do: Post.cast(link, {:rival, {s.stamps.boot, node()}, self()})
  end

  defp rival(%{presence: %{left?: true}} = s, _other, _link), do: s

  # By radio a robot may hear itself; a link that is another one on this node is in the directory.
  defp rival(s, {_boot, node}, nil) when node == node(), do: s

  defp rival(s, other, link) do
    mine = {s.stamps.boot, node()}

    case Presence.judge(mine, other) do
      :give_way ->
        presence = Presence.leave(s.presence)
        Brake.present(s.id, false)
        Pilot.stop(s.id)
        about = %{robot: s.id, other: elem(other, 1)}
        Event.execute([:swarm, :link, :duplicate_id], %{}, about)
        %{s | presence: presence}

      :stay ->
        if link, do: Post.cast(link, {:rival, mine, self()})
        s

      :same ->
        s
    end
  end

  defp count(s, at_ms) do
    counts = %{sent: s.sent, heard: s.ear.heard, rejected: s.ear.rejected}
    Board.put(s.board, :link, :radio, counts, at_ms)
  end

  defp reject(s), do: relieve(%{s | ear: Ear.reject(s.ear, :not_a_message)})

  defp relieve(%{unseen: unseen} = s) when unseen < @look_every, do: %{s | unseen: unseen + 1}

  defp relieve(s) do
    case Flood.relieve() do
      0 -> %{s | unseen: 0}
      dropped -> %{s | unseen: 0, ear: Ear.reject(s.ear, :flooded, dropped)}
    end
  end

  defp schedule(%{config: %{pace: :manual}} = s), do: s

  defp schedule(s) do
    next = max(s.next + @tick_ms, System.monotonic_time(:millisecond))
    Process.send_after(self(), :tick, next, abs: true)
    %{s | next: next}
  end
end
