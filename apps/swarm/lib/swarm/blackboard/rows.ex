defmodule Swarm.Blackboard.Rows do
  @moduledoc false
  # Holds the rows of a node, `owner -> key -> {stamp, value, since when}`: of two rows the higher stamp wins, in whatever
  # order they arrive. Pure.
  #
  # An owner is a robot, whose rows have one writer and stamps `{incarnation, sequence}`, or a
  # bucket of hints, which any robot writes. A hint's stamp is `{count, {writer, check}}`: a count
  # above all that its writer had seen, the writer's name, and a hash of the value. There are 16
  # buckets, chosen by the key's number, so that two nodes need not exchange all hints if one
  # differs.
  #
  # A row has an age instead of a time of day: it travels with its age at sending, and each node
  # adds how long it has held the row. The time of transport is not included, so of two ages of one
  # row the higher is nearer to the truth.
  alias Swarm.Blackboard.State

  @buckets 16
  @hashes 4_294_967_296
  # No robot writes this often in one life.
  @leap 1_000_000_000_000
  @most 100_000_000_000_000
  # Times of day in ms, or, on finer clocks, in ns, until the year 2160.
  @latest 6_000_000_000_000_000_000
  @step 1_000

  @type owner :: atom() | (bucket :: 0..15)
  @type key :: term()
  @type stamp ::
          {non_neg_integer(), non_neg_integer() | {writer :: String.t(), check :: integer()}}
  @type held :: {stamp(), value :: term(), at_ms :: integer()}
  @typedoc "A row as it travels."
  @type row :: {owner(), key(), stamp(), age_ms :: non_neg_integer(), value :: term()}

  @doc "The owner of the hint whose key has this number."
  @spec bucket(non_neg_integer()) :: owner()
  def bucket(id), do: rem(id, @buckets)

  @doc "The owner of hints in a board's table, where a robot's rows have its name."
  @spec shown_as() :: String.t()
  def shown_as, do: "hints"

  @doc "The stamp of a hint; an empty value is that of a deleted hint."
  @spec hint_stamp(pos_integer(), String.t(), binary()) :: stamp()
  def hint_stamp(count, writer, value), do: {count, {writer, :erlang.phash2(value, @hashes)}}

  @doc "All owners with their rows."
  @spec owners(State.t()) :: [{owner(), %{key() => held()}}]
  def owners(state) do
    hints = Enum.group_by(state.hints, fn {id, _held} -> bucket(id) end)
    Map.to_list(state.robots) ++ for {bucket, list} <- hints, do: {bucket, Map.new(list)}
  end

  @doc "The rows of an owner."
  @spec of(State.t(), owner()) :: %{key() => held()}
  def of(state, robot) when is_atom(robot), do: Map.get(state.robots, robot, %{})
  def of(state, bucket), do: :maps.filter(fn id, _held -> bucket(id) == bucket end, state.hints)

  @doc """
  Whether a sequence is farther ahead of the known one than any robot gets, or near the end of its
  range: accepting it would leave no room for later writes.
  """
  @spec leap?(sequence :: integer(), known :: integer()) :: boolean()
  def leap?(sequence, known), do: sequence > known + @leap or sequence > @most

  @doc """
  Whether an incarnation can be that of a robot whose last known one is this (`nil`: none is
  known). Above all times of day there is a range for those that outbid wrong numbers, in which
  they count by ones, so nothing can bring them to its end.

      iex> latest = 6_000_000_000_000_000_000
      iex> for {n, known} <- [{latest, 1}, {latest + 1, latest}, {latest + 1, nil}, {latest + 1, 1}],
      ...>   do: Swarm.Blackboard.Rows.possible?(n, known)
      [true, true, true, false]
  """
  @spec possible?(incarnation :: non_neg_integer(), known :: non_neg_integer() | nil) :: boolean()
  def possible?(incarnation, known),
    do: incarnation <= @latest or known == nil or incarnation <= known + @step

  @doc "What a robot wrote last, as far as is known."
  @spec latest(State.t(), atom()) :: held() | nil
  def latest(state, robot),
    do: state |> of(robot) |> Map.values() |> Enum.max_by(&elem(&1, 0), fn -> nil end)

  @doc "A row as it is held here: its stamp, its value, and since when by this node's clock."
  @spec held(State.t(), owner(), key()) :: {:ok, held()} | :error
  def held(state, robot, key) when is_atom(robot), do: Map.fetch(of(state, robot), key)
  def held(state, _bucket, id), do: Map.fetch(state.hints, id)

  @doc "One row as it is sent now, or none."
  @spec rows(State.t(), owner(), key(), integer()) :: [row()]
  def rows(state, owner, key, now_ms) do
    case held(state, owner, key) do
      {:ok, {stamp, value, at_ms}} -> [{owner, key, stamp, max(now_ms - at_ms, 0), value}]
      :error -> []
    end
  end

  @doc "All rows of an owner as they are sent now."
  @spec rows(State.t(), owner(), integer()) :: [row()]
  def rows(state, owner, now_ms) do
    for {key, {stamp, value, at_ms}} <- Enum.sort(of(state, owner)),
        do: {owner, key, stamp, max(now_ms - at_ms, 0), value}
  end

  @doc """
  Stores a row if it is newer than the stored one, or has a higher age; returns whether it was
  stored.
  """
  @spec take(State.t(), owner(), key(), held()) :: {State.t(), taken? :: boolean()}
  def take(state, owner, key, {stamp, _value, at_ms} = new) do
    case held(state, owner, key) do
      {:ok, {newer, _value, _at_ms}} when newer > stamp ->
        {state, false}

      {:ok, {^stamp, _same, older_ms}} when older_ms <= at_ms ->
        {state, false}

      _older_or_none ->
        state = hold(state, owner, key, new)
        # If there are too many, the oldest row is removed, which may be this one.
        {state, match?({:ok, {^stamp, _, _}}, held(state, owner, key))}
    end
  end

  @doc "Stores a row in any case. Of a robot's rows, and of all hints, the newest stay."
  @spec hold(State.t(), owner(), key(), held()) :: State.t()
  def hold(state, robot, key, held) when is_atom(robot) do
    all = state |> of(robot) |> Map.put(key, held) |> newest(state.limits.keys)
    %{state | robots: Map.put(state.robots, robot, all)}
  end

  def hold(state, _bucket, id, held),
    do: %{state | hints: state.hints |> Map.put(id, held) |> newest(state.limits.hints)}

  # The newest of all, so that the order of arrival does not matter.
  defp newest(all, most) when map_size(all) <= most, do: all

  defp newest(all, _most),
    do: Map.delete(all, all |> Enum.min_by(fn {key, held} -> {elem(held, 0), key} end) |> elem(0))
end
