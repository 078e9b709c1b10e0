defmodule Swarm.Blackboard.Stigmergy do
  @moduledoc """
  Virtual stigmergy: a small map that all robots write and read, for hints such as "searched here".
  Pure. `Swarm.Blackboard.Hints` is the process.

  Each entry has a stamp, `{lamport, robot, check}`: a number above all that its writer had seen, the
  writer's name, and a number of the value. The highest stamp wins, so that all come to the same map
  whatever is lost, doubled or out of order. A hint that is deleted stays as a tombstone, so that
  it does not come back, for ten minutes. Of more than #{256} entries, tombstones too, the newest stay.

  The other half of stigmergy is to look at who is near: `near/3`, `map/2` and `reduce/3`.
  """
  alias Hal.Pose

  @most 256
  @buckets 16
  @hashes 4_294_967_296
  @forget_ms 600_000
  @last 0xFFFFFFFFFFFFFFFF
  # No fleet writes that much unheard; taken over, it would leave no room for what is written later.
  @leap 1_000_000_000_000

  defstruct most: @most, clock: 0, entries: %{}

  @type id :: non_neg_integer()
  @type stamp :: {lamport :: pos_integer(), robot :: String.t(), check :: non_neg_integer()}
  @typedoc "Bytes of a key and its value; none where it is deleted."
  @type payload :: binary()
  @type entry :: {id(), lamport :: pos_integer(), robot :: String.t(), payload()}
  @type t :: %__MODULE__{
          most: pos_integer(),
          clock: non_neg_integer(),
          entries: %{id() => {stamp(), payload(), at_ms :: integer()}}
        }

  @doc "An empty map, of so many entries at most."
  @spec new(pos_integer()) :: t()
  def new(most \\ @most), do: %__MODULE__{most: most}

  @doc "A robot writes; an empty payload deletes."
  @spec put(t(), String.t(), id(), payload(), integer()) :: t()
  def put(hints, robot, id, payload, now_ms) do
    take(hints, {id, hints.clock + 1, robot, payload}, now_ms)
  end

  @doc """
  The payload of an entry, and who wrote it.

      iex> Swarm.Blackboard.Stigmergy.new() |> Swarm.Blackboard.Stigmergy.put("mag1", 7, "bytes", 0) |> Swarm.Blackboard.Stigmergy.get(7)
      {:ok, "bytes", "mag1"}
      iex> Swarm.Blackboard.Stigmergy.get(Swarm.Blackboard.Stigmergy.new(), 7)
      :error
  """
  @spec get(t(), id()) :: {:ok, payload(), String.t()} | :error
  def get(hints, id) do
    case hints.entries do
      %{^id => {{_lamport, robot, _check}, payload, _at_ms}} when payload != "" ->
        {:ok, payload, robot}

      _none ->
        :error
    end
  end

  @doc """
  Takes what is newer of entries from outside; says which are. One whose count is far above all that was
  seen is not taken, for nobody could write after it.
  """
  @spec merge(t(), [entry()], integer()) :: {t(), changed :: [id()]}
  def merge(hints, entries, now_ms) do
    merged = Enum.reduce(entries, hints, &take(&2, &1, now_ms))

    changed =
      for {id, _, _, _} <- entries, merged.entries[id] != hints.entries[id], uniq: true, do: id

    {merged, changed}
  end

  defp take(%{clock: clock} = hints, {_id, lamport, _robot, _payload}, _now_ms)
       when lamport > clock + @leap,
       do: hints

  defp take(hints, {id, lamport, robot, payload}, now_ms) do
    stamp = {lamport, robot, check(payload)}
    hints = %{hints | clock: max(hints.clock, lamport)}

    case hints.entries do
      %{^id => {newer, _payload, _at_ms}} when newer >= stamp -> hints
      entries -> trim(%{hints | entries: Map.put(entries, id, {stamp, payload, now_ms})})
    end
  end

  # The newest of the whole: so that it does not matter in which order they came.
  defp trim(%{entries: entries, most: most} = hints) when map_size(entries) <= most, do: hints

  defp trim(hints) do
    {oldest, _entry} = Enum.min_by(hints.entries, fn {id, {stamp, _, _}} -> {stamp, id} end)
    %{hints | entries: Map.delete(hints.entries, oldest)}
  end

  @doc "Forgets tombstones that are over ten minutes old; says which."
  @spec forget(t(), integer()) :: {t(), gone :: [id()]}
  def forget(hints, now_ms) do
    gone = for {id, {_, "", at_ms}} <- hints.entries, now_ms - at_ms >= @forget_ms, do: id
    {%{hints | entries: Map.drop(hints.entries, gone)}, gone}
  end

  @doc "#{@buckets} numbers that say which entries one has."
  @spec digest(t()) :: [non_neg_integer()]
  def digest(hints) do
    buckets = Enum.group_by(hints.entries, fn {id, _} -> rem(id, @buckets) end, &stamp/1)
    for n <- 0..(@buckets - 1), do: buckets |> Map.get(n, []) |> Enum.sort() |> hash()
  end

  @doc "Of the buckets that are not as in this digest, the stamps of what is in them."
  @spec differing(t(), [non_neg_integer()]) :: [{bucket :: 0..15, [{id(), stamp()}]}]
  def differing(hints, digest) do
    for {{mine, theirs}, n} <- hints |> digest() |> Enum.zip(digest) |> Enum.with_index(),
        mine != theirs,
        do: {n, stamps(hints, n)}
  end

  @doc "The entries of a bucket that another lacks who has these, and what is newer there."
  @spec diff(t(), bucket :: 0..15, [{id(), stamp()}]) :: {[entry()], wanted :: [id()]}
  def diff(hints, bucket, theirs) do
    had = Map.new(theirs)
    mine = stamps(hints, bucket)
    own = Map.new(mine)
    lacked = for {id, stamp} <- mine, had[id] == nil or stamp > had[id], do: id
    wanted = for {id, stamp} <- theirs, own[id] == nil or stamp > own[id], do: id
    {entries(hints, lacked), wanted}
  end

  @doc "These entries as they travel."
  @spec entries(t(), [id()]) :: [entry()]
  def entries(hints, ids) do
    for id <- ids, {{lamport, robot, _check}, payload, _at_ms} <- List.wrap(hints.entries[id]) do
      {id, lamport, robot, payload}
    end
  end

  defp stamps(hints, bucket),
    do:
      Enum.sort(
        for {id, _} = entry <- hints.entries, rem(id, @buckets) == bucket, do: stamp(entry)
      )

  defp stamp({id, {stamp, _payload, _at_ms}}), do: {id, stamp}
  defp hash(stamps), do: :erlang.phash2(stamps, @hashes)
  defp check(payload), do: :erlang.phash2(payload, @hashes)

  @doc """
  Whether a term from outside is an entry, of no more than `bytes`.

      iex> for term <- [{1, 1, "mag1", "x"}, {1, 0, "mag1", "x"}, :junk], do: Swarm.Blackboard.Stigmergy.entry?(term, 10)
      [true, false, false]
  """
  @spec entry?(term(), pos_integer()) :: boolean()
  def entry?({id, lamport, robot, payload}, bytes),
    do:
      id?(id) and lamport?(lamport) and name?(robot) and is_binary(payload) and
        byte_size(payload) <= bytes

  def entry?(_other, _bytes), do: false

  @doc false
  @spec stamp?(term()) :: boolean()
  def stamp?({id, {lamport, robot, check}}),
    do: id?(id) and lamport?(lamport) and name?(robot) and id?(check)

  def stamp?(_other), do: false

  @doc false
  @spec id?(term()) :: boolean()
  def id?(id), do: is_integer(id) and id >= 0 and id < @hashes

  defp lamport?(lamport), do: is_integer(lamport) and lamport in 1..@last
  defp name?(robot), do: is_binary(robot) and byte_size(robot) in 1..255

  @typedoc "A robot in range: where it is, how far (m), and in what direction from here (radians)."
  @type neighbour :: %{pose: Pose.t(), distance: float(), bearing: float()}

  @doc """
  The robots within range, sorted by name: from their poses, one's own, and a range in metres. Without
  a pose of one's own nobody is near.

      iex> poses = %{mag2: Hal.Pose.new(2, 0), min1: Hal.Pose.new(9, 0)}
      iex> [{:mag2, %{distance: 2.0}}] = Swarm.Blackboard.Stigmergy.near(poses, Hal.Pose.new(0, 0), 3.0)
  """
  @spec near(%{atom() => Pose.t()}, Pose.t() | nil, number()) :: [{atom(), neighbour()}]
  def near(_poses, nil, _range), do: []

  def near(poses, own, range) do
    for {robot, pose} <- Enum.sort_by(poses, &Atom.to_string(elem(&1, 0))),
        distance = Pose.distance(own, {pose.x, pose.y}),
        distance <= range do
      {robot, %{pose: pose, distance: distance, bearing: Pose.bearing(own, {pose.x, pose.y})}}
    end
  end

  @doc """
  What a function of robot and neighbour gives for each.

      iex> near = Swarm.Blackboard.Stigmergy.near(%{mag2: Hal.Pose.new(2, 0)}, Hal.Pose.new(0, 0), 3.0)
      iex> Swarm.Blackboard.Stigmergy.map(near, fn _robot, neighbour -> neighbour.distance end)
      [mag2: 2.0]
  """
  @spec map([{atom(), neighbour()}], (atom(), neighbour() -> value)) :: [{atom(), value}]
        when value: term()
  def map(near, function), do: for({robot, one} <- near, do: {robot, function.(robot, one)})

  @doc """
  All neighbours to one value, in the order of their names.

      iex> near = Swarm.Blackboard.Stigmergy.near(%{a: Hal.Pose.new(2, 0), b: Hal.Pose.new(1, 0)}, Hal.Pose.new(0, 0), 3.0)
      iex> Swarm.Blackboard.Stigmergy.reduce(near, 0, fn _robot, neighbour, sum -> sum + neighbour.distance end)
      3.0
  """
  @spec reduce([{atom(), neighbour()}], acc, (atom(), neighbour(), acc -> acc)) :: acc
        when acc: term()
  def reduce(near, acc, function),
    do: Enum.reduce(near, acc, fn {robot, one}, acc -> function.(robot, one, acc) end)
end
