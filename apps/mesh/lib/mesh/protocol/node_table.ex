defmodule Mesh.Protocol.NodeTable do
  @moduledoc false
  # Records what a node knows about the others: their addresses, when they were heard, the nodes that they
  # hear and are connected to, and the robots that they hold. Pure; times are this node's own, in
  # ms.
  #
  # The address of a node that others hear, but this one does not, is a lead: it gets beacons, too.
  #
  # A node is suspect after 1 s of silence and gone after 2 s; only datagrams decide that, never a
  # connection. A node that is gone stays in the table and is sent beacons for ever. The view's
  # number grows with each node that comes or goes.
  alias Mesh.Backoff

  @suspect_ms 1_000
  @gone_ms 2_000
  # More names than any fleet has: further ones are not stored.
  @most 1_100
  # The interval of beacons to nodes that are heard, although there may be heartbeats, too.
  @beacon_ms 1_000

  @enforce_keys [:me]
  defstruct @enforce_keys ++ [nodes: %{}, leads: %{}, number: 0]

  @type name :: String.t()
  @type status :: :alive | :suspect | :gone
  @type entry :: %{
          address: Mesh.Strategy.address(),
          heard_ms: integer(),
          status: status(),
          hears: [name()],
          links: [name()],
          port: 0..65_535,
          robots: %{atom() => {at_ms :: integer(), boot :: integer(), sequence :: integer()}},
          probe: Backoff.t()
        }
  @type t :: %__MODULE__{
          me: name(),
          nodes: %{name() => entry()},
          leads: %{name() => {Mesh.Strategy.address(), Backoff.t()}},
          number: non_neg_integer()
        }

  @doc "An empty node table."
  @spec new(name()) :: t()
  def new(me), do: %__MODULE__{me: me}

  @doc """
  Notes that a fresh datagram of a node was heard from this address, which that datagram names as
  one of the node's own. Returns what has changed.
  """
  @spec hear(t(), name(), Mesh.Strategy.address(), integer()) :: {t(), [{:up, name()}]}
  def hear(%{me: me} = node_table, me, _address, _now_ms), do: {node_table, []}

  def hear(node_table, name, address, now_ms) do
    case node_table.nodes do
      %{^name => %{status: :alive} = entry} ->
        {put(node_table, name, %{entry | address: address, heard_ms: now_ms}), []}

      %{^name => %{status: status} = entry} ->
        entry = %{entry | address: address, heard_ms: now_ms, status: :alive}
        up(node_table, name, entry, if(status == :gone, do: 1, else: 0))

      _unknown ->
        entry = %{
          address: address,
          heard_ms: now_ms,
          status: :alive,
          hears: [],
          links: [],
          port: 0,
          robots: %{},
          probe: Backoff.new(now_ms)
        }

        up(node_table, name, entry, 1)
    end
  end

  @doc "Takes in a beacon of an admitted node: the nodes that it hears and is connected to."
  @spec beacon(t(), name(), Mesh.Protocol.Beacon.t(), integer()) :: t()
  def beacon(node_table, name, beacon, now_ms) do
    case node_table.nodes do
      %{^name => entry} ->
        hears = for {name, _address} <- beacon.hears, do: name
        entry = %{entry | hears: hears, links: beacon.links, port: beacon.port}
        node_table = put(node_table, name, entry)
        Enum.reduce(beacon.hears, node_table, &lead(&2, &1, now_ms))

      _rival_of_this_name ->
        node_table
    end
  end

  # A node that was heard here has an entry with its own address; if it has moved, the other
  # address is the newer lead.
  defp lead(%{me: me} = node_table, {me, _address}, _now_ms), do: node_table

  defp lead(node_table, {name, address}, now_ms) do
    case node_table do
      %{nodes: %{^name => %{status: status, address: known}}}
      when status != :gone or known == address ->
        %{node_table | leads: Map.delete(node_table.leads, name)}

      %{leads: %{^name => {^address, _backoff}}} ->
        node_table

      %{leads: leads} when map_size(leads) >= @most ->
        node_table

      _news ->
        %{node_table | leads: Map.put(node_table.leads, name, {address, Backoff.new(now_ms)})}
    end
  end

  @doc "Notes a heartbeat of a robot on that node."
  @spec robot(t(), name(), atom(), {boot :: integer(), sequence :: integer()}, integer()) :: t()
  def robot(node_table, name, id, {boot, sequence}, now_ms) do
    case node_table.nodes do
      %{^name => entry} ->
        robots = Map.put(entry.robots, id, {now_ms, boot, sequence})
        put(node_table, name, %{entry | robots: robots})

      _rival ->
        node_table
    end
  end

  @doc "The state of a node, judged by its silence."
  @spec status(t(), name(), integer()) :: status()
  def status(node_table, name, now_ms) do
    case node_table.nodes do
      %{^name => %{heard_ms: heard_ms}} -> status(heard_ms, now_ms)
      _unknown -> :gone
    end
  end

  @doc """
  The same for a node that was last heard then.

      iex> for now_ms <- [999, 1_000, 2_000], do: Mesh.Protocol.NodeTable.status(0, now_ms)
      [:alive, :suspect, :gone]
  """
  @spec status(heard_ms :: integer(), now_ms :: integer()) :: status()
  def status(heard_ms, now_ms) when now_ms - heard_ms < @suspect_ms, do: :alive
  def status(heard_ms, now_ms) when now_ms - heard_ms < @gone_ms, do: :suspect
  def status(_heard_ms, _now_ms), do: :gone

  @doc "The time since when a node must have been heard to count as alive now."
  @spec alive_since(now_ms :: integer()) :: integer()
  def alive_since(now_ms), do: now_ms - @suspect_ms + 1

  @doc "The nodes that this node hears, and their addresses, sorted."
  @spec hears(t(), integer()) :: [{name(), Mesh.Strategy.address()}]
  def hears(node_table, now_ms) do
    Enum.sort(
      for {name, entry} <- node_table.nodes,
          status(node_table, name, now_ms) == :alive,
          do: {name, entry.address}
    )
  end

  @doc "The changes by time: the nodes that have become suspect, or are gone."
  @spec age(t(), integer()) :: {t(), [{:suspect | :gone, name()}]}
  def age(node_table, now_ms) do
    for {name, entry} <- Enum.sort(node_table.nodes),
        status = status(node_table, name, now_ms),
        status != entry.status,
        reduce: {node_table, []} do
      {node_table, changes} ->
        number = if status == :gone, do: node_table.number + 1, else: node_table.number
        probe = if status == :gone, do: Backoff.new(now_ms), else: entry.probe

        node_table =
          put(%{node_table | number: number}, name, %{entry | status: status, probe: probe})

        {node_table, changes ++ [{status, name}]}
    end
  end

  @doc """
  The addresses that get a beacon now: nodes that are heard once a second, or each time if
  `often?`; nodes that are not heard, and leads, at growing intervals.
  """
  @spec due(t(), boolean(), integer(), float()) :: {[Mesh.Strategy.address()], t()}
  def due(node_table, often?, now_ms, chance) do
    {due, node_table} = follow(node_table, now_ms, chance)

    for {name, entry} <- Enum.sort(node_table.nodes), reduce: {due, node_table} do
      {due, node_table} ->
        cond do
          entry.status != :gone and (often? or Backoff.due?(entry.probe, now_ms)) ->
            probe = %{entry.probe | due_ms: now_ms + @beacon_ms}
            {[entry.address | due], put(node_table, name, %{entry | probe: probe})}

          entry.status == :gone and Backoff.due?(entry.probe, now_ms) ->
            probe = Backoff.tried(entry.probe, now_ms, chance)
            {[entry.address | due], put(node_table, name, %{entry | probe: probe})}

          true ->
            {due, node_table}
        end
    end
  end

  defp follow(node_table, now_ms, chance) do
    for {name, {address, backoff}} <- Enum.sort(node_table.leads),
        Backoff.due?(backoff, now_ms),
        reduce: {[], node_table} do
      {due, node_table} ->
        lead = {address, Backoff.tried(backoff, now_ms, chance)}
        {[address | due], %{node_table | leads: Map.put(node_table.leads, name, lead)}}
    end
  end

  @doc """
  The addresses of all nodes that are not gone: each was shown to be the node's own by a signed and
  fresh datagram.
  """
  @spec addresses(t()) :: [Mesh.Strategy.address()]
  def addresses(node_table),
    do: for({_name, %{status: status, address: a}} <- node_table.nodes, status != :gone, do: a)

  @doc "The names of the nodes that hold these robots, as far as known from heartbeats."
  @spec holders(t(), [atom()]) :: [name()]
  def holders(node_table, ids),
    do:
      for(
        {name, %{robots: robots}} <- node_table.nodes,
        Enum.any?(ids, &is_map_key(robots, &1)),
        do: name
      )

  # A node that was only suspect was in the view all the time.
  defp up(node_table, name, entry, news) do
    node_table = %{
      node_table
      | number: node_table.number + news,
        leads: Map.delete(node_table.leads, name)
    }

    {put(node_table, name, entry), [{:up, name}]}
  end

  defp put(node_table, name, entry),
    do: %{node_table | nodes: Map.put(node_table.nodes, name, entry)}
end
