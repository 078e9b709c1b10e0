defmodule Swarm.Mesh do
  @moduledoc """
  A node among others: who is there, and how to reach them.

  Two planes. Datagrams carry what must be new or is worth nothing, and they alone decide who is
  alive: after a cut the next one arrives at once. Erlang's distribution carries what needs an
  answer. A connection that has gone silent holds up nobody, and one that is lost changes no view.

  Without a mesh (`config :swarm, mesh: false`) a node's robots have only each other, and whom
  somebody has connected by hand. `docs/networking.md` tells how to set it up.
  """
  alias Swarm.Mesh.{CommandRelay, NodeTable, Packet, Roster, Routing}
  alias Swarm.Nonblocking
  alias Swarm.Directory.SafeTable

  @typedoc """
  How a node sees the others: `number` grows with each change of who is there; for each node its
  `status`, whether the distribution is `connected`, whom it `hears`, which `robots` it holds, and how
  long ago it was heard.
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

  # A robot whose heartbeat is older is gone.
  @gone_ms 2_000

  @doc "Whether this node has a mesh."
  @spec running?() :: boolean()
  def running?, do: :ets.whereis(__MODULE__) != :undefined

  @doc """
  Sends a robot's message by datagram, which may be lost: to all other nodes, or to those that hold
  these robots. Without a mesh nothing is sent.
  """
  @spec speak(:all | [atom()], Swarm.Message.t()) :: :ok
  def speak(to, message), do: radio({:speak, to, message})

  @doc """
  Sends a service's term to all other nodes, by datagram: it may be lost, doubled or come out of
  order. One of more than 60,000 bytes is refused. Without a mesh nothing is sent.
  """
  @spec cast(:rows | :stop, term()) :: :ok | {:error, :too_big}
  def cast(service, term), do: serve(service, :all, term)

  @doc "The same, to one node."
  @spec cast(:rows | :stop, node(), term()) :: :ok | {:error, :too_big}
  def cast(service, node, term), do: serve(service, node, term)

  defp serve(service, to, term) when service in [:rows, :stop] do
    if :erlang.external_size(term) > Packet.largest(),
      do: {:error, :too_big},
      else: radio({:serve, service, to, term})
  end

  @doc "Tells a connected node where this one is to be heard, and so gets to hear it."
  @spec introduce(node()) :: :ok
  def introduce(node), do: radio({:introduce, node})

  @doc "The robots of other nodes that were heard within the last 2 s, and their nodes."
  @spec robots() :: %{atom() => node()}
  def robots do
    heard = {{:robot, :"$1"}, :"$2", :_, :_, :"$3"}
    lately = {:>, :"$3", now() - @gone_ms}
    Map.new(SafeTable.select(__MODULE__, [{heard, [lately], [{{:"$1", :"$2"}}]}]))
  end

  @doc "The robots of nodes that are not heard here, but by others that are: commands reach them by those."
  @spec beyond() :: [atom()]
  def beyond do
    case node_table() do
      nil -> []
      {node_table, _roster} -> Routing.beyond(node_table, now())
    end
  end

  @doc "The newest heartbeat heard of a robot of another node: `{boot, sequence, age_ms}`."
  @spec beat(atom()) :: {integer(), non_neg_integer(), age_ms :: non_neg_integer()} | nil
  def beat(robot) do
    case SafeTable.lookup(__MODULE__, {:robot, robot}) do
      [{_key, _node, boot, sequence, at_ms}] -> {boot, sequence, now() - at_ms}
      [] -> nil
    end
  end

  @doc "Who is there, as seen from here."
  @spec view() :: view()
  def view do
    case node_table() do
      nil -> %{number: 0, nodes: %{}}
      {node_table, roster} -> view(node_table, roster, now(), Node.list())
    end
  end

  @doc "What was dropped, by reason, since the start."
  @spec rejected() :: %{atom() => pos_integer()}
  def rejected do
    case SafeTable.lookup(__MODULE__, :node_table) do
      [{:node_table, _book, _roster, rejected}] -> rejected
      [] -> %{}
    end
  end

  @doc "How many datagrams the radio has sent, heard and rejected, and its UDP port; `nil` without a network."
  @spec counts() ::
          %{
            sent: non_neg_integer(),
            heard: non_neg_integer(),
            rejected: %{atom() => pos_integer()},
            port: :inet.port_number() | nil
          }
          | {:error, line :: String.t()}
  def counts do
    case SafeTable.lookup(__MODULE__, :radio) do
      [{:radio, pid}] -> Nonblocking.call(pid, :counts, "the radio of this node")
      [] -> {:error, "this node has no mesh"}
    end
  end

  @doc "Whether a node is known and has not been heard for a second, whatever its connection says."
  @spec silent?(node()) :: boolean()
  def silent?(node) do
    with {node_table, _roster} <- node_table(),
         name = Atom.to_string(node),
         true <- is_map_key(node_table.nodes, name) do
      NodeTable.status(node_table, name, now()) != :alive
    else
      _unknown -> false
    end
  end

  @doc """
  Sends a link's request to a robot that this node has no connection to, or a silent one, over others that
  have (`Swarm.Mesh.CommandRelay`). `ref` is the alias in it that is to be answered.
  """
  @spec relay(atom(), tuple(), reference()) :: :ok | {:error, :unknown | :no_way}
  def relay(robot, request, ref) do
    with {node_table, roster} <- node_table(),
         name when name != nil <- Routing.holder(node_table, robot) do
      links = for node <- Node.list(), do: Atom.to_string(node)

      ways =
        for {from, to} <- Routing.ways(node_table, links, now()),
            {:ok, node} <- [Roster.node(roster, from)],
            into: %{},
            do: {node, nodes(to, roster)}

      CommandRelay.send(Map.fetch!(roster.nodes, name), ways, robot, request, ref)
    else
      nil -> {:error, :unknown}
    end
  end

  # The table goes with the radio that made it; in between there is none.
  defp radio(request) do
    case SafeTable.lookup(__MODULE__, :radio) do
      [{:radio, pid}] -> GenServer.cast(pid, request)
      [] -> :ok
    end
  end

  defp node_table do
    case SafeTable.lookup(__MODULE__, :node_table) do
      [{:node_table, node_table, roster, _rejected}] -> {node_table, roster}
      [] -> nil
    end
  end

  defp view(node_table, roster, now_ms, connected) do
    nodes =
      for {name, entry} <- node_table.nodes, into: %{} do
        node = Map.fetch!(roster.nodes, name)
        robots = for {id, {at_ms, _, _}} <- entry.robots, now_ms - at_ms < @gone_ms, do: id

        {node,
         %{
           status: NodeTable.status(node_table, name, now_ms),
           connected: node in connected,
           hears: nodes(entry.hears, roster),
           robots: Enum.sort(robots),
           age_ms: now_ms - entry.heard_ms
         }}
      end

    %{number: node_table.number, nodes: nodes}
  end

  defp nodes(names, roster),
    do: for(name <- names, {:ok, node} <- [Roster.node(roster, name)], do: node)

  defp now, do: System.monotonic_time(:millisecond)
end
