defmodule Mesh do
  @moduledoc """
  Connects a node to its mesh: which other nodes there are, and how to reach them.

  There are two planes. Datagrams carry data that is worthless unless it is new, and they alone
  decide which nodes are alive: after a cut the next one arrives at once. Erlang's distribution
  carries what needs an answer. A connection that has gone silent delays no other, and one that is
  lost does not change any view.

  Without a mesh (`config :swarm, mesh: false`) a node's robots reach only each other, and nodes
  that a person has connected by hand. `docs/networking.md` explains how to set it up.
  """
  alias Mesh.Distribution
  alias Mesh.{CommandRelay, Nonblocking, Table}
  alias Mesh.Protocol.{NodeTable, Packet, Routing}

  @typedoc """
  How a node sees the others: `number` grows with each change of the nodes present; for each node
  its `status`, whether the distribution is `connected`, the nodes that it `hears`, the `robots`
  that it holds, and how long ago it was heard.
  """
  @type view :: %{
          number: non_neg_integer(),
          nodes: %{
            node() => %{
              status: NodeTable.status(),
              connected: boolean(),
              hears: [node()],
              robots: [atom()],
              age_ms: non_neg_integer()
            }
          }
        }

  # A robot whose heartbeat is older than this is gone.
  @gone_ms 2_000

  @doc "Whether this node has a mesh."
  @spec running?() :: boolean()
  def running?, do: Table.there?()

  @doc """
  Sends a robot's message by datagram, which may be lost: to all other nodes, or to those that hold
  these robots. Without a mesh nothing is sent.
  """
  @spec speak(:all | [atom()], message :: term()) :: :ok
  def speak(to, message), do: tell({:speak, to, message})

  @doc """
  Sends a service's term to all other nodes, by datagram: it may be lost, duplicated or arrive out
  of order. A term of more than 60,000 bytes is refused. Without a mesh nothing is sent. The
  node's consumer defines the services (`c:Mesh.Consumer.services/0`).
  """
  @spec cast(service :: atom(), term()) :: :ok | {:error, :too_big}
  def cast(service, term), do: serve(service, :all, term)

  @doc "The same, to one node."
  @spec cast(service :: atom(), node(), term()) :: :ok | {:error, :too_big}
  def cast(service, node, term), do: serve(service, node, term)

  @doc """
  Sends a service's term by every route: to all nodes, including those that have been silent, and by multicast.
  """
  @spec broadcast(service :: atom(), term()) :: :ok | {:error, :too_big}
  def broadcast(service, term), do: serve(service, :everywhere, term)

  defp serve(service, to, term) do
    if :erlang.external_size(term) > Packet.largest(),
      do: {:error, :too_big},
      else: tell({:serve, service, to, term})
  end

  @doc """
  Signs bytes by the key of this node's fleet for the purpose that `label` names (`Mesh.Secret.subkey/2`), by
  HMAC-SHA256. The error says in one line that this node has no mesh, or that it does not answer.
  """
  @spec sign(label :: String.t(), binary()) :: {:ok, <<_::256>>} | {:error, line :: String.t()}
  def sign(label, bytes) when is_binary(label) and is_binary(bytes) do
    case Table.value(:server, nil) do
      nil -> {:error, "this node has no mesh"}
      pid -> Nonblocking.call(pid, {:sign, label, bytes}, "the mesh of this node")
    end
  end

  @doc "Tells a connected node the address of this one, so that both hear each other."
  @spec introduce(node()) :: :ok
  def introduce(node), do: tell({:introduce, node})

  @doc "The robots of other nodes that were heard within the last 2 s, and their nodes."
  @spec robots() :: %{atom() => node()}
  def robots, do: Map.new(Table.robots(Hal.Clock.now_ms() - @gone_ms + 1))

  @doc "Whether a robot of another node was heard within the last 2 s."
  @spec heard?(atom()) :: boolean()
  def heard?(robot), do: match?({_boot, _sequence, age} when age < @gone_ms, beat(robot))

  @doc """
  The robots on nodes that this node does not hear but that others hear, sorted: commands reach
  them through those others. At most 200 ms old.
  """
  @spec beyond() :: [atom()]
  def beyond, do: Table.value(:beyond, [])

  @doc "The newest heartbeat heard of a robot of another node: `{boot, sequence, age_ms}`."
  @spec beat(atom()) :: {integer(), non_neg_integer(), age_ms :: non_neg_integer()} | nil
  def beat(robot) do
    with {_node, boot, sequence, at_ms} <- Table.robot(robot),
         do: {boot, sequence, Hal.Clock.now_ms() - at_ms}
  end

  @doc "The other nodes that this node hears now."
  @spec alive() :: [node()]
  def alive, do: Table.nodes(NodeTable.alive_since(Hal.Clock.now_ms()))

  @doc """
  All nodes as seen from this node. It copies everything that is known, so it is for people and
  tests.
  """
  @spec view() :: view()
  def view do
    now_ms = Hal.Clock.now_ms()
    connected = Node.list()
    held = Enum.group_by(robots(), &elem(&1, 1), &elem(&1, 0))

    nodes =
      for {node, heard_ms, hears} <- Table.all(), into: %{} do
        {node,
         %{
           status: NodeTable.status(heard_ms, now_ms),
           connected: node in connected,
           hears: hears,
           robots: Enum.sort(Map.get(held, node, [])),
           age_ms: now_ms - heard_ms
         }}
      end

    %{number: Table.value(:number, 0), nodes: nodes}
  end

  @doc "How much was dropped since the start, by reason; at most 200 ms old."
  @spec rejected() :: %{atom() => pos_integer()}
  def rejected, do: Table.value(:rejected, %{})

  @doc """
  Why this node reaches no other, on one line, such as `"wlan0 is not connected"`: a fault of the network that has lasted
  for 3 s in which no node was heard. `nil` if there is none, and on a node without a mesh.
  """
  @spec fault() :: String.t() | nil
  def fault, do: Table.value(:fault, nil)

  @doc """
  How many distribution connections were refused since the start, by reason: `stranger`, an address that is not the
  fleet's; `too_often`; `new_names`, too many names that this node did not know; and `elsewhere`, a call to another
  address of this machine than that of its interface. Empty on a node that was started
  without a carrier of the mesh (`Mesh.Distribution.Access`).
  """
  @spec refused() :: %{Distribution.Access.refusal() => non_neg_integer()}
  def refused, do: Distribution.Access.Refusals.counts()

  @doc """
  How many datagrams this node has sent, heard and rejected, and its UDP port; `nil` without a
  network.
  """
  @spec counts() ::
          %{
            sent: non_neg_integer(),
            heard: non_neg_integer(),
            rejected: %{atom() => pos_integer()},
            port: :inet.port_number() | nil
          }
          | {:error, line :: String.t()}
  def counts do
    case Table.value(:server, nil) do
      nil -> {:error, "this node has no mesh"}
      pid -> Nonblocking.call(pid, :counts, "the mesh of this node")
    end
  end

  @doc "Whether a node is known and has not been heard for a second, whatever its connection says."
  @spec silent?(node()) :: boolean()
  def silent?(node) do
    heard_ms = Table.heard_ms(node)
    heard_ms != nil and NodeTable.status(heard_ms, Hal.Clock.now_ms()) != :alive
  end

  @doc """
  Sends a request to a robot that this node has no working connection to, through other nodes that
  have one (`Mesh.CommandRelay`). `ref` is the alias in it for the answer.
  """
  @spec relay(atom(), tuple(), reference()) :: :ok | {:error, :unknown | :no_way}
  def relay(robot, request, ref) do
    case Table.robot(robot) do
      nil ->
        {:error, :unknown}

      {node, _boot, _sequence, _at_ms} ->
        ways =
          Routing.ways(
            node(),
            Node.list(),
            Table.onward(NodeTable.alive_since(Hal.Clock.now_ms()))
          )

        CommandRelay.send(node, ways, robot, request, ref)
    end
  end

  # Between two servers there is no table, and no process to tell.
  defp tell(request) do
    with pid when pid != nil <- Table.value(:server, nil), do: GenServer.cast(pid, request)
    :ok
  end
end
