defmodule Swarm.Blackboard.State do
  @moduledoc false
  # Holds what all robots publish about themselves, as one node knows it:
  # `{robot, key} -> {incarnation, sequence, value}`. Each row has one writer, the robot itself, and
  # the newest `{incarnation, sequence}` wins, so that rows may arrive late, twice, in any order and
  # through third parties. Besides rows there are hints, which all robots write (`put_hint/5`).
  # Pure; times are this node's own, in milliseconds. `Swarm.Blackboard.Rows` holds the rows.
  #
  # *Own* robots are those of this node (`enter/4`); `Swarm.Blackboard.Incarnation` says what becomes of what
  # others say of them.
  #
  # A deleted hint stays for ten minutes with the value `""`, so that it does not come back.
  #
  # Memory is bounded (`limits`): other robots, keys of a robot and hints (the newest stay), bytes of
  # a value.
  alias Swarm.Blackboard.{Incarnation, Rows}
  alias Swarm.Wire.CounterGuard

  @limits %{robots: 256, keys: 32, bytes: 59_000, hints: 256, hint_bytes: 1_000}

  @enforce_keys [:limits]
  defstruct @enforce_keys ++
              [first: 0, robots: %{}, own: %{}, hints: %{}, clock: 0, guard: %CounterGuard{}]

  @type key :: Rows.key()
  @type t :: %__MODULE__{
          limits: %{atom() => pos_integer()},
          first: non_neg_integer(),
          robots: %{atom() => %{key() => Rows.held()}},
          own: %{atom() => {boot :: non_neg_integer(), Rows.stamp()}},
          hints: %{key() => Rows.held()},
          clock: non_neg_integer(),
          guard: CounterGuard.t()
        }

  @typedoc """
    * `{:changed, owner, key}` - there is a newer value, or a more accurate age
    * `{:again, robot}` - the rows of this own robot have new stamps, and must be sent again
    * `{:rival, robot, incarnation}` - another robot has this own one's name
    * `{:refused, :robots | :bytes | :count}` - over a limit
  """
  @type note ::
          {:changed, Rows.owner(), key()}
          | {:again, atom()}
          | {:rival, atom(), non_neg_integer()}
          | {:refused, :robots | :bytes | :count}

  @doc """
  An empty state. Options are the limits, and `first`, after which sequences count: a board that
  was lost starts with another one, so that no stamp is used twice within a robot's life.

      iex> Swarm.Blackboard.State.new(keys: 4).limits
      %{robots: 256, keys: 4, bytes: 59_000, hints: 256, hint_bytes: 1_000}
  """
  @spec new(keyword(non_neg_integer())) :: t()
  def new(options \\ []) do
    {first, limits} = Keyword.pop(options, :first, 0)
    limits = Keyword.validate!(limits, Map.to_list(@limits))
    %__MODULE__{limits: Map.new(limits), first: first}
  end

  @doc """
  A robot of this node begins to write, in the life numbered `boot`. Entering again with the same
  number changes nothing.
  """
  @spec enter(t(), atom(), boot :: non_neg_integer(), integer()) :: {t(), [note()]}
  defdelegate enter(rows, robot, boot, now_ms), to: Incarnation

  @doc "A robot of this node stops writing. Its rows stay, and grow old."
  @spec leave(t(), atom()) :: t()
  def leave(rows, robot), do: %{rows | own: Map.delete(rows.own, robot)}

  @doc """
  A robot of this node writes a row.

      iex> {rows, []} = Swarm.Blackboard.State.enter(Swarm.Blackboard.State.new(), :mag1, 7, 0)
      iex> {:ok, rows} = Swarm.Blackboard.State.put(rows, :mag1, :battery, 12.1, 100)
      iex> Swarm.Blackboard.Rows.rows(rows, :mag1, :battery, 150)
      [{:mag1, :battery, {7, 1}, 50, 12.1}]
      iex> Swarm.Blackboard.State.put(rows, :mag2, :battery, 12.1, 100)
      {:error, :not_own}
  """
  @spec put(t(), atom(), key(), term(), integer()) ::
          {:ok, t()} | {:error, :not_own | :bytes | :keys}
  def put(rows, robot, key, value, now_ms) do
    mine = Rows.of(rows, robot)

    case rows.own do
      %{^robot => {boot, {incarnation, sequence}}} ->
        stamp = {incarnation, sequence + 1}

        cond do
          bytes(value) > rows.limits.bytes ->
            {:error, :bytes}

          full?(rows, mine, key, incarnation) ->
            {:error, :keys}

          true ->
            {:ok,
             rows
             |> Incarnation.write(robot, boot, stamp)
             |> Rows.hold(robot, key, {stamp, value, now_ms})}
        end

      _not_mine ->
        {:error, :not_own}
    end
  end

  # Rows of a former life give way.
  defp full?(rows, mine, key, incarnation) do
    not is_map_key(mine, key) and map_size(mine) >= rows.limits.keys and
      Enum.count(mine, &match?({_key, {{^incarnation, _}, _, _}}, &1)) >= rows.limits.keys
  end

  @doc """
  A robot of any node writes the hint whose key has this number; `""` deletes it.

      iex> {:ok, rows} = Swarm.Blackboard.State.put_hint(Swarm.Blackboard.State.new(), "mag1", 7, "bytes", 0)
      iex> {:ok, {{1, {"mag1", _check}}, "bytes", 0}} = Swarm.Blackboard.Rows.held(rows, 7, 7)
  """
  @spec put_hint(t(), writer :: String.t(), non_neg_integer(), binary(), integer()) ::
          {:ok, t()} | {:error, :hint_bytes}
  def put_hint(%{limits: %{hint_bytes: most}}, _writer, _id, value, _now_ms)
      when byte_size(value) > most,
      do: {:error, :hint_bytes}

  def put_hint(%{clock: clock} = rows, writer, id, value, now_ms) do
    held = {Rows.hint_stamp(clock + 1, writer, value), value, now_ms}
    {:ok, Rows.hold(%{rows | clock: clock + 1}, Rows.bucket(id), id, held)}
  end

  @doc "Accepts new rows from outside, unless `forget/2` would drop them at once."
  @spec merge(t(), [Rows.row()], integer()) :: {t(), [note()]}
  def merge(rows, incoming, now_ms) do
    {rows, notes} =
      Enum.reduce(incoming, {rows, []}, fn row, {rows, notes} ->
        {rows, more} = merge_one(rows, row, now_ms)
        {rows, more ++ notes}
      end)

    # Two nodes that send each other in turn what the other has just forgotten would never get rid
    # of it.
    owners = for {owner, _, _, _, _} <- incoming, uniq: true, do: owner
    {rows, _gone} = forget_old(rows, now_ms, owners)

    {rows, notes |> Enum.reverse() |> Enum.uniq()}
  end

  defp merge_one(rows, {bucket, id, {count, _} = stamp, age_ms, value}, now_ms)
       when is_integer(bucket) do
    if bytes(value) > rows.limits.hint_bytes do
      {rows, [{:refused, :bytes}]}
    else
      case count_on(rows, count, now_ms) do
        {:ok, rows} -> take(rows, bucket, id, {stamp, value, now_ms - age_ms})
        {:refused, rows} -> {rows, [{:refused, :count}]}
      end
    end
  end

  defp merge_one(rows, {robot, key, stamp, age_ms, value}, now_ms) do
    cond do
      bytes(value) > rows.limits.bytes ->
        {rows, [{:refused, :bytes}]}

      not Rows.possible?(elem(stamp, 0), known(rows, robot)) ->
        {rows, [{:refused, :count}]}

      is_map_key(rows.own, robot) ->
        own(rows, robot, key, {stamp, value, now_ms - age_ms}, now_ms)

      is_map_key(rows.robots, robot) or others(rows) < rows.limits.robots ->
        take(rows, robot, key, {stamp, value, now_ms - age_ms})

      true ->
        {rows, [{:refused, :robots}]}
    end
  end

  # A count that no robot can have reached would leave no room for later ones.
  defp count_on(%{clock: clock} = rows, count, _now_ms) when count <= clock, do: {:ok, rows}

  defp count_on(%{clock: clock, guard: guard} = rows, count, now_ms) do
    case CounterGuard.admit(guard, count, clock, now_ms) do
      {:ok, guard} ->
        {:ok, %{rows | clock: count, guard: guard}}

      {:error, _allowed} ->
        {:refused, %{rows | guard: CounterGuard.approach(guard, count, clock, now_ms)}}
    end
  end

  # The life that an own robot writes in, the newest of another's.
  defp known(rows, robot) do
    case rows do
      %{own: %{^robot => {_boot, {life, _sequence}}}} -> life
      _not_own -> with {{life, _sequence}, _value, _at_ms} <- Rows.latest(rows, robot), do: life
    end
  end

  defp others(rows),
    do: map_size(rows.robots) - Enum.count(rows.own, &is_map_key(rows.robots, elem(&1, 0)))

  defp take(rows, owner, key, held) do
    {rows, taken?} = Rows.take(rows, owner, key, held)
    {rows, if(taken?, do: [{:changed, owner, key}], else: [])}
  end

  defp own(rows, robot, key, held, now_ms) do
    {rows, notes, take?} = Incarnation.hear(rows, robot, key, held, now_ms)
    {rows, more} = if take?, do: take(rows, robot, key, held), else: {rows, []}
    {rows, notes ++ more}
  end

  @doc """
  Forgets robots whose newest row is over ten minutes old, and rows of former lives and deleted
  hints of that age; never rows of this node's own robots in their present life.
  """
  @spec forget(t(), integer()) :: {t(), gone :: [{Rows.owner(), key()}]}
  def forget(rows, now_ms),
    do: forget_old(rows, now_ms, for({owner, _} <- Rows.owners(rows), do: owner))

  defp bytes(value) when is_binary(value), do: byte_size(value)
  defp bytes(value), do: :erlang.external_size(value)

  # Decides which rows a board forgets once they are ten minutes old: robots of which nothing is newer,
  # words of former lives, and deleted hints; words of this life of this node's own robots never.
  # Pure.

  @forget_ms 600_000

  # Forgets what is old of these owners.
  defp forget_old(state, now_ms, owners) do
    gone =
      for owner <- owners,
          all = Rows.of(state, owner),
          old = for({_, {_, _, at_ms}} = row <- all, now_ms - at_ms >= @forget_ms, do: row),
          {key, {stamp, value, _}} <- old,
          past?(state, owner, stamp, value, length(old) == map_size(all)),
          do: {owner, key}

    {Enum.reduce(gone, state, &drop/2), gone}
  end

  defp past?(_state, bucket, _stamp, value, _all?) when is_integer(bucket), do: value == ""

  defp past?(state, robot, {incarnation, _}, _value, all?) do
    {{life, _}, _, _} = Rows.latest(state, robot)
    incarnation < life or (all? and not is_map_key(state.own, robot))
  end

  defp drop({bucket, id}, state) when is_integer(bucket),
    do: %{state | hints: Map.delete(state.hints, id)}

  defp drop({robot, key}, state) do
    case Map.delete(Rows.of(state, robot), key) do
      none when none == %{} -> %{state | robots: Map.delete(state.robots, robot)}
      left -> %{state | robots: Map.put(state.robots, robot, left)}
    end
  end
end
