defmodule Swarm.Blackboard.Server do
  @moduledoc false
  # Runs the process of `Swarm.Blackboard`: keeps the rows, and a table for readers; pushes what is
  # written here, stores what arrives, and repairs what was lost.
  use GenServer
  alias Hal.Event
  alias Swarm.Blackboard
  alias Swarm.Blackboard.{AntiEntropy, Rows}
  alias Swarm.Wire

  # The number of nodes that get each digest.
  @peers 2
  @firsts 1_000_000

  @impl GenServer
  def init(options) do
    # Sorted, so that the rows of one robot are found without looking at all.
    :ets.new(options[:name], [:ordered_set, :named_table, read_concurrency: true])

    {first, rand} = :rand.uniform_s(@firsts, seed(options[:seed]))

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
      dropped: 0,
      timer: nil
    }

    # A board that starts again among others asks at once for what it has lost.
    unless s.repair_ms == :never, do: send(self(), :repair)
    {:ok, s}
  end

  # It has a name that connected nodes can send to, so anything may arrive here.
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

  def handle_call({:hint, writer, key, payload}, _from, s)
      when is_binary(writer) and byte_size(writer) in 1..255 and is_binary(payload) do
    id = Blackboard.Codec.id(key)

    case Blackboard.State.put_hint(s.rows, writer, id, payload, Hal.Clock.now_ms()) do
      {:ok, rows} -> {:reply, :ok, written(%{s | rows: rows}, Rows.bucket(id), id)}
      {:error, reason} -> {:reply, {:error, line(reason, writer, key, payload, s)}, s}
    end
  end

  def handle_call(:info, _from, s) do
    hints = map_size(s.rows.hints)
    rows = :ets.info(s.table, :size) - hints
    {:reply, %{robots: map_size(s.rows.robots), rows: rows, hints: hints, dropped: s.dropped}, s}
  end

  def handle_call(_unknown, _from, s), do: {:noreply, drop(s, 1)}

  @impl GenServer
  def handle_cast({:note, owner, robot, boot, pairs}, s) when is_owner(owner, robot, boot) do
    if Wire.list?(pairs, &match?({_key, payload} when is_binary(payload), &1)),
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
    {rows, gone} = Blackboard.State.forget(s.rows, Hal.Clock.now_ms())

    {:noreply,
     %{s | rows: rows}
     |> show(for {owner, _key} <- gone, uniq: true, do: owner)
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
    {rows, notes} = Blackboard.State.enter(s.rows, robot, boot, Hal.Clock.now_ms())
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

    with {:ok, rows} <- Blackboard.State.put(s.rows, robot, id, payload, Hal.Clock.now_ms()),
         do: {:ok, written(%{s | rows: rows}, robot, id)}
  end

  defp written(s, owner, id), do: s |> show([owner]) |> say_soon(owner, id)

  defp line(:not_own, robot, _key, _payload, _s),
    do:
      "#{inspect(robot)} is not a robot of this node; each robot writes its own rows, on its node"

  defp line(:bytes, _robot, key, payload, s), do: large("row", key, payload, s.rows.limits.bytes)

  defp line(:hint_bytes, _robot, key, payload, s),
    do: large("hint", key, payload, s.rows.limits.hint_bytes)

  defp line(:keys, robot, _key, _payload, s),
    do: "#{robot} cannot have more rows; it already has #{s.rows.limits.keys}"

  defp large(what, key, payload, most),
    do: "the #{what} #{inspect(key)} cannot have #{byte_size(payload)} bytes; it may have #{most}"

  # Several rows written at once share a datagram.
  defp say_soon(s, owner, id) do
    if s.unsaid == [], do: send(self(), :push)
    if {owner, id} in s.unsaid, do: s, else: %{s | unsaid: [{owner, id} | s.unsaid]}
  end

  defp push(s) do
    terms = s |> rows(Enum.reverse(s.unsaid)) |> Blackboard.Codec.tell()
    Blackboard.Gossip.cast(s.transport, :all, terms)
    %{s | unsaid: []}
  end

  defp rows(s, ids) do
    now_ms = Hal.Clock.now_ms()
    for {owner, id} <- ids, row <- Rows.rows(s.rows, owner, id, now_ms), do: row
  end

  defp heard(s, node, {:rows, rows}) do
    {rows, notes} = Blackboard.State.merge(s.rows, rows, Hal.Clock.now_ms())
    noted(%{s | rows: rows}, notes, node)
  end

  defp heard(s, node, {:digest, first, until, digest}) do
    owners = AntiEntropy.differing(s.rows, digest, first, until)
    answer(s, node, Blackboard.Codec.have(AntiEntropy.stamps(s.rows, owners)))
  end

  defp heard(s, node, {:have, stamps}) do
    {lacked, wanted} = AntiEntropy.diff(s.rows, stamps, Hal.Clock.now_ms())
    answer(s, node, Blackboard.Codec.tell(lacked) ++ Blackboard.Codec.want(wanted))
  end

  defp heard(s, node, {:want, wanted}),
    do: answer(s, node, s |> rows(Enum.uniq(wanted)) |> Blackboard.Codec.tell())

  defp answer(s, node, terms) do
    Blackboard.Gossip.cast(s.transport, [node], terms)
    s
  end

  defp send_digests(s) do
    {nodes, rand} = Blackboard.Gossip.some(s.nodes, @peers, s.rand)
    digest = Blackboard.Codec.digest(AntiEntropy.digest(s.rows))
    Blackboard.Gossip.cast(s.transport, nodes, digest)
    %{s | rand: rand}
  end

  defp noted(s, notes, from) do
    s = show(s, for({what, owner, _} <- notes, what in [:changed, :rival], uniq: true, do: owner))

    Enum.reduce(notes, s, fn
      {:again, robot}, s ->
        Enum.reduce(Map.keys(Rows.of(s.rows, robot)), s, &say_soon(&2, robot, &1))

      {:rival, robot, incarnation}, s ->
        rival(s, robot, incarnation, from)

      {:refused, _limit}, s ->
        drop(s, 1)

      {:changed, _robot, _key}, s ->
        s
    end)
  end

  # Reported once for each of its lives.
  defp rival(%{rivals: rivals} = s, robot, incarnation, from) do
    if rivals[robot] == incarnation do
      s
    else
      about = %{robot: robot, incarnation: incarnation, node: from}
      Event.execute([:swarm, :blackboard, :rival], %{}, about)
      %{s | rivals: Map.put(rivals, robot, incarnation)}
    end
  end

  # The table follows the rows; a reader never finds it empty in between.
  defp show(s, owners) do
    for {name, held} <- owners |> Enum.map(&held(s, &1)) |> Enum.uniq() do
      shown = for {id, {stamp, payload, at_ms}} <- held, do: {{name, id}, payload, at_ms, stamp}
      :ets.insert(s.table, shown)

      for id <- :ets.select(s.table, [{{{name, :"$1"}, :_, :_, :_}, [], [:"$1"]}]),
          not is_map_key(held, id),
          do: :ets.delete(s.table, {name, id})
    end

    s
  end

  defp held(s, robot) when is_atom(robot), do: {robot, Rows.of(s.rows, robot)}
  # One more in a bucket may mean one less in another.
  defp held(s, _bucket), do: {Rows.shown_as(), s.rows.hints}

  defp drop(s, count), do: %{s | dropped: s.dropped + count}

  defp seed(nil), do: :rand.seed_s(:exsss)
  defp seed(seed), do: :rand.seed_s(:exsss, seed)

  defp schedule(%{repair_ms: :never} = s), do: s

  # So that not all nodes send at the same time. One timer, however often it is asked for.
  defp schedule(s) do
    if s.timer, do: Process.cancel_timer(s.timer)
    {part, rand} = :rand.uniform_s(s.rand)
    timer = Process.send_after(self(), :repair, round(s.repair_ms * (0.75 + 0.5 * part)))
    %{s | rand: rand, timer: timer}
  end
end
