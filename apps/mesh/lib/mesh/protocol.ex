defmodule Mesh.Protocol do
  @moduledoc """
  Models a node's radio as a pure function: datagrams and time in, datagrams and deliveries out. `Mesh.Server` is the
  process round it.

  | effect | means |
  |---|---|
  | `{:send, address, datagram}` | out by UDP |
  | `{:deliver, to, node, message}` | a message from there for these robots of this node, or `:all` |
  | `{:beat, robot, node, {boot, sequence}}` | a heartbeat of a robot there |
  | `{:serve, service, node, term}` | for the receiver of that service's terms |
  | `{:node, change, node}` | `:up`, `:suspect`, `:gone` |
  | `{:learn, name, ip, port}` | where a node's distribution listens |
  | `{:event, name, metadata}` | for the log |
  """
  alias Mesh.Protocol.{Admission, Namesake, NodeTable, Outbox, Packet, Rejections, Roster}
  alias Mesh.Protocol.Packet.ReplayProtection

  # Without a heartbeat of a robot of its own a node shows as often by beacons that it is there.
  @beat_ms 200

  @enforce_keys [:secret, :roster, :name, :session, :replay, :node_table, :strategies, :port] ++
                  [:consumer, :services]
  defstruct @enforce_keys ++
              [
                group: nil,
                sequence: 0,
                addresses: [],
                late: [],
                links: [],
                spoke_ms: nil,
                namesake: %Namesake{},
                challenged: %{},
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
  `consumer` reads messages (`Mesh.Consumer`), `services` are those whose terms are let in, those in `late` at any age;
  `group` is the multicast address that heartbeats go to besides, `addresses` are this node's own, `links` the nodes
  to which the distribution is connected, `spoke_ms` when a robot of this node was last heard by all, `challenged` when a
  sender that cannot be believed was last challenged; `second` is the one in which `strange` counts datagrams from outside
  the fleet.
  """
  @type t :: %__MODULE__{
          secret: Mesh.Secret.t(),
          roster: Roster.t(),
          name: String.t(),
          session: non_neg_integer(),
          replay: ReplayProtection.t(),
          node_table: NodeTable.t(),
          strategies: [{module(), state :: term()}],
          port: :inet.port_number(),
          consumer: module(),
          services: [atom()],
          group: address() | nil,
          addresses: [address()],
          late: [atom()],
          sequence: non_neg_integer(),
          links: [String.t()],
          spoke_ms: integer() | nil,
          namesake: Namesake.t(),
          challenged: %{{asked? :: boolean(), String.t(), address()} => integer()},
          second: integer(),
          strange: non_neg_integer(),
          rejected: %{atom() => pos_integer()}
        }

  @doc """
  A node's side of the protocol; `session` is random and new with each start, `strategies` are `{module, state}`, `group`
  is the multicast address that heartbeats go to besides, `addresses` are those that others hear this node from, `port`
  is that of the distribution, `consumer` the reader of messages, `services` are those whose terms are let in, and `late`
  those that are at any age.
  """
  @spec new(keyword()) :: t()
  def new(options) do
    %{roster: roster, session: session} = Map.new(options)
    name = Atom.to_string(roster.me)

    own = [name: name, replay: ReplayProtection.new(session), node_table: NodeTable.new(name)]
    struct!(__MODULE__, options ++ own)
  end

  @doc "This node has these addresses from now on: its datagrams name them, and are refused from any other."
  @spec locate(t(), [address()]) :: t()
  def locate(protocol, addresses),
    do: %{protocol | addresses: Enum.take(addresses, Packet.most_addresses())}

  @doc "A datagram came from there."
  @spec hear(t(), binary(), address(), integer()) :: {t(), [effect()]}
  def hear(protocol, datagram, address, now_ms) do
    protocol = Rejections.tick(protocol, now_ms)

    case Packet.Filter.read(protocol, datagram, address) do
      {:ok, packet, body} -> Admission.admit(protocol, packet, body, address, now_ms)
      {:error, :own} -> {protocol, []}
      {:error, reason} -> Rejections.reject(protocol, reason, address)
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
    {protocol, sent} = Outbox.beacon(protocol, now_ms, due ++ targets)
    {protocol, challenges} = renew(Admission.tick(protocol, now_ms), now_ms)
    {alone?, namesake} = Namesake.tick(protocol.namesake, now_ms)
    told = if alone?, do: [{:event, :unique_node, %{node: protocol.roster.me}}], else: []

    {%{protocol | namesake: namesake},
     sent ++ challenges ++ Roster.changes(protocol.roster, changes) ++ told}
  end

  # The clocks of others drift.
  defp renew(protocol, now_ms) do
    old =
      for {name, %{status: status, address: address}} <- protocol.node_table.nodes,
          status != :gone and ReplayProtection.due?(protocol.replay, name, now_ms),
          do: address

    Outbox.clock(protocol, :challenge, nil, old, now_ms)
  end

  @doc "A message of a robot of this node, to all nodes or to those that hold these robots."
  @spec speak(t(), :all | [atom()], message :: term(), integer()) :: {t(), [effect()]}
  def speak(protocol, :all, message, now_ms) do
    to = NodeTable.addresses(protocol.node_table) ++ List.wrap(protocol.group)
    {protocol, sent} = Outbox.seal(protocol, :message, {:all, message}, to, now_ms)
    {%{protocol | spoke_ms: now_ms}, sent}
  end

  def speak(protocol, ids, message, now_ms) do
    holders = NodeTable.holders(protocol.node_table, ids)

    to =
      for name <- holders,
          entry = protocol.node_table.nodes[name],
          entry.status != :gone,
          do: entry.address

    Outbox.seal(protocol, :message, {ids, message}, to, now_ms)
  end

  @doc "A node that may not know this one is there: a beacon introduces it."
  @spec knock(t(), address(), integer()) :: {t(), [effect()]}
  def knock(protocol, address, now_ms),
    do: Outbox.beacon(protocol, now_ms, [address])

  @doc """
  A service's term, to one node, to all, or `:everywhere`: also to those that have just been silent, and by
  multicast besides.
  """
  @spec serve(t(), atom(), :all | :everywhere | node(), term(), integer()) :: {t(), [effect()]}
  def serve(protocol, service, to, term, now_ms),
    do: Outbox.seal(protocol, :service, {service, term}, places(protocol, to), now_ms)

  defp places(%{node_table: node_table, group: group}, :everywhere),
    do: for({_name, %{address: address}} <- node_table.nodes, do: address) ++ List.wrap(group)

  defp places(protocol, :all), do: NodeTable.addresses(protocol.node_table)

  defp places(protocol, node) do
    case protocol.node_table.nodes[Atom.to_string(node)] do
      nil -> []
      entry -> [entry.address]
    end
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
end
