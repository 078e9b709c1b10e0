defmodule Swarm.Mesh.NodeTable do
  @moduledoc """
  What a node knows of the others: where they are, when they were heard, whom they hear, whose
  distribution they are connected to, and which robots they hold. Pure; times are this node's own, in ms.

  Of nodes that others hear, and this one does not, the address is a lead: they get beacons too.

  A node is suspect after 1 s of silence and gone after 2 s; what decides is datagrams, never a
  connection. One that is gone stays in the book and is sent beacons for ever. The view's number
  grows with each node that comes or goes.
  """
  alias Swarm.Mesh.Backoff

  @suspect_ms 1_000
  @gone_ms 2_000
  # More names than any fleet has: what is told beyond that is not kept.
  @most 1_100
  # A beacon to those that are there, though there may be heartbeats too.
  @beacon_ms 1_000

  @enforce_keys [:me]
  defstruct @enforce_keys ++ [nodes: %{}, leads: %{}, claims: %{}, told: %{}, number: 0]

  @type name :: String.t()
  @type status :: :alive | :suspect | :gone
  @type entry :: %{
          address: Swarm.Mesh.Strategy.address(),
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
          leads: %{name() => {Swarm.Mesh.Strategy.address(), Backoff.t()}},
          claims: %{name() => non_neg_integer()},
          told: %{name() => non_neg_integer()},
          number: non_neg_integer()
        }

  @doc "An empty book."
  @spec new(name()) :: t()
  def new(me), do: %__MODULE__{me: me}

  @doc "A node was heard from there. Tells what has changed by that."
  @spec hear(t(), name(), Swarm.Mesh.Strategy.address(), integer()) :: {t(), [{:up, name()}]}
  def hear(%{me: me} = book, me, _address, _now_ms), do: {book, []}

  def hear(book, name, address, now_ms) do
    case book.nodes do
      %{^name => %{status: :alive} = entry} ->
        {put(book, name, %{entry | address: address, heard_ms: now_ms}), []}

      %{^name => %{status: status} = entry} ->
        entry = %{entry | address: address, heard_ms: now_ms, status: :alive}
        up(book, name, entry, if(status == :gone, do: 1, else: 0))

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

        up(book, name, entry, 1)
    end
  end

  @doc "Somebody signed as this name says that this is its session; it may be an old recording."
  @spec claim(t(), name(), non_neg_integer()) :: t()
  def claim(book, name, session), do: %{book | claims: Map.put(book.claims, name, session)}

  @doc "A beacon of a node that is let in: whom it hears, what it is connected to."
  @spec beacon(t(), name(), Swarm.Mesh.Beacon.t(), integer()) :: t()
  def beacon(book, name, beacon, now_ms) do
    told = Map.delete(Map.new(beacon.sessions), book.me)

    case book.nodes do
      %{^name => entry} ->
        hears = for {name, _address} <- beacon.hears, do: name
        entry = %{entry | hears: hears, links: beacon.links, port: beacon.port}
        told = Map.merge(book.told, told)
        book = put(book, name, entry)
        book = if map_size(told) <= @most, do: %{book | told: told}, else: book
        Enum.reduce(beacon.hears, book, &lead(&2, &1, now_ms))

      _rival_of_this_name ->
        book
    end
  end

  # One that was heard here has an entry with an address of its own, which is the newer lead when it
  # has moved.
  defp lead(%{me: me} = book, {me, _address}, _now_ms), do: book

  defp lead(book, {name, address}, now_ms) do
    case book do
      %{nodes: %{^name => %{status: status, address: known}}}
      when status != :gone or known == address ->
        %{book | leads: Map.delete(book.leads, name)}

      %{leads: %{^name => {^address, _backoff}}} ->
        book

      %{leads: leads} when map_size(leads) >= @most ->
        book

      _news ->
        %{book | leads: Map.put(book.leads, name, {address, Backoff.new(now_ms)})}
    end
  end

  @doc "A heartbeat of a robot on that node."
  @spec robot(t(), name(), atom(), {boot :: integer(), sequence :: integer()}, integer()) :: t()
  def robot(book, name, id, {boot, sequence}, now_ms) do
    case book.nodes do
      %{^name => entry} ->
        robots = Map.put(entry.robots, id, {now_ms, boot, sequence})
        put(book, name, %{entry | robots: robots})

      _rival ->
        book
    end
  end

  @doc """
  The sessions to tell in a beacon: of those that are let in, of those that ask for it, and, of those that
  are not heard here, what others tell.
  """
  @spec sessions(t(), let_in :: %{name() => non_neg_integer()}, integer()) ::
          [{name(), non_neg_integer()}]
  def sessions(book, let_in, now_ms) do
    alive = Map.filter(let_in, fn {name, _} -> status(book, name, now_ms) == :alive end)
    book.told |> Map.merge(let_in) |> Map.merge(book.claims) |> Map.merge(alive) |> Enum.sort()
  end

  @doc "How a node is, by its silence."
  @spec status(t(), name(), integer()) :: status()
  def status(book, name, now_ms) do
    case book.nodes do
      %{^name => %{heard_ms: at_ms}} when now_ms - at_ms < @suspect_ms -> :alive
      %{^name => %{heard_ms: at_ms}} when now_ms - at_ms < @gone_ms -> :suspect
      _silent -> :gone
    end
  end

  @doc "Whom this node hears, and from where, sorted."
  @spec hears(t(), integer()) :: [{name(), Swarm.Mesh.Strategy.address()}]
  def hears(book, now_ms) do
    Enum.sort(
      for {name, entry} <- book.nodes,
          status(book, name, now_ms) == :alive,
          do: {name, entry.address}
    )
  end

  @doc "What time has changed: who has become suspect, who is gone."
  @spec age(t(), integer()) :: {t(), [{:suspect | :gone, name()}]}
  def age(book, now_ms) do
    for {name, entry} <- Enum.sort(book.nodes),
        status = status(book, name, now_ms),
        status != entry.status,
        reduce: {book, []} do
      {book, changes} ->
        number = if status == :gone, do: book.number + 1, else: book.number
        probe = if status == :gone, do: Backoff.new(now_ms), else: entry.probe
        book = put(%{book | number: number}, name, %{entry | status: status, probe: probe})
        {book, changes ++ [{status, name}]}
    end
  end

  @doc """
  The addresses that get a beacon now: those that are there once a second, or each time when `often?`;
  those that are not, and leads, at growing intervals.
  """
  @spec due(t(), boolean(), integer(), float()) :: {[Swarm.Mesh.Strategy.address()], t()}
  def due(book, often?, now_ms, chance) do
    {due, book} = follow(book, now_ms, chance)

    for {name, entry} <- Enum.sort(book.nodes), reduce: {due, book} do
      {due, book} ->
        cond do
          entry.status != :gone and (often? or Backoff.due?(entry.probe, now_ms)) ->
            probe = %{entry.probe | due_ms: now_ms + @beacon_ms}
            {[entry.address | due], put(book, name, %{entry | probe: probe})}

          entry.status == :gone and Backoff.due?(entry.probe, now_ms) ->
            probe = Backoff.tried(entry.probe, now_ms, chance)
            {[entry.address | due], put(book, name, %{entry | probe: probe})}

          true ->
            {due, book}
        end
    end
  end

  defp follow(book, now_ms, chance) do
    for {name, {address, backoff}} <- Enum.sort(book.leads),
        Backoff.due?(backoff, now_ms),
        reduce: {[], book} do
      {due, book} ->
        lead = {address, Backoff.tried(backoff, now_ms, chance)}
        {[address | due], %{book | leads: Map.put(book.leads, name, lead)}}
    end
  end

  @doc "The addresses of all that are not gone."
  @spec addresses(t()) :: [Swarm.Mesh.Strategy.address()]
  def addresses(book),
    do: for({_name, %{status: status, address: a}} <- book.nodes, status != :gone, do: a)

  @doc "The names of the nodes that hold these robots, as far as they were heard."
  @spec holders(t(), [atom()]) :: [name()]
  def holders(book, ids),
    do:
      for(
        {name, %{robots: robots}} <- book.nodes,
        Enum.any?(ids, &is_map_key(robots, &1)),
        do: name
      )

  # One that was only suspect was in the view all the time.
  defp up(book, name, entry, news) do
    book = %{book | number: book.number + news, leads: Map.delete(book.leads, name)}
    {put(book, name, entry), [{:up, name}]}
  end

  defp put(book, name, entry), do: %{book | nodes: Map.put(book.nodes, name, entry)}
end
