defmodule Swarm.Blackboard.Server do
  @moduledoc """
  The process of `Swarm.Blackboard`: keeps the rows, and a table that shows them to readers; pushes what is
  written here, takes what arrives, and repairs what was lost.
  """
  use GenServer
  alias Hal.Event
  alias Swarm.Blackboard
  alias Swarm.Message.WireTypes
  alias Swarm.Blackboard.AntiEntropy

  # Nodes that get each digest.
  @peers 2
  @firsts 1_000_000

  @impl GenServer
  def init(options) do
    # Sorted, so that the rows of one robot are found without looking at all.
    :ets.new(options[:name], [:ordered_set, :named_table, read_concurrency: true])

    {first, rand} = :rand.uniform_s(@firsts, Blackboard.Gossip.seed(options[:seed]))

    s = %{
      table: options[:name],
      transport: options[:transport],
      nodes: options[:nodes],
      repair_ms: options[:repair_ms],
      rows: Blackboard.State.new([first: first] ++ options[:limits]),
      rand: rand,
      owners: %{},
      rivals: %{},
      unsaid: [],
      dropped: 0
    }

    # One that starts anew among others asks at once for what it has lost.
    unless s.repair_ms == :never, do: send(self(), :repair)
    {:ok, s}
  end

  # It has a name that connected nodes can send to, so anything may come here.
  defguardp is_owner(pid, robot, boot)
            when is_pid(pid) and node(pid) == node() and is_atom(robot) and is_integer(boot) and
                   boot >= 0

  @impl GenServer
  def handle_call({:enter, robot, boot, owner}, _from, s) when is_owner(owner, robot, boot),
    do: {:reply, :ok, enter(s, owner, robot, boot)}

  def handle_call({:put, robot, key, payload}, _from, s) when is_binary(payload) do
    case put_one(s, robot, key, payload) do
      {:ok, s} -> {:reply, :ok, s}
      {:error, reason} -> {:reply, {:error, line(reason, robot, key, payload, s)}, s}
    end
  end

  def handle_call(:info, _from, s) do
    rows = :ets.info(s.table, :size)
    {:reply, %{robots: map_size(s.rows.robots), rows: rows, dropped: s.dropped}, s}
  end

  def handle_call(_unknown, _from, s), do: {:noreply, drop(s, 1)}

  @impl GenServer
  def handle_cast({:note, owner, robot, boot, pairs}, s) when is_owner(owner, robot, boot) do
    if WireTypes.list?(pairs, &match?({_key, payload} when is_binary(payload), &1)),
      do: {:noreply, s |> enter(owner, robot, boot) |> put_all(robot, pairs)},
      else: {:noreply, drop(s, 1)}
  end

  def handle_cast({:leave, robot}, s), do: {:noreply, end_of(s, robot)}

  def handle_cast({:hear, node, term}, s) do
    case Blackboard.Codec.read(term) do
      {heard, dropped} -> {:noreply, heard(drop(s, dropped), node, heard)}
      :error -> {:noreply, drop(s, 1)}
    end
  end

  def handle_cast(:repair, s), do: {:noreply, send_digests(s)}
  def handle_cast(_unknown, s), do: {:noreply, drop(s, 1)}

  @impl GenServer
  def handle_info(:push, s), do: {:noreply, push(s)}

  def handle_info(:repair, s) do
    {rows, gone} = Blackboard.State.forget(s.rows, now())

    {:noreply,
     %{s | rows: rows}
     |> show(for {robot, _key} <- gone, do: robot)
     |> send_digests()
     |> schedule()}
  end

  def handle_info({:DOWN, ref, :process, _owner, _reason}, s) do
    case Enum.find(s.owners, fn {_robot, {_pid, owner}} -> owner == ref end) do
      {robot, _owner} -> {:noreply, end_of(s, robot)}
      nil -> {:noreply, s}
    end
  end

  def handle_info(_unknown, s), do: {:noreply, drop(s, 1)}

  defp end_of(s, robot) do
    {owner, owners} = Map.pop(s.owners, robot)
    with {_pid, ref} <- owner, do: Process.demonitor(ref, [:flush])
    %{s | rows: Blackboard.State.leave(s.rows, robot), owners: owners}
  end

  defp enter(s, owner, robot, boot) do
    {rows, notes} = Blackboard.State.enter(s.rows, robot, boot, now())
    noted(%{s | rows: rows, owners: watch(s.owners, robot, owner)}, notes, nil)
  end

  defp watch(owners, robot, owner) do
    case owners do
      %{^robot => {^owner, _ref}} ->
        owners

      _other ->
        with %{^robot => {_former, ref}} <- owners, do: Process.demonitor(ref, [:flush])
        Map.put(owners, robot, {owner, Process.monitor(owner)})
    end
  end

  defp put_all(s, robot, pairs) do
    Enum.reduce(pairs, s, fn {key, payload}, s ->
      case put_one(s, robot, key, payload) do
        {:ok, s} -> s
        {:error, _over_a_limit} -> drop(s, 1)
      end
    end)
  end

  defp put_one(s, robot, key, payload) do
    id = Blackboard.Codec.id(key)

    with {:ok, rows} <- Blackboard.State.put(s.rows, robot, id, payload, now()),
         do: {:ok, %{s | rows: rows} |> show([robot]) |> say_soon(robot, id)}
  end

  defp line(:not_own, robot, _key, _payload, _s),
    do:
      "#{inspect(robot)} is not a robot of this node; each robot writes its own rows, on its node"

  defp line(:bytes, _robot, key, payload, s),
    do:
      "the row #{inspect(key)} cannot have #{byte_size(payload)} bytes; it may have #{s.rows.limits.bytes}"

  defp line(:keys, robot, _key, _payload, s),
    do: "#{robot} cannot have more rows; it has #{s.rows.limits.keys} already"

  # Several rows written at once share a datagram.
  defp say_soon(s, robot, id) do
    if s.unsaid == [], do: send(self(), :push)
    if {robot, id} in s.unsaid, do: s, else: %{s | unsaid: [{robot, id} | s.unsaid]}
  end

  defp push(s) do
    now_ms = now()

    rows =
      for {robot, id} <- Enum.reverse(s.unsaid),
          row <- Blackboard.State.rows(s.rows, robot, id, now_ms),
          do: row

    for term <- Blackboard.Codec.tell(rows), do: Blackboard.Gossip.cast(s.transport, :rows, term)
    %{s | unsaid: []}
  end

  defp heard(s, node, {:rows, rows}) do
    {rows, notes} = Blackboard.State.merge(s.rows, rows, now())
    noted(%{s | rows: rows}, notes, node)
  end

  defp heard(s, node, {:digest, first, until, digest}) do
    robots = AntiEntropy.differing(s.rows, digest, first, until)
    answer(s, node, Blackboard.Codec.have(AntiEntropy.stamps(s.rows, robots)))
  end

  defp heard(s, node, {:have, stamps}) do
    {lacked, wanted} = AntiEntropy.diff(s.rows, stamps, now())
    answer(s, node, Blackboard.Codec.tell(lacked) ++ Blackboard.Codec.want(wanted))
  end

  defp heard(s, node, {:want, wanted}) do
    now_ms = now()

    rows =
      for {robot, id} <- Enum.uniq(wanted),
          row <- Blackboard.State.rows(s.rows, robot, id, now_ms),
          do: row

    answer(s, node, Blackboard.Codec.tell(rows))
  end

  defp answer(s, node, terms) do
    for term <- terms, do: Blackboard.Gossip.cast(s.transport, :rows, node, term)
    s
  end

  defp send_digests(s) do
    {nodes, rand} = Blackboard.Gossip.some(s.nodes, @peers, s.rand)

    for node <- nodes,
        term <- Blackboard.Codec.digest(AntiEntropy.digest(s.rows)),
        do: Blackboard.Gossip.cast(s.transport, :rows, node, term)

    %{s | rand: rand}
  end

  defp noted(s, notes, from) do
    s = show(s, Enum.uniq(for {what, robot, _} <- notes, what in [:changed, :rival], do: robot))

    Enum.reduce(notes, s, fn
      {:again, robot}, s ->
        Enum.reduce(
          Blackboard.State.rows(s.rows, robot, now()),
          s,
          &say_soon(&2, robot, elem(&1, 1))
        )

      {:rival, robot, incarnation}, s ->
        rival(s, robot, incarnation, from)

      {:refused, _limit}, s ->
        drop(s, 1)

      {:changed, _robot, _key}, s ->
        s
    end)
  end

  # Told once of each life of it.
  defp rival(%{rivals: rivals} = s, robot, incarnation, from) do
    if rivals[robot] == incarnation do
      s
    else
      about = %{robot: robot, incarnation: incarnation, node: from}
      Event.execute([:swarm, :blackboard, :rival], %{}, about)
      %{s | rivals: Map.put(rivals, robot, incarnation)}
    end
  end

  # The table follows the rows.
  defp show(s, robots) do
    for robot <- robots do
      held = Map.get(s.rows.robots, robot, %{})

      :ets.insert(
        s.table,
        for({id, {_stamp, payload, at_ms}} <- held, do: {{robot, id}, payload, at_ms})
      )

      for id <- :ets.select(s.table, [{{{robot, :"$1"}, :_, :_}, [], [:"$1"]}]),
          not is_map_key(held, id),
          do: :ets.delete(s.table, {robot, id})
    end

    s
  end

  defp drop(s, count), do: %{s | dropped: s.dropped + count}
  defp now, do: System.monotonic_time(:millisecond)

  defp schedule(s), do: %{s | rand: Blackboard.Gossip.repair_later(s.repair_ms, s.rand)}
end
