defmodule Swarm.Mesh.Protocol do
  @moduledoc """
  A node's radio as a pure function: datagrams and time in, datagrams and deliveries out.
  `Swarm.Mesh.Server` is the process round it.

  | effect | means |
  |---|---|
  | `{:send, address, datagram}` | out by UDP |
  | `{:deliver, to, message}` | a message for these robots of this node, or `:all` |
  | `{:beat, robot, node, {boot, sequence}}` | a heartbeat of a robot there |
  | `{:serve, service, node, term}` | for the blackboard, the hints, the brakes |
  | `{:node, change, node}` | `:up`, `:suspect`, `:gone` |
  | `{:learn, name, ip, port}` | where a node's distribution listens |
  | `{:event, name, metadata}` | for whoever logs |
  """
  alias Swarm.Mesh.{Beacon, NodeTable, Packet, Roster}
  alias Swarm.Mesh.Packet.ReplayProtection
  alias Swarm.Message

  # Without a heartbeat of a robot of its own a node shows as often by beacons that it is there.
  @beat_ms 200
  # An answer to a stranger, no more often than this for each.
  @answer_ms 20

  @enforce_keys [:secret, :roster, :name, :session, :guard, :book, :strategies, :port]
  defstruct @enforce_keys ++
              [
                group: nil,
                sequence: 0,
                links: [],
                spoke_ms: nil,
                answered: %{},
                second: 0,
                strange: 0,
                rejected: %{}
              ]

  @type address :: Swarm.Mesh.Strategy.address()
  @type effect ::
          {:send, address(), binary()}
          | {:deliver, :all | [atom()], Message.t()}
          | {:beat, atom(), node(), {boot :: integer(), sequence :: integer()}}
          | {:serve, atom(), node(), term()}
          | {:node, :up | :suspect | :gone, node()}
          | {:learn, String.t(), :inet.ip4_address(), :inet.port_number()}
          | {:event, atom(), map()}
  @typedoc """
  `group` is the multicast address that heartbeats go to besides, `links` to whom the distribution is connected,
  `spoke_ms` when a robot of this node was last heard by all, `answered` when a stranger last got an answer;
  `second` is the one in which `strange` counts what nobody of the fleet has signed.
  """
  @type t :: %__MODULE__{
          secret: Swarm.Mesh.Secret.t(),
          roster: Roster.t(),
          name: String.t(),
          session: non_neg_integer(),
          guard: ReplayProtection.t(),
          book: NodeTable.t(),
          strategies: [{module(), state :: term()}],
          port: :inet.port_number(),
          group: address() | nil,
          sequence: non_neg_integer(),
          links: [String.t()],
          spoke_ms: integer() | nil,
          answered: %{String.t() => integer()},
          second: integer(),
          strange: non_neg_integer(),
          rejected: %{atom() => pos_integer()}
        }

  @doc """
  A station; `session` is random and new with each start, `strategies` are `{module, state}`, `group`
  is the multicast address that heartbeats go to besides, `port` that of the distribution.
  """
  @spec new(keyword()) :: t()
  def new(options) do
    [secret, roster, session, strategies, port] =
      Enum.map([:secret, :roster, :session, :strategies, :port], &Keyword.fetch!(options, &1))

    name = Atom.to_string(roster.me)

    %__MODULE__{
      secret: secret,
      roster: roster,
      name: name,
      session: session,
      guard: ReplayProtection.new(session),
      book: NodeTable.new(name),
      strategies: strategies,
      port: port,
      group: options[:group]
    }
  end

  @doc "A datagram came from there."
  @spec hear(t(), binary(), address(), integer()) :: {t(), [effect()]}
  def hear(station, datagram, address, now_ms) do
    station = count_anew(station, div(now_ms, 1_000))

    case Packet.Filter.read(station, datagram, address) do
      {:ok, packet, node, body} -> admit(station, packet, node, body, address, now_ms)
      {:error, :own} -> {station, []}
      {:error, reason} -> reject(station, reason, address, now_ms)
    end
  end

  @doc "Time: five times a second. `links` are the nodes that the distribution is connected to."
  @spec tick(t(), [node()], integer(), float()) :: {t(), [effect()]}
  def tick(station, links, now_ms, chance) do
    station = %{station | links: for(node <- links, do: Atom.to_string(node))}
    {book, changes} = NodeTable.age(station.book, now_ms)
    quiet? = station.spoke_ms == nil or now_ms - station.spoke_ms >= @beat_ms
    {due, book} = NodeTable.due(book, quiet?, now_ms, chance)
    {targets, strategies} = ask(station.strategies, NodeTable.addresses(book), now_ms, chance)
    station = %{station | book: book, strategies: strategies}
    {station, sent} = send_all(station, :beacon, beacon(station, now_ms), due ++ targets)
    {station, sent ++ changed(station, changes)}
  end

  @doc "A message of a robot of this node, to all nodes or to those that hold these robots."
  @spec speak(t(), :all | [atom()], Message.t(), integer()) :: {t(), [effect()]}
  def speak(station, :all, message, now_ms) do
    to = NodeTable.addresses(station.book) ++ List.wrap(station.group)
    {station, sent} = send_all(station, :message, {:all, message}, to)
    {%{station | spoke_ms: now_ms}, sent}
  end

  def speak(station, ids, message, _now_ms) do
    holders = NodeTable.holders(station.book, ids)

    to =
      for name <- holders,
          entry = station.book.nodes[name],
          entry.status != :gone,
          do: entry.address

    send_all(station, :message, {ids, message}, to)
  end

  @doc "Somebody who may not know this node is there: a beacon introduces it."
  @spec knock(t(), address(), integer()) :: {t(), [effect()]}
  def knock(station, address, now_ms),
    do: send_all(station, :beacon, beacon(station, now_ms), [address])

  @doc "A service's term, to all nodes or to one."
  @spec serve(t(), atom(), :all | node(), term()) :: {t(), [effect()]}
  def serve(station, :stop, :all, term) do
    # A stop goes every way there is, also to those that have just been silent.
    to = for {_name, %{address: address}} <- station.book.nodes, do: address
    send_all(station, :service, {:stop, term}, to ++ List.wrap(station.group))
  end

  def serve(station, service, :all, term),
    do: send_all(station, :service, {service, term}, NodeTable.addresses(station.book))

  def serve(station, service, node, term) do
    case station.book.nodes[Atom.to_string(node)] do
      nil -> {station, []}
      entry -> send_all(station, :service, {service, term}, [entry.address])
    end
  end

  defp count_anew(%{second: second} = station, second), do: station
  defp count_anew(station, second), do: %{station | second: second, strange: 0}

  defp admit(station, packet, node, body, address, now_ms) do
    told =
      with %Beacon{sessions: sessions} <- body,
           {_name, session} <- List.keyfind(sessions, station.name, 0),
           do: session,
           else: (_none -> nil)

    admitted =
      ReplayProtection.admit(
        station.guard,
        packet.sender,
        packet.session,
        packet.sequence,
        told,
        now_ms
      )

    case admitted do
      {:ok, guard} ->
        new? = ReplayProtection.session(station.guard, packet.sender) != packet.session
        {book, changes} = NodeTable.hear(station.book, packet.sender, address, now_ms)
        station = %{station | guard: guard, book: book}
        {station, taken} = take(station, packet, node, body, address, now_ms)

        # Those who have just been let in need this station's word as soon.
        {station, sent} =
          if new?, do: answer(station, packet, address, now_ms), else: {station, []}

        {station, changed(station, changes) ++ taken ++ sent}

      {:error, :stranger, guard} ->
        answer(%{station | guard: guard}, packet, address, now_ms)

      {:error, reason, guard} ->
        reject(%{station | guard: guard}, reason, address, now_ms)
    end
  end

  defp take(station, packet, node, %Beacon{} = beacon, {ip, _port}, now_ms) do
    learn = if beacon.port > 0, do: [{:learn, packet.sender, ip, beacon.port}], else: []
    rival = if node == station.roster.me, do: [{:event, :duplicate_node, %{node: node}}], else: []

    {%{station | book: NodeTable.beacon(station.book, packet.sender, beacon, now_ms)},
     learn ++ rival}
  end

  defp take(station, packet, node, {to, %Message{from: from} = message}, _address, now_ms) do
    case {to, message} do
      # One that is meant for some only is passed on: its robot is elsewhere.
      {:all, %{kind: :heartbeat, body: beat}} ->
        boot = {beat.boot, beat.sequence}
        book = NodeTable.robot(station.book, packet.sender, from, boot, now_ms)
        {%{station | book: book}, [{:beat, from, node, boot}, {:deliver, to, message}]}

      _other ->
        {station, [{:deliver, to, message}]}
    end
  end

  defp take(station, _packet, node, {service, term}, _address, _now_ms),
    do: {station, [{:serve, service, node, term}]}

  # A beacon that tells the stranger its session, and so asks for its word.
  defp answer(station, packet, address, now_ms) do
    book = NodeTable.claim(station.book, packet.sender, packet.session)
    station = %{station | book: book}

    if now_ms - Map.get(station.answered, packet.sender, now_ms - @answer_ms) >= @answer_ms do
      station = put_in(station.answered[packet.sender], now_ms)
      send_all(station, :beacon, beacon(station, now_ms), [address])
    else
      {station, []}
    end
  end

  defp beacon(station, now_ms) do
    Beacon.term(%Beacon{
      sessions:
        NodeTable.sessions(station.book, ReplayProtection.sessions(station.guard), now_ms),
      hears: NodeTable.hears(station.book, now_ms),
      links: station.links,
      port: station.port
    })
  end

  defp ask(strategies, known, now_ms, chance) do
    {targets, strategies} =
      strategies
      |> Enum.map(fn {module, state} ->
        {targets, state} = module.targets(state, known, now_ms, chance)
        {targets, {module, state}}
      end)
      |> Enum.unzip()

    {List.flatten(targets), strategies}
  end

  # Sealed once: who hears it twice, by multicast and by name, counts it once.
  defp send_all(station, _kind, _term, []), do: {station, []}

  defp send_all(station, kind, term, addresses) do
    payload = Packet.pack(term)

    if byte_size(payload) > Packet.largest() do
      reject(station, :too_big, nil, 0)
    else
      sequence = station.sequence + 1

      datagram =
        Packet.seal(
          %Packet{
            sender: station.name,
            session: station.session,
            sequence: sequence,
            kind: kind,
            payload: payload
          },
          station.secret.key
        )

      sends = for address <- Enum.uniq(addresses), do: {:send, address, datagram}
      {%{station | sequence: sequence}, sends}
    end
  end

  defp changed(station, changes) do
    for {change, name} <- changes, {:ok, node} = Roster.node(station.roster, name) do
      {:node, change, node}
    end
  end

  defp reject(station, {:unknown_node, name}, address, now_ms) do
    {station, effects} = reject(station, :unknown_node, address, now_ms)

    # Signed, so it is one of ours that somebody forgot to write down; said once for each count of a hundred.
    if rem(station.rejected.unknown_node, 100) == 1,
      do: {station, [{:event, :unknown_node, %{name: name, address: address}} | effects]},
      else: {station, effects}
  end

  defp reject(station, reason, _address, _now_ms) do
    strange = if reason in [:unsigned, :not_ours, :version], do: 1, else: 0
    rejected = Map.update(station.rejected, reason, 1, &(&1 + 1))
    {%{station | rejected: rejected, strange: station.strange + strange}, []}
  end
end
