defmodule Mesh.Protocol do
  @moduledoc """
  A node's radio as a pure function: datagrams and time in, datagrams and deliveries out.
  `Mesh.Server` is the process round it.

  | effect | means |
  |---|---|
  | `{:send, address, datagram}` | out by UDP |
  | `{:deliver, to, node, message}` | a message from there for these robots of this node, or `:all` |
  | `{:beat, robot, node, {boot, sequence}}` | a heartbeat of a robot there |
  | `{:serve, service, node, term}` | for who takes that service's terms |
  | `{:node, change, node}` | `:up`, `:suspect`, `:gone` |
  | `{:learn, name, ip, port}` | where a node's distribution listens |
  | `{:event, name, metadata}` | for whoever logs |
  """
  alias Mesh.Protocol.{Beacon, NodeTable, Packet, Roster}
  alias Mesh.Protocol.Packet.ReplayProtection

  # Without a heartbeat of a robot of its own a node shows as often by beacons that it is there.
  @beat_ms 200
  # An answer to a stranger, no more often than this for each.
  @answer_ms 20

  @enforce_keys [:secret, :roster, :name, :session, :guard, :node_table, :strategies, :port] ++
                  [:consumer, :services]
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

  @type address :: Mesh.Strategy.address()
  @type effect ::
          {:send, address(), binary()}
          | {:deliver, :all | [atom()], node(), message :: term()}
          | {:beat, atom(), node(), {boot :: integer(), sequence :: integer()}}
          | {:serve, atom(), node(), term()}
          | {:node, :up | :suspect | :gone, node()}
          | {:learn, String.t(), :inet.ip4_address(), :inet.port_number()}
          | {:event, atom(), map()}
  @typedoc """
  `consumer` reads messages (`Mesh.Consumer`), `services` are those whose terms are let in;
  `group` is the multicast address that heartbeats go to besides, `links` to whom the distribution is connected,
  `spoke_ms` when a robot of this node was last heard by all, `answered` when a stranger last got an answer;
  `second` is the one in which `strange` counts what nobody of the fleet has signed.
  """
  @type t :: %__MODULE__{
          secret: Mesh.Secret.t(),
          roster: Roster.t(),
          name: String.t(),
          session: non_neg_integer(),
          guard: ReplayProtection.t(),
          node_table: NodeTable.t(),
          strategies: [{module(), state :: term()}],
          port: :inet.port_number(),
          consumer: module(),
          services: [atom()],
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
  A node's side of the protocol; `session` is random and new with each start, `strategies` are `{module, state}`, `group`
  is the multicast address that heartbeats go to besides, `port` that of the distribution, `consumer` who reads
  messages, and `services` whose terms are let in.
  """
  @spec new(keyword()) :: t()
  def new(options) do
    %{roster: roster, session: session} = Map.new(options)
    name = Atom.to_string(roster.me)

    own = [name: name, guard: ReplayProtection.new(session), node_table: NodeTable.new(name)]
    struct!(__MODULE__, options ++ own)
  end

  @doc "A datagram came from there."
  @spec hear(t(), binary(), address(), integer()) :: {t(), [effect()]}
  def hear(protocol, datagram, address, now_ms) do
    protocol = count_anew(protocol, div(now_ms, 1_000))

    case Packet.Filter.read(protocol, datagram, address) do
      {:ok, packet, node, body} -> admit(protocol, packet, node, body, address, now_ms)
      {:error, :own} -> {protocol, []}
      {:error, reason} -> reject(protocol, reason, address, now_ms)
    end
  end

  @doc "Time: five times a second. `links` are the nodes that the distribution is connected to."
  @spec tick(t(), [node()], integer(), float()) :: {t(), [effect()]}
  def tick(protocol, links, now_ms, chance) do
    protocol = %{protocol | links: for(node <- links, do: Atom.to_string(node))}
    {node_table, changes} = NodeTable.age(protocol.node_table, now_ms)
    quiet? = protocol.spoke_ms == nil or now_ms - protocol.spoke_ms >= @beat_ms
    {due, node_table} = NodeTable.due(node_table, quiet?, now_ms, chance)

    {targets, strategies} =
      ask(protocol.strategies, NodeTable.addresses(node_table), now_ms, chance)

    protocol = %{protocol | node_table: node_table, strategies: strategies}
    {protocol, sent} = send_all(protocol, :beacon, beacon(protocol, now_ms), due ++ targets)
    {protocol, sent ++ changed(protocol, changes)}
  end

  @doc "A message of a robot of this node, to all nodes or to those that hold these robots."
  @spec speak(t(), :all | [atom()], message :: term(), integer()) :: {t(), [effect()]}
  def speak(protocol, :all, message, now_ms) do
    to = NodeTable.addresses(protocol.node_table) ++ List.wrap(protocol.group)
    {protocol, sent} = send_all(protocol, :message, {:all, message}, to)
    {%{protocol | spoke_ms: now_ms}, sent}
  end

  def speak(protocol, ids, message, _now_ms) do
    holders = NodeTable.holders(protocol.node_table, ids)

    to =
      for name <- holders,
          entry = protocol.node_table.nodes[name],
          entry.status != :gone,
          do: entry.address

    send_all(protocol, :message, {ids, message}, to)
  end

  @doc "Somebody who may not know this node is there: a beacon introduces it."
  @spec knock(t(), address(), integer()) :: {t(), [effect()]}
  def knock(protocol, address, now_ms),
    do: send_all(protocol, :beacon, beacon(protocol, now_ms), [address])

  @doc """
  A service's term, to one node, to all, or `:everywhere`: also to those that have just been silent, and by
  multicast besides.
  """
  @spec serve(t(), atom(), :all | :everywhere | node(), term()) :: {t(), [effect()]}
  def serve(protocol, service, :everywhere, term) do
    to = for {_name, %{address: address}} <- protocol.node_table.nodes, do: address
    send_all(protocol, :service, {service, term}, to ++ List.wrap(protocol.group))
  end

  def serve(protocol, service, :all, term),
    do: send_all(protocol, :service, {service, term}, NodeTable.addresses(protocol.node_table))

  def serve(protocol, service, node, term) do
    case protocol.node_table.nodes[Atom.to_string(node)] do
      nil -> {protocol, []}
      entry -> send_all(protocol, :service, {service, term}, [entry.address])
    end
  end

  defp count_anew(%{second: second} = protocol, second), do: protocol
  defp count_anew(protocol, second), do: %{protocol | second: second, strange: 0}

  defp admit(protocol, packet, node, body, address, now_ms) do
    told =
      with %Beacon{sessions: sessions} <- body,
           {_name, session} <- List.keyfind(sessions, protocol.name, 0),
           do: session,
           else: (_none -> nil)

    admitted =
      ReplayProtection.admit(
        protocol.guard,
        packet.sender,
        packet.session,
        packet.sequence,
        told,
        now_ms
      )

    case admitted do
      {:ok, guard} ->
        new? = ReplayProtection.session(protocol.guard, packet.sender) != packet.session

        {node_table, changes} =
          NodeTable.hear(protocol.node_table, packet.sender, address, now_ms)

        protocol = %{protocol | guard: guard, node_table: node_table}
        {protocol, taken} = take(protocol, packet, node, body, address, now_ms)

        # Those who have just been let in need this node's word as soon.
        {protocol, sent} =
          if new?, do: answer(protocol, packet, address, now_ms), else: {protocol, []}

        {protocol, changed(protocol, changes) ++ taken ++ sent}

      {:error, :stranger, guard} ->
        answer(%{protocol | guard: guard}, packet, address, now_ms)

      {:error, reason, guard} ->
        reject(%{protocol | guard: guard}, reason, address, now_ms)
    end
  end

  defp take(protocol, packet, node, %Beacon{} = beacon, {ip, _port}, now_ms) do
    learn = if beacon.port > 0, do: [{:learn, packet.sender, ip, beacon.port}], else: []

    rival =
      if node == protocol.roster.me, do: [{:event, :duplicate_node, %{node: node}}], else: []

    {%{
       protocol
       | node_table: NodeTable.beacon(protocol.node_table, packet.sender, beacon, now_ms)
     }, learn ++ rival}
  end

  # A heartbeat that is meant for some only is passed on: its robot is elsewhere.
  defp take(
         protocol,
         packet,
         node,
         {:all, message, %{beat: {_, _} = beat} = about},
         _from,
         now_ms
       ) do
    from = hd(about.robots)
    node_table = NodeTable.robot(protocol.node_table, packet.sender, from, beat, now_ms)

    {%{protocol | node_table: node_table},
     [{:beat, from, node, beat}, {:deliver, :all, node, message}]}
  end

  defp take(protocol, _packet, node, {to, message, _about}, _address, _now_ms),
    do: {protocol, [{:deliver, to, node, message}]}

  defp take(protocol, _packet, node, {service, term}, _address, _now_ms),
    do: {protocol, [{:serve, service, node, term}]}

  # A beacon that tells the stranger its session, and so asks for its word.
  defp answer(protocol, packet, address, now_ms) do
    node_table = NodeTable.claim(protocol.node_table, packet.sender, packet.session)
    protocol = %{protocol | node_table: node_table}

    if now_ms - Map.get(protocol.answered, packet.sender, now_ms - @answer_ms) >= @answer_ms do
      protocol = put_in(protocol.answered[packet.sender], now_ms)
      send_all(protocol, :beacon, beacon(protocol, now_ms), [address])
    else
      {protocol, []}
    end
  end

  defp beacon(protocol, now_ms) do
    Beacon.term(%Beacon{
      sessions:
        NodeTable.sessions(protocol.node_table, ReplayProtection.sessions(protocol.guard), now_ms),
      hears: NodeTable.hears(protocol.node_table, now_ms),
      links: protocol.links,
      port: protocol.port
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
  defp send_all(protocol, _kind, _term, []), do: {protocol, []}

  defp send_all(protocol, kind, term, addresses) do
    payload = Packet.pack(term)

    if byte_size(payload) > Packet.largest() do
      reject(protocol, :too_big, nil, 0)
    else
      sequence = protocol.sequence + 1

      datagram =
        Packet.seal(
          %Packet{
            sender: protocol.name,
            session: protocol.session,
            sequence: sequence,
            kind: kind,
            payload: payload
          },
          protocol.secret.key
        )

      sends = for address <- Enum.uniq(addresses), do: {:send, address, datagram}
      {%{protocol | sequence: sequence}, sends}
    end
  end

  defp changed(protocol, changes) do
    for {change, name} <- changes, {:ok, node} = Roster.node(protocol.roster, name) do
      {:node, change, node}
    end
  end

  defp reject(protocol, {:unknown_node, name}, address, now_ms) do
    {protocol, effects} = reject(protocol, :unknown_node, address, now_ms)

    # Signed, so it is one of ours that somebody forgot to write down; said once for each count of a hundred.
    if rem(protocol.rejected.unknown_node, 100) == 1,
      do: {protocol, [{:event, :unknown_node, %{name: name, address: address}} | effects]},
      else: {protocol, effects}
  end

  defp reject(protocol, reason, _address, _now_ms) do
    strange = if reason in [:unsigned, :not_ours, :version], do: 1, else: 0
    rejected = Map.update(protocol.rejected, reason, 1, &(&1 + 1))
    {%{protocol | rejected: rejected, strange: protocol.strange + strange}, []}
  end
end
