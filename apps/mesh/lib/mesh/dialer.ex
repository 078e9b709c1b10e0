defmodule Mesh.Dialer do
  @moduledoc """
  Connects this node's distribution to the nodes that the topology names, and retries for ever,
  with back-off. A connection attempt blocks for seconds if packets get lost, so each has a
  process of its own, and at most four run at once.

  This does not decide whether a node is alive: datagrams do (`Mesh.Protocol.NodeTable`).
  """
  use GenServer
  alias Hal.{Event, Ticker}
  alias Mesh.{Backoff, Options}
  alias Mesh.Protocol.Roster
  alias Mesh.Distribution.Topology

  @tick_ms 200
  # How long the node that should dial has time to connect before the other tries.
  @grace_ms 3_000
  @at_once 4
  # In ticks: how often this node's address is sent to a node that is connected, but not heard.
  @introduce_every 25

  @doc "Starts the dialer of this node."
  @spec start_link(Options.t()) :: GenServer.on_start()
  def start_link(%Options{} = options),
    do: GenServer.start_link(__MODULE__, options, name: __MODULE__)

  @doc "Tells the dialer about a node."
  @spec note(:up | :suspect | :gone, node()) :: :ok
  def note(change, node), do: GenServer.cast(__MODULE__, {:note, change, node})

  @doc "The nodes that this one is connected to, sorted."
  @spec links() :: [node()]
  def links, do: Enum.sort(Node.list())

  @impl GenServer
  def init(options) do
    :ok = :net_kernel.monitor_nodes(true)
    now = Hal.Clock.now_ms()
    chance = :rand.seed_s(:exsss, :erlang.phash2(node()))

    # A previous dialer may already have been told about nodes.
    known = for node <- Map.keys(Mesh.view().nodes), into: %{}, do: {node, row(now)}
    roster = Roster.new(node(), options.fleet)

    {:ok,
     %{
       options: options,
       roster: roster,
       known: known,
       dialling: %{},
       chance: chance,
       ticks: 1,
       ticker: Ticker.start(:tick, @tick_ms, @tick_ms)
     }}
  end

  @impl GenServer
  def handle_call(_unknown, _from, s), do: {:noreply, s}

  @impl GenServer
  def handle_cast({:note, :up, node}, s) do
    case Roster.enter(s.roster, Atom.to_string(node)) do
      {:ok, _node, roster} ->
        known = Map.put(s.known, node, row(Hal.Clock.now_ms()))
        {:noreply, dial(%{s | known: known, roster: roster})}

      :error ->
        {:noreply, s}
    end
  end

  def handle_cast(_silent_or_unknown, s), do: {:noreply, s}

  @impl GenServer
  def handle_info(:tick, s) do
    if rem(s.ticks, @introduce_every) == 0, do: introduce()
    s = dial(%{s | ticks: s.ticks + 1})
    {:noreply, %{s | ticker: Ticker.next(s.ticker)}}
  end

  def handle_info({:nodeup, node}, s) when is_atom(node) do
    Event.execute([:mesh, :connected], %{at_ms: Hal.Clock.now_ms()}, %{node: node})
    Mesh.introduce(node)
    {:noreply, s}
  end

  def handle_info({:nodedown, node}, s) when is_atom(node) do
    Event.execute([:mesh, :disconnected], %{at_ms: Hal.Clock.now_ms()}, %{node: node})
    now = Hal.Clock.now_ms()

    known =
      case s.known do
        %{^node => row} -> %{s.known | node => %{row | since_ms: now, backoff: Backoff.new(now)}}
        known -> known
      end

    {:noreply, dial(%{s | known: known})}
  end

  def handle_info({:DOWN, monitor, :process, _pid, _reason}, s),
    do: {:noreply, %{s | dialling: Map.delete(s.dialling, monitor)}}

  def handle_info(_unknown, s), do: {:noreply, s}

  defp row(now), do: %{since_ms: now, backoff: Backoff.new(now)}

  # A node that is connected, by any means, should be heard, too.
  defp introduce do
    for node <- links() -- Mesh.alive(), do: Mesh.introduce(node)
  end

  defp dial(s) do
    now = Hal.Clock.now_ms()
    busy = Map.values(s.dialling)

    wanted(s)
    |> Enum.reject(&(&1 in busy))
    |> Enum.filter(&due?(s.known[&1], &1, now))
    |> Enum.take(@at_once - length(busy))
    |> Enum.reduce(s, &attempt(&1, &2, now))
  end

  defp wanted(s) do
    names = Map.new(s.known, fn {node, _row} -> {Atom.to_string(node), node} end)
    %{full_mesh: full_mesh, degree: degree} = s.options
    peers = Topology.peers(Atom.to_string(node()), Map.keys(names), full_mesh, degree)
    Enum.map(peers, &Map.fetch!(names, &1)) -- links()
  end

  defp due?(row, node, now) do
    mine? = Topology.dials?(Atom.to_string(node()), Atom.to_string(node))
    (mine? or now - row.since_ms >= @grace_ms) and Backoff.due?(row.backoff, now)
  end

  defp attempt(node, s, now) do
    {_pid, monitor} = spawn_monitor(fn -> :net_kernel.connect_node(node) end)
    {chance, state} = :rand.uniform_s(s.chance)
    row = s.known[node]
    row = %{row | backoff: Backoff.tried(row.backoff, now, chance)}

    %{
      s
      | known: Map.put(s.known, node, row),
        chance: state,
        dialling: Map.put(s.dialling, monitor, node)
    }
  end
end
