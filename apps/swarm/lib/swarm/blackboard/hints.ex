defmodule Swarm.Blackboard.Hints do
  @moduledoc """
  Hints that all robots share (`Swarm.Blackboard.Stigmergy`), in one process a node, readable without asking it.

      Swarm.Blackboard.Hints.put(:mag1, {:searched, 7}, %{x: 2.0, y: 1.0})
      Swarm.Blackboard.Hints.get({:searched, 7})           # on any node
      {:ok, %{x: 2.0, y: 1.0}, :mag1}
      Swarm.Blackboard.Hints.delete(:mag2, {:searched, 7})

  Whoever writes last wins, by a count and not by a clock. A hint is small, 1,000 bytes, and there are
  256 of them. They are pushed to all other nodes at once; once a second each node compares with two
  others, and both give what the other lacks. They live as long as a node is there that has them.

  Options of `start_link/1`: `:name`, `:transport`, `:nodes`, `:repair_ms`, `:seed` as of
  `Swarm.Blackboard`, and `:most` entries.
  """
  use GenServer
  alias Swarm.Nonblocking
  alias Swarm.Blackboard.Stigmergy
  alias Swarm.Directory.SafeTable
  alias Swarm.Message.WireTypes
  alias Swarm.Blackboard

  @peers 2
  @bytes 1_000

  @doc "Starts a node's hints."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options \\ []) do
    options = Keyword.validate!(options, Blackboard.Gossip.options(__MODULE__) ++ [most: 256])
    GenServer.start_link(__MODULE__, options, name: options[:name])
  end

  @doc "A robot writes a hint; the key is an atom or a pair such as `{:searched, 7}`. Errors are one line."
  @spec put(atom(), atom(), Blackboard.Codec.key(), term()) :: :ok | {:error, line :: String.t()}
  def put(hints \\ __MODULE__, robot, key, value) do
    with :ok <- check(robot, key) do
      payload = Blackboard.Codec.encode(key, value)

      if byte_size(payload) <= @bytes,
        do: call(hints, {:put, Atom.to_string(robot), Blackboard.Codec.id(key), payload}),
        else:
          {:error,
           "the hint #{inspect(key)} cannot have #{byte_size(payload)} bytes; it may have #{@bytes}"}
    end
  end

  @doc "A robot takes a hint away, whoever wrote it."
  @spec delete(atom(), atom(), Blackboard.Codec.key()) :: :ok | {:error, line :: String.t()}
  def delete(hints \\ __MODULE__, robot, key) do
    with :ok <- check(robot, key),
         do: call(hints, {:put, Atom.to_string(robot), Blackboard.Codec.id(key), ""})
  end

  defp check(robot, key) do
    cond do
      not WireTypes.name?(robot) ->
        {:error, "#{inspect(robot)} is not a robot that could write a hint"}

      not Blackboard.Codec.key?(key) ->
        {:error, "#{inspect(key)} is not a key of a hint; write a name or {:searched, 7}"}

      true ->
        :ok
    end
  end

  @doc "A hint, and who wrote it."
  @spec get(atom(), Blackboard.Codec.key()) :: {:ok, term(), Blackboard.Codec.word()} | :error
  def get(hints \\ __MODULE__, key) do
    with [{_id, payload, robot}] <- SafeTable.lookup(hints, Blackboard.Codec.id(key)),
         {:ok, ^key, value} <- Blackboard.Codec.decode(payload) do
      {:ok, value, Blackboard.Codec.word(robot)}
    else
      _none -> :error
    end
  end

  @doc "All hints, by key, with who wrote each."
  @spec all(atom()) :: %{Blackboard.Codec.key() => {term(), Blackboard.Codec.word()}}
  def all(hints \\ __MODULE__) do
    for {_id, payload, robot} <- SafeTable.select(hints, [{:_, [], [:"$_"]}]),
        {:ok, key, value} <- [Blackboard.Codec.decode(payload)],
        into: %{},
        do: {key, {value, Blackboard.Codec.word(robot)}}
  end

  @doc "Something arrived from another node."
  @spec hear(GenServer.server(), node(), term()) :: :ok
  def hear(hints \\ __MODULE__, node, term), do: GenServer.cast(hints, {:hear, node, term})

  @doc "Compares with two others now."
  @spec repair(GenServer.server()) :: :ok
  def repair(hints \\ __MODULE__), do: GenServer.cast(hints, :repair)

  @doc "How many entries there are, tombstones too, and what was dropped."
  @spec info(GenServer.server()) :: map() | {:error, line :: String.t()}
  def info(hints \\ __MODULE__), do: call(hints, :info)

  defp call(hints, request),
    do: Nonblocking.call(hints, request, "the store of hints of this node")

  @impl GenServer
  def init(options) do
    :ets.new(options[:name], [:named_table, read_concurrency: true])

    s = %{
      table: options[:name],
      transport: options[:transport],
      nodes: options[:nodes],
      repair_ms: options[:repair_ms],
      rand: Blackboard.Gossip.seed(options[:seed]),
      hints: Stigmergy.new(options[:most]),
      dropped: 0
    }

    # One that starts anew among others asks at once for what it has lost.
    unless s.repair_ms == :never, do: send(self(), :repair)
    {:ok, s}
  end

  # It has a name that connected nodes can send to, so anything may come here.
  @impl GenServer
  def handle_call({:put, robot, id, payload}, _from, s) do
    if Stigmergy.entry?({id, 1, robot, payload}, @bytes) do
      s = show(%{s | hints: Stigmergy.put(s.hints, robot, id, payload, now())})
      Blackboard.Gossip.cast(s.transport, :hints, {:hints, Stigmergy.entries(s.hints, [id])})
      {:reply, :ok, s}
    else
      {:noreply, drop(s)}
    end
  end

  def handle_call(:info, _from, s),
    do: {:reply, %{entries: map_size(s.hints.entries), dropped: s.dropped}, s}

  def handle_call(_unknown, _from, s), do: {:noreply, drop(s)}

  @impl GenServer
  def handle_cast({:hear, node, term}, s), do: {:noreply, heard(s, node, term)}
  def handle_cast(:repair, s), do: {:noreply, repair_some(s)}
  def handle_cast(_unknown, s), do: {:noreply, drop(s)}

  @impl GenServer
  def handle_info(:repair, s) do
    {hints, _gone} = Stigmergy.forget(s.hints, now())
    {:noreply, %{s | hints: hints} |> repair_some() |> schedule()}
  end

  def handle_info(_unknown, s), do: {:noreply, drop(s)}

  # Everything that arrives is looked at before it is used: it may be anything.
  defp heard(s, _node, {:hints, entries}) do
    if WireTypes.list?(entries, &Stigmergy.entry?(&1, @bytes)) do
      case Stigmergy.merge(s.hints, entries, now()) do
        {hints, []} -> %{s | hints: hints}
        {hints, _changed} -> show(%{s | hints: hints})
      end
    else
      drop(s)
    end
  end

  defp heard(s, node, {:digest, digest}) do
    if WireTypes.list?(digest, &Stigmergy.id?/1) do
      for {bucket, stamps} <- Stigmergy.differing(s.hints, digest),
          do: Blackboard.Gossip.cast(s.transport, :hints, node, {:have, bucket, stamps})

      s
    else
      drop(s)
    end
  end

  defp heard(s, node, {:have, bucket, stamps}) when bucket in 0..15 do
    if WireTypes.list?(stamps, &Stigmergy.stamp?/1) do
      {lacked, wanted} = Stigmergy.diff(s.hints, bucket, stamps)
      answer(s, node, lacked)
      if wanted != [], do: Blackboard.Gossip.cast(s.transport, :hints, node, {:want, wanted})
      s
    else
      drop(s)
    end
  end

  defp heard(s, node, {:want, ids}) do
    if WireTypes.list?(ids, &Stigmergy.id?/1),
      do: answer(s, node, Stigmergy.entries(s.hints, Enum.uniq(ids))),
      else: drop(s)
  end

  defp heard(s, _node, _other), do: drop(s)

  defp answer(s, node, entries) do
    for part <- Blackboard.Codec.pack(entries),
        do: Blackboard.Gossip.cast(s.transport, :hints, node, {:hints, part})

    s
  end

  defp repair_some(s) do
    {nodes, rand} = Blackboard.Gossip.some(s.nodes, @peers, s.rand)
    digest = {:digest, Stigmergy.digest(s.hints)}
    for node <- nodes, do: Blackboard.Gossip.cast(s.transport, :hints, node, digest)
    %{s | rand: rand}
  end

  # Small enough to follow as a whole: who reads never finds it empty between.
  defp show(s) do
    shown =
      for {id, {{_, robot, _}, payload, _}} <- s.hints.entries,
          payload != "",
          do: {id, payload, robot}

    :ets.insert(s.table, shown)

    for {id, _, _} <- :ets.tab2list(s.table),
        Stigmergy.get(s.hints, id) == :error,
        do: :ets.delete(s.table, id)

    s
  end

  defp drop(s), do: %{s | dropped: s.dropped + 1}
  defp now, do: System.monotonic_time(:millisecond)

  defp schedule(s), do: %{s | rand: Blackboard.Gossip.repair_later(s.repair_ms, s.rand)}
end
