defmodule Swarm.Comms do
  @moduledoc """
  Sends and receives all messages of a robot: a role (`Robot.Role`) and a companion (`Robot.Companion`).

  In: `Swarm.Message.check/1` checks every message at the door (`arrive/3`); malformed ones are dropped and counted.
  Heartbeats become peers on the robot's board, everything else goes to the pilot. Out: the
  mission's messages, what is forwarded (`Swarm.Message.Forwarder`) and, five times a second, a heartbeat with the robot's state from the board; when the emergency
  stop changes, one at once and then ten a second for a second, so that the change spreads within 200 ms.

  An e-stop spreads with the heartbeats. `Swarm.EStop`, which is started before this role,
  owns the state of the stop and is told of each heartbeat that differs from it. Of two robots
  with the same name, the later one (`Swarm.Comms.NameClaim`) stops and falls silent, with the
  event `[:swarm, :comms, :duplicate_id]`, as long as there is the other.

  | input | from |
  |---|---|
  | `{:hear, term}` | another robot, by any transport |
  | `{:say, to, message}` | the mission: for a robot, several, or `:all` |
  | `{:command, request, ref, order, giver}` | a person (`Swarm.Comms.CommandHandler`), with the stamp of the order (`Swarm.Order.Freshness`) and its giver (`Swarm.Order.Giver`) |
  | `{:stamp, ref}` | a sender on another node that will send an order |
  | `{:result, {:delivered, command, ref, giver}, outcome}` | pilot or executive, which an order has reached |
  | `{:ordered, request, giver}` | the e-stop and the drive's device, which obey an order: it is told (`[:swarm, :comms, :ordered]`) |
  | `{:rival, identity, comms}` | another robot of this name |
  | `:stop` | the e-stop, which has changed |
  | `{:tick, seen}` | ten times a second, with what the process sees beside the board (`perceive/3`), among it the base's own joystick, whose word is an order of a person (`Swarm.Comms.Joystick`) |

  `join/2` makes a config with this role. Its options:

    * `:transport` - `{m, f, a}`; a message goes to `apply(m, f, a ++ [from, to, message])`, with `to` a list of
      robots or `:all`, and arrives by `hear/2`. Default: `Swarm.Transport.transmit/3`
    * `:boot` - a number that grows with every start; by default the time of day
  """
  alias Robot.{Board, Host, Names, Role}
  alias Robot.Mission.{Claim, Letter}
  alias Swarm.{Blackboard, Directory, EStop, Message, Order, Replacement, Transport, Wire}
  alias Swarm.Comms.{CommandHandler, Joystick, NameClaim, OwnHeartbeat}
  alias Swarm.Discovery.RobotInfo
  alias Swarm.Membership.{Heartbeat, Peers}
  alias Swarm.Message.{Checked, Receiver}
  alias Swarm.Order.{Freshness, Giver}

  @behaviour Robot.Companion
  @behaviour Robot.Role

  @tick_ms 100
  @rivals_every 10
  @urgent_ticks 10
  # Words of driving after a longer pause are told again.
  @pause_ms 2_000

  @enforce_keys [:config, :receiver, :name, :held]
  defstruct @enforce_keys ++
              [
                gone: [],
                noted: nil,
                ticks: 0,
                sequence: 0,
                beat_ms: nil,
                urgent: 0,
                sent: 0,
                joystick: %Joystick{},
                driver: {nil, 0}
              ]

  @typedoc """
  `receiver` holds what was heard; of the peers, `gone` are shown as gone. `sequence` is the number of its last heartbeat, at
  `beat_ms`; `held` is what it last sent about the emergency stop, `urgent` how many faster heartbeats are left; `noted` is
  what the blackboard has of this robot. `driver` gave the last word of driving.
  """
  @type t :: %__MODULE__{
          config: Robot.Config.t(),
          receiver: Receiver.t(),
          name: NameClaim.t(),
          held: [EStop.State.tag()],
          gone: [atom()],
          noted: RobotInfo.noted(),
          ticks: non_neg_integer(),
          sequence: non_neg_integer(),
          beat_ms: integer() | nil,
          urgent: non_neg_integer(),
          sent: non_neg_integer(),
          joystick: Joystick.t(),
          driver: {giver :: String.t() | nil, at_ms :: integer()}
        }

  @typedoc """
  What the process sees at a tick: what the blackboard should have of the robot, `nil` without one, and whether another robot
  has the name that this one gave up; and what was heard of the base's own joystick, with the time now
  (`System.monotonic_time/1`, microseconds), where it was heard of late.
  """
  @type seen :: %{
          required(:about) => RobotInfo.seen() | nil,
          required(:taken?) => boolean(),
          optional(:joystick) => {Joystick.heard(), now_us :: integer()}
        }

  @doc """
  Adds to the config of a robot this role, through which its mission sends messages, the
  e-stop, which its gate notifies of its latch, and the companions that the configuration gives each robot, of apps above this one:

      config :swarm, companions: [{Agents.Programs, battery: Agents.Battery}]
  """
  @spec join(Robot.Config.t(), keyword()) :: Robot.Config.t()
  def join(%Robot.Config{} = config, options \\ []) do
    options = Keyword.validate!(options, [:boot, transport: {Transport, :transmit, []}])

    # The e-stop first: a companion that is listed later restarts with those before it, but never restarts them.
    companions =
      config.companions ++
        [
          {EStop, []},
          EStop.entry(),
          {__MODULE__, []},
          {Directory.Entry, role: :comms, as: :robot, all: attended(config)}
        ] ++ of_build()

    %{config | transport: options[:transport], boot: options[:boot], companions: companions}
  end

  # A release may hold less than the configuration names.
  defp of_build do
    for {module, options} <- Application.get_env(:swarm, :companions, []),
        Code.ensure_loaded?(module),
        do: {module, options}
  end

  defp attended(%{presence: nil}), do: []
  defp attended(%{id: id}), do: [{:attended, id}]

  @impl Robot.Companion
  def child_spec({config, _options}), do: Host.child_spec({__MODULE__, config})

  @doc """
  Sends a message of a robot of this node to one robot, to several, or to all others (`:all`). It does not wait, and no
  robot confirms the message.
  """
  @spec say(robot :: atom(), to, Message.t() | Letter.t() | Claim.t()) :: :ok
        when to: atom() | [atom()] | :all
  def say(robot, to, message), do: GenServer.cast(Names.via(robot, :comms), {:say, to, message})

  @doc "Passes on a message that arrived for a robot of this node, by any transport."
  @spec hear(robot :: atom(), term()) :: :ok
  def hear(robot, term), do: GenServer.cast(Names.via(robot, :comms), {:hear, term})

  @doc """
  Reports a heartbeat from another node of a robot with the same name, and the number of its life.
  """
  @spec rival(robot :: atom(), NameClaim.identity()) :: :ok
  def rival(robot, {_boot, _node} = other),
    do: GenServer.cast(Names.via(robot, :comms), {:rival, other, nil})

  @impl Role
  def name, do: :comms

  @impl Role
  def period_ms, do: @tick_ms

  @impl Role
  def priority, do: :normal

  # People's orders, the mission's messages and its own timers; the rest of a flood is repeated, or junk.
  @impl Role
  def expendable?(message),
    do: not (is_tuple(message) and tuple_size(message) > 1 and elem(message, 0) in orders())

  defp orders, do: [:command, :say, :rival, :stamp, :unanswered, :result]

  @impl Role
  def init(%Robot.Config{id: id, boot: boot} = config, board, _at_ms) do
    s = %__MODULE__{
      config: config,
      receiver: Receiver.new(id),
      name: NameClaim.new(id, {boot, node()}),
      held: EStop.written(board).held
    }

    # A life before this one may have given way.
    {s, [{:apply, {EStop, :present, [id, true]}} | Replacement.present(config)]}
  end

  @doc """
  An input as it is handled: messages are checked, people's orders get the time of their arrival. What is malformed counts as
  a message that was rejected.
  """
  @impl Role
  def arrive({:cast, message}, now_us, _board), do: {:cast, whole(message, now_us)}
  def arrive(_other, _now_us, _board), do: {:cast, {:rejected, :not_a_message, 1}}

  defp whole({:hear, term}, _now_us), do: {:heard, Checked.open(term)}

  defp whole({:say, to, %kind{}} = message, _now_us)
       when (is_list(to) or is_atom(to)) and kind in [Message, Letter, Claim],
       do: if(Wire.names?(List.wrap(to)), do: message, else: malformed())

  defp whole({:command, request, ref}, now_us),
    do: whole({:command, request, ref, nil, nil}, now_us)

  # What needs no stamp has its giver there.
  defp whole({:command, request, ref, {:by, giver}}, now_us),
    do: whole({:command, request, ref, nil, giver}, now_us)

  defp whole({:command, request, ref, order}, now_us),
    do: whole({:command, request, ref, order, nil}, now_us)

  # Without a reference nothing waits for an answer, as in lockstep, and it is not known from which node it comes.
  defp whole({:command, request, ref, order, giver}, now_us)
       when ref == nil or is_reference(ref) do
    here? = ref != nil and node(ref) == node()
    {:command, request, ref, Freshness.arrived(order, here?), Giver.of(giver, ref), now_us}
  end

  defp whole({:ordered, _request, giver} = message, _now_us) when is_binary(giver), do: message

  defp whole({:stamp, ref}, now_us) when is_reference(ref), do: {:stamp, ref, now_us}

  defp whole({:rival, {boot, node}, comms} = message, _now_us)
       when is_integer(boot) and is_atom(node) and (is_pid(comms) or comms == nil),
       do: message

  defp whole({:rejected, why}, _now_us) when is_atom(why), do: {:rejected, why, 1}

  defp whole({:rejected, why, count} = message, _now_us)
       when is_atom(why) and is_integer(count) and count > 0,
       do: message

  defp whole({:unanswered, ref, _answer} = message, _now_us) when is_reference(ref), do: message

  defp whole({:result, {:delivered, _command, ref, _giver}, outcome} = message, _now_us)
       when ref == nil or is_reference(ref),
       do: if(CommandHandler.outcome?(outcome), do: message, else: malformed())

  defp whole(:stop, _now_us), do: :stop
  defp whole(_unknown, _now_us), do: malformed()

  defp malformed, do: {:rejected, :not_a_message, 1}

  @impl Role
  def perceive(at_ms, s, board) do
    taken? = s.name.left? and Directory.members({:robot, s.config.id}) != []
    seen = %{about: RobotInfo.seen(board), taken?: taken?}

    case Board.fetch(board, :joystick, Joystick.word_ms(), at_ms) do
      {:ok, reading, heard_ms} ->
        heard = {{reading, heard_ms}, System.monotonic_time(:microsecond)}
        {:tick, Map.put(seen, :joystick, heard)}

      :error ->
        {:tick, seen}
    end
  end

  @impl Role
  def handle({:cast, {:heard, checked}}, at_ms, s, board) do
    {heard, receiver} = Receiver.take(s.receiver, checked, at_ms)
    heard(heard, %{s | receiver: receiver}, at_ms, board)
  end

  def handle({:tick, seen}, at_ms, s, board) do
    gone = Peers.gone(s.receiver.peers, at_ms)
    shown = Enum.flat_map(gone -- s.gone, &show(s, &1, at_ms, board))
    s = %{s | gone: gone, ticks: s.ticks + 1}
    {s, noted} = note(s, seen, board)

    counts = %{sent: s.sent, heard: s.receiver.heard, rejected: s.receiver.rejected}
    {s, forwarded} = forward(s, Receiver.forward(s.receiver, at_ms))
    s = urged(s, board)
    due? = s.urgent > 0 or Heartbeat.due?(s.beat_ms, at_ms)
    {s, beats} = if due?, do: beat(s, at_ms, board), else: {s, []}
    {s, rivals} = rivals(%{s | urgent: max(s.urgent - 1, 0)}, seen, at_ms)
    {s, driven} = drive(s, seen[:joystick], at_ms, board)
    {s, noted ++ shown ++ [{:put, :radio, counts}] ++ forwarded ++ beats ++ rivals ++ driven}
  end

  def handle({:cast, {:say, to, message}}, _at_ms, %{config: %{id: id}} = s, _board) do
    to = if to == :all, do: :all, else: List.delete(List.wrap(to), id)
    speak(s, to, Message.of(id, message))
  end

  def handle({:cast, :stop}, at_ms, s, board) do
    case urged(s, board) do
      ^s -> {s, []}
      hurried -> beat(hurried, at_ms, board)
    end
  end

  def handle({:cast, {:command, request, ref, order, giver, now_us}}, at_ms, s, board) do
    # The e-stop itself knows what a reset is meant for.
    stopped = if EStop.takes?(request), do: nil, else: EStop.stopped(board)

    case Freshness.judge(s.config.boot, request, order, true, now_us, stopped) do
      {:ok, asked_us} ->
        {s, command(request, {ref, giver, asked_us, now_us}, order, s, at_ms, board)}

      {:error, why} ->
        {reject(s, :too_old, 1), [{:reply, ref, Freshness.refusal(s.config.id, why)}]}
    end
  end

  def handle({:cast, {:stamp, ref, now_us}}, _at_ms, s, _board),
    do: {s, [{:reply, ref, Freshness.stamp(s.config.boot, now_us)}]}

  # The time for the drive's answer is over.
  def handle({:cast, {:unanswered, ref, answer}}, _at_ms, s, _board),
    do: {s, [{:reply, ref, answer}]}

  def handle({:cast, {:result, {:delivered, command, ref, giver}, outcome}}, at_ms, s, _board) do
    {s, told} = if outcome == :ok, do: accepted(s, command, giver, at_ms), else: {s, []}
    {s, [{:reply, ref, CommandHandler.answer(outcome, s.config.id, command)} | told]}
  end

  def handle({:cast, {:ordered, request, giver}}, at_ms, s, _board),
    do: accepted(s, request, giver, at_ms)

  def handle({:cast, {:rejected, why, count}}, _at_ms, s, _board), do: {reject(s, why, count), []}

  def handle({:cast, {:rival, other, comms}}, at_ms, s, _board) do
    {name, effects} = NameClaim.rival(s.name, other, comms, at_ms)
    {%{s | name: name}, effects}
  end

  def handle(_unknown, _at_ms, _s, _board), do: :unknown

  defp heard({:heartbeat, id, %{estop: tags}}, s, at_ms, board) do
    shown = show(s, id, at_ms, board)

    if tags != [] and EStop.news?(EStop.written(board), tags),
      do: {s, [{:cast, :estop, {:beat, tags}} | shown]},
      else: {s, shown}
  end

  defp heard({:message, message}, s, at_ms, _board) do
    {s, forwarded} = forward(s, Receiver.forward(s.receiver, message, at_ms))
    {s, [{:cast, :pilot, {:message, message}} | forwarded]}
  end

  defp heard(:nothing, s, _at_ms, _board), do: {s, []}

  defp forward(s, {receiver, sendings}) do
    for {:send, to, message} <- sendings, reduce: {%{s | receiver: receiver}, []} do
      {s, effects} ->
        {s, more} = speak(s, to, message)
        {s, effects ++ more}
    end
  end

  # A hundred robots send each other fifty thousand heartbeats a second, so only the row of this one is written.
  defp show(s, id, at_ms, %Board{} = board),
    do: [{:apply, {__MODULE__, :show_peer, [board, s.receiver.peers, id, at_ms]}}]

  # In lockstep percepts take them from here.
  defp show(_s, _id, _at_ms, _entries), do: []

  @doc false
  def show_peer(board, peers, id, at_ms) do
    peer = Peers.percept(peers, id, at_ms)
    Board.put(board, :comms, {:peer, id}, peer, peer.at_ms)
  end

  # Beside a fleet in lockstep there is no blackboard.
  defp note(s, %{about: nil}, _board), do: {s, []}
  defp note(%{name: %{left?: true}, noted: nil} = s, _seen, _board), do: {s, []}

  # It then receives the rows of the other.
  defp note(%{name: %{left?: true}} = s, _seen, _board),
    do: {%{s | noted: nil}, [{:apply, {Blackboard, :leave, [s.config.id]}}]}

  defp note(s, %{about: about}, board) do
    {due?, noted} = RobotInfo.due(s.noted, about)
    written = {:apply, {RobotInfo, :write, [s.config, board, s.receiver]}}
    {%{s | noted: noted}, if(due?, do: [written], else: [])}
  end

  # A robot that has fallen silent does not speak.
  defp speak(%{name: %{left?: true}} = s, _to, _message), do: {s, []}
  defp speak(s, to, message), do: {%{s | sent: s.sent + 1}, [{:transmit, to, message}]}

  # If a test or a trial decides when a robot acts, the next heartbeat carries it.
  defp urged(%{config: %{pace: :manual}} = s, _board), do: s

  defp urged(s, board) do
    case EStop.written(board).held do
      same when same == s.held -> s
      held -> %{s | held: held, urgent: @urgent_ticks}
    end
  end

  defp beat(s, at_ms, board) do
    from = {s.config.boot, s.sequence + 1}

    case OwnHeartbeat.message(s.config, board, s.receiver, from, at_ms) do
      {:ok, message} -> speak(%{s | sequence: s.sequence + 1, beat_ms: at_ms}, :all, message)
      :error -> {s, []}
    end
  end

  defp rivals(%{ticks: ticks} = s, %{taken?: taken?}, at_ms)
       when rem(ticks, @rivals_every) == 0 do
    {name, effects} = NameClaim.look(s.name, taken?, at_ms)
    {%{s | name: name}, effects}
  end

  defp rivals(s, _seen, _at_ms), do: {s, []}

  defp drive(s, nil, at_ms, _board) do
    {nil, joystick} = Joystick.word(s.joystick, nil, at_ms)
    {%{s | joystick: joystick}, []}
  end

  # The word of its joystick comes to the same door as those of other people, and is as old as the joystick's reading.
  defp drive(s, {{_reading, heard_ms} = heard, now_us}, at_ms, board) do
    {word, joystick} = Joystick.word(s.joystick, heard, at_ms)
    s = %{s | joystick: joystick}
    age_ms = max(at_ms - heard_ms, 0)
    order = {s.config.boot, now_us - 1_000 * age_ms}

    if word do
      input = {:cast, {:command, word, nil, order, "its joystick", now_us}}
      {s, effects} = handle(input, at_ms, s, board)
      {told, s} = Enum.flat_map_reduce(effects, s, &told/2)
      {s, [{:cast, :gate, {:present, age_ms}} | told]}
    else
      {s, []}
    end
  end

  # No person waits for the answer to a joystick, so what is refused is an event.
  defp told({:reply, nil, {:error, line}}, s) do
    {news?, joystick} = Joystick.refused(s.joystick, line)
    told = if news?, do: [{:event, [:swarm, :comms, :joystick], %{line: line}}], else: []
    {told, %{s | joystick: joystick}}
  end

  defp told(effect, s), do: {[effect], s}

  # In lockstep no giver is known. Words of driving come ten times a second: the first of a hand is told.
  defp accepted(s, _request, nil, _at_ms), do: {s, []}

  defp accepted(s, {:move, _ahead, _turn, _for_s} = word, giver, at_ms) do
    {last, last_ms} = s.driver
    s = %{s | driver: {giver, at_ms}}

    if last == giver and at_ms - last_ms < @pause_ms,
      do: {s, []},
      else: {s, [ordered_event(word, giver)]}
  end

  defp accepted(s, request, giver, _at_ms), do: {s, [ordered_event(request, giver)]}

  defp ordered_event(request, giver),
    do: {:event, [:swarm, :comms, :ordered], %{order: Order.words(request), by: giver}}

  # A sender that knows only this process reaches the e-stop through it.
  defp command(request, {ref, giver, asked_us, _now_us} = given, order, s, at_ms, board) do
    cond do
      EStop.takes?(request) -> [{:cast, :estop, {:in_time, request, ref, asked_us, giver}}]
      Replacement.takes?(request) -> [Replacement.take(s.config.id, request, order, ref)]
      true -> CommandHandler.take(request, given, s, at_ms, board)
    end
  end

  defp reject(s, why, count), do: %{s | receiver: Receiver.reject(s.receiver, why, count)}
end
