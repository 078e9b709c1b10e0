defmodule Swarm.Blackboard do
  @moduledoc """
  What the robots of the fleet tell of themselves, on every node: `Swarm.Rows` in one process a node,
  readable by all without asking it.

      Swarm.Blackboard.put(:mag1, :door, %{open: true})        # on the node of mag1
      Swarm.Blackboard.get(:mag1, :door, 2_000)                # on any node
      {:ok, %{open: true}, 140}                                # 140 ms old

  What a robot puts is pushed to all other nodes at once. What was lost on the way is repaired: once
  a second each node sends a digest of all it has to two others, which answer with what they have of
  the robots that differ, and both send what the other lacks, of third parties too. So a row comes
  to nodes that the robot's own never reaches.

  A robot's rows are written on its node only, after it entered (`enter/2`; its link does that). Its
  life's number is in them. An event `[:swarm, :blackboard, :rival]` tells of another robot of the
  same name; what that one says is not taken over.

  Options of `start_link/1`, with their defaults:

    * `:name` - of the process and its table (`#{inspect(__MODULE__)}`)
    * `:transport` - `{m, f, a}`, called with `a ++ [:rows, term]` for all other nodes and `a ++
      [:rows, node, term]` for one (`{Swarm.Mesh, :cast, []}`)
    * `:nodes` - `{m, f, a}` that gives the nodes that are alive (of the mesh's view)
    * `:repair_ms` - between two digests (1,000; `:never` for tests that call `repair/1`)
    * `:limits` - as of `Swarm.Rows.new/1`
    * `:seed` - of the choice of nodes (a new one each time)
  """
  use GenServer
  alias Hal.Event
  alias Swarm.Rows
  alias Swarm.Rows.{Carrier, Wire}

  @repair_ms 1_000
  @peers 2
  @firsts 1_000_000

  @type age :: non_neg_integer()

  @doc "Starts a node's board."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options \\ []) do
    options =
      Keyword.validate!(options, [
        :seed,
        name: __MODULE__,
        transport: {Swarm.Mesh, :cast, []},
        nodes: {Carrier, :alive, []},
        repair_ms: @repair_ms,
        limits: []
      ])

    GenServer.start_link(__MODULE__, options, name: options[:name])
  end

  @doc """
  A robot of this node begins to write, in the life numbered `boot`; it ends when the calling
  process does.
  """
  @spec enter(GenServer.server(), atom(), non_neg_integer()) :: :ok | {:error, line :: String.t()}
  def enter(board \\ __MODULE__, robot, boot) when is_atom(robot) and is_integer(boot),
    do: call(board, {:enter, robot, boot, self()})

  @doc "A robot of this node writes no more; its rows stay, and grow old."
  @spec leave(GenServer.server(), atom()) :: :ok
  def leave(board \\ __MODULE__, robot), do: GenServer.cast(board, {:leave, robot})

  @doc """
  Writes a row of a robot of this node, and tells all nodes. The key is an atom or a pair such as
  `{:task, 3}`, the value any term of up to #{59_000} bytes. Errors are one line.
  """
  @spec put(atom(), atom(), Wire.key(), term()) :: :ok | {:error, line :: String.t()}
  def put(board \\ __MODULE__, robot, key, value) do
    if Wire.key?(key),
      do: call(board, {:put, robot, key, Wire.encode(key, value)}),
      else:
        {:error, "#{inspect(key)} is no key of a row; write a name such as :door or {:task, 3}"}
  end

  @doc false
  # What a robot's link tells ten times a second at most: enters, writes, and waits for nothing.
  @spec note(atom(), atom(), non_neg_integer(), [{Wire.key(), term()}]) :: :ok
  def note(board \\ __MODULE__, robot, boot, pairs) do
    pairs = for {key, value} <- pairs, do: {key, Wire.encode(key, value)}
    GenServer.cast(board, {:note, self(), robot, boot, pairs})
  end

  @doc "What a robot wrote last under this key, with its age in ms, unless that is over `max_age_ms`."
  @spec get(atom(), atom(), Wire.key(), age() | :infinity) :: {:ok, term(), age()} | :error
  def get(board \\ __MODULE__, robot, key, max_age_ms) do
    with [{_, payload, at_ms}] <- lookup(board, {robot, Wire.id(key)}),
         age when age <= max_age_ms <- age(at_ms),
         # Two keys may have one number.
         {:ok, ^key, value} <- Wire.decode(payload) do
      {:ok, value, age}
    else
      _none -> :error
    end
  end

  @doc "All rows of a robot, by key, with their ages in ms."
  @spec rows(atom(), atom()) :: %{Wire.key() => {term(), age()}}
  def rows(board \\ __MODULE__, robot) do
    for {_, payload, at_ms} <- select(board, [{{{robot, :_}, :_, :_}, [], [:"$_"]}]),
        {:ok, key, value} <- [Wire.decode(payload)],
        into: %{},
        do: {key, {value, age(at_ms)}}
  end

  @doc "The names of all robots of which there is a row, sorted."
  @spec robots(atom()) :: [atom()]
  def robots(board \\ __MODULE__),
    do: board |> select([{{{:"$1", :_}, :_, :_}, [], [:"$1"]}]) |> Enum.uniq() |> Enum.sort()

  @doc "Something arrived from another node."
  @spec hear(GenServer.server(), node(), term()) :: :ok
  def hear(board \\ __MODULE__, node, term), do: GenServer.cast(board, {:hear, node, term})

  @doc "Sends a digest to two others now."
  @spec repair(GenServer.server()) :: :ok
  def repair(board \\ __MODULE__), do: GenServer.cast(board, :repair)

  @doc "How many robots and rows there are, and what was dropped, for people and tests."
  @spec info(GenServer.server()) :: map() | {:error, line :: String.t()}
  def info(board \\ __MODULE__), do: call(board, :info)

  defp call(board, request) do
    GenServer.call(board, request)
  catch
    :exit, {reason, _call} when reason in [:noproc, :normal, :shutdown, :timeout] ->
      {:error, "the blackboard of this node does not answer"}
  end

  # The table is gone with its process.
  defp lookup(board, key), do: if(table?(board), do: :ets.lookup(board, key), else: [])
  defp select(board, match), do: if(table?(board), do: :ets.select(board, match), else: [])
  defp table?(board), do: :ets.whereis(board) != :undefined

  defp age(at_ms), do: max(now() - at_ms, 0)
  defp now, do: System.monotonic_time(:millisecond)

  @impl GenServer
  def init(options) do
    # Sorted, so that the rows of one robot are found without looking at all.
    :ets.new(options[:name], [:ordered_set, :named_table, read_concurrency: true])

    {first, rand} = :rand.uniform_s(@firsts, Carrier.seed(options[:seed]))

    s = %{
      table: options[:name],
      transport: options[:transport],
      nodes: options[:nodes],
      repair_ms: options[:repair_ms],
      rows: Rows.new([first: first] ++ options[:limits]),
      rand: rand,
      owners: %{},
      rivals: %{},
      unsaid: [],
      dropped: 0
    }

    {:ok, schedule(s)}
  end

  @impl GenServer
  def handle_call({:enter, robot, boot, owner}, _from, s),
    do: {:reply, :ok, enter(s, owner, robot, boot)}

  def handle_call({:put, robot, key, payload}, _from, s) do
    case put_one(s, robot, key, payload) do
      {:ok, s} -> {:reply, :ok, s}
      {:error, reason} -> {:reply, {:error, line(reason, robot, key, payload, s)}, s}
    end
  end

  def handle_call(:info, _from, s) do
    rows = :ets.info(s.table, :size)
    {:reply, %{robots: map_size(s.rows.robots), rows: rows, dropped: s.dropped}, s}
  end

  @impl GenServer
  def handle_cast({:note, owner, robot, boot, pairs}, s) do
    s = enter(s, owner, robot, boot)

    {:noreply,
     Enum.reduce(pairs, s, fn {key, payload}, s ->
       case put_one(s, robot, key, payload) do
         {:ok, s} -> s
         {:error, _over_a_limit} -> drop(s, 1)
       end
     end)}
  end

  def handle_cast({:leave, robot}, s), do: {:noreply, end_of(s, robot)}

  def handle_cast({:hear, node, term}, s) do
    case Wire.read(term) do
      {heard, dropped} -> {:noreply, heard(drop(s, dropped), node, heard)}
      :error -> {:noreply, drop(s, 1)}
    end
  end

  def handle_cast(:repair, s), do: {:noreply, send_digests(s)}
  def handle_cast(_unknown, s), do: {:noreply, drop(s, 1)}

  @impl GenServer
  def handle_info(:push, s), do: {:noreply, push(s)}

  def handle_info(:repair, s) do
    {rows, gone} = Rows.forget(s.rows, now())

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
    %{s | rows: Rows.leave(s.rows, robot), owners: owners}
  end

  defp enter(s, owner, robot, boot) do
    {rows, notes} = Rows.enter(s.rows, robot, boot, now())
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

  defp put_one(s, robot, key, payload) do
    id = Wire.id(key)

    with {:ok, rows} <- Rows.put(s.rows, robot, id, payload, now()),
         do: {:ok, %{s | rows: rows} |> show([robot]) |> say_soon(robot, id)}
  end

  defp line(:not_own, robot, _key, _payload, _s),
    do: "#{inspect(robot)} is no robot of this node; each robot writes its own rows, on its node"

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
          row <- Rows.rows(s.rows, robot, id, now_ms),
          do: row

    for term <- Wire.tell(rows), do: Carrier.cast(s.transport, :rows, term)
    %{s | unsaid: []}
  end

  defp heard(s, node, {:rows, rows}) do
    {rows, notes} = Rows.merge(s.rows, rows, now())
    noted(%{s | rows: rows}, notes, node)
  end

  defp heard(s, node, {:digest, first, until, digest}) do
    robots = Rows.differing(s.rows, digest, first, until)
    answer(s, node, Wire.have(Rows.stamps(s.rows, robots)))
  end

  defp heard(s, node, {:have, stamps}) do
    {lacked, wanted} = Rows.diff(s.rows, stamps, now())
    answer(s, node, Wire.tell(lacked) ++ Wire.want(wanted))
  end

  defp heard(s, node, {:want, wanted}) do
    now_ms = now()

    rows =
      for {robot, id} <- Enum.uniq(wanted), row <- Rows.rows(s.rows, robot, id, now_ms), do: row

    answer(s, node, Wire.tell(rows))
  end

  defp answer(s, node, terms) do
    for term <- terms, do: Carrier.cast(s.transport, :rows, node, term)
    s
  end

  defp send_digests(s) do
    {nodes, rand} = Carrier.some(s.nodes, @peers, s.rand)

    for node <- nodes,
        term <- Wire.digest(Rows.digest(s.rows)),
        do: Carrier.cast(s.transport, :rows, node, term)

    %{s | rand: rand}
  end

  defp noted(s, notes, from) do
    s = show(s, Enum.uniq(for {what, robot, _} <- notes, what in [:changed, :rival], do: robot))

    Enum.reduce(notes, s, fn
      {:again, robot}, s ->
        Enum.reduce(Rows.rows(s.rows, robot, now()), s, &say_soon(&2, robot, elem(&1, 1)))

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

  defp schedule(%{repair_ms: :never} = s), do: s

  # Not all nodes at one moment.
  defp schedule(s) do
    {part, rand} = :rand.uniform_s(s.rand)
    Process.send_after(self(), :repair, round(s.repair_ms * (0.75 + 0.5 * part)))
    %{s | rand: rand}
  end
end
