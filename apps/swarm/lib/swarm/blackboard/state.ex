defmodule Swarm.Blackboard.State do
  @moduledoc """
  What all robots tell of themselves, as one node knows it: `{robot, key} -> {incarnation, sequence,
  value}`. Each row has one writer, the robot itself, and the newest `{incarnation, sequence}` wins, so
  that rows may come late, twice, in any order and by way of third parties. Pure; times are this
  node's own, in milliseconds.

  A row has an age and no time of day: it travels with its age at sending, and each who holds it adds
  for how long. What the way took is not in it, so of two ages of one row the higher is nearer to the
  truth.

  *Own* robots are those of this node (`enter/4`). What others say of them:

  | row from outside | what becomes of it |
  |---|---|
  | of a former life, or of this one before the board was lost | taken, but never in place of a newer word |
  | of a higher incarnation, and young | a rival of the same name: told (`{:rival, robot, incarnation}`), not taken |
  | of a higher incarnation, and over 5 s old | a former life, before the clock was set back: outbid |

  Memory is bounded (`limits`): other robots, keys of a robot (the newest stay), bytes of a value.
  """

  @limits %{robots: 256, keys: 32, bytes: 59_000}
  @rival_ms 5_000
  @leap 1_000_000_000_000
  @forget_ms 600_000

  @enforce_keys [:limits]
  defstruct @enforce_keys ++ [first: 0, robots: %{}, own: %{}]

  @type key :: term()
  @type stamp :: {incarnation :: non_neg_integer(), sequence :: non_neg_integer()}
  @type held :: {stamp(), value :: term(), at_ms :: integer()}
  @type t :: %__MODULE__{
          limits: %{robots: pos_integer(), keys: pos_integer(), bytes: pos_integer()},
          first: non_neg_integer(),
          robots: %{atom() => %{key() => held()}},
          own: %{atom() => {boot :: non_neg_integer(), stamp()}}
        }

  @typedoc "A row as it travels."
  @type row :: {robot :: atom(), key(), stamp(), age_ms :: non_neg_integer(), value :: term()}

  @typedoc """
    * `{:changed, robot, key}` - there is a newer value, or a better age
    * `{:again, robot}` - the rows of this own robot have new stamps, and must be told again
    * `{:rival, robot, incarnation}` - another robot has this own one's name
    * `{:refused, :robots | :bytes}` - over a limit
  """
  @type note ::
          {:changed, atom(), key()}
          | {:again, atom()}
          | {:rival, atom(), non_neg_integer()}
          | {:refused, :robots | :bytes}

  @doc """
  Nothing known yet. Options are the limits, and `first`, after which sequences count: a board
  that was lost takes another one, so that no stamp is used twice within a robot's life.

      iex> Swarm.Blackboard.State.new(keys: 4).limits
      %{robots: 256, keys: 4, bytes: 59_000}
  """
  @spec new(keyword(non_neg_integer())) :: t()
  def new(options \\ []) do
    {first, limits} = Keyword.pop(options, :first, 0)
    limits = Keyword.validate!(limits, Map.to_list(@limits))
    %__MODULE__{limits: Map.new(limits), first: first}
  end

  @doc """
  A robot of this node begins to write, in the life numbered `boot`. To enter again with the same
  number changes nothing.
  """
  @spec enter(t(), atom(), boot :: non_neg_integer(), integer()) :: {t(), [note()]}
  def enter(rows, robot, boot, now_ms) do
    case rows.own do
      %{^robot => {^boot, _stamp}} -> {rows, []}
      _new -> begin(rows, robot, boot, newest(rows, robot), now_ms)
    end
  end

  defp begin(rows, robot, boot, {{known, _sequence}, _value, at_ms}, now_ms) when known > boot do
    if now_ms - at_ms >= @rival_ms,
      do: {own(rows, robot, boot, {known + 1, rows.first}), []},
      # Those are another's rows.
      else:
        {own(%{rows | robots: Map.delete(rows.robots, robot)}, robot, boot, {boot, rows.first}),
         [{:rival, robot, known}]}
  end

  defp begin(rows, robot, boot, {{boot, _} = stamp, _value, _at_ms}, _now_ms),
    do: {own(rows, robot, boot, stamp), []}

  defp begin(rows, robot, boot, _older, _now_ms),
    do: {own(rows, robot, boot, {boot, rows.first}), []}

  defp own(rows, robot, boot, stamp), do: %{rows | own: Map.put(rows.own, robot, {boot, stamp})}

  defp newest(rows, robot) do
    rows |> of(robot) |> Map.values() |> Enum.max_by(&elem(&1, 0), fn -> nil end)
  end

  @doc "A robot of this node writes no more. Its rows stay, and grow old."
  @spec leave(t(), atom()) :: t()
  def leave(rows, robot), do: %{rows | own: Map.delete(rows.own, robot)}

  @doc """
  An own robot writes a row.

      iex> {rows, []} = Swarm.Blackboard.State.enter(Swarm.Blackboard.State.new(), :mag1, 7, 0)
      iex> {:ok, rows} = Swarm.Blackboard.State.put(rows, :mag1, :battery, 12.1, 100)
      iex> Swarm.Blackboard.State.get(rows, :mag1, :battery, 150)
      {:ok, 12.1, 50}
      iex> Swarm.Blackboard.State.put(rows, :mag2, :battery, 12.1, 100)
      {:error, :not_own}
  """
  @spec put(t(), atom(), key(), term(), integer()) ::
          {:ok, t()} | {:error, :not_own | :bytes | :keys}
  def put(rows, robot, key, value, now_ms) do
    mine = of(rows, robot)

    case rows.own do
      %{^robot => {boot, {incarnation, sequence}}} ->
        stamp = {incarnation, sequence + 1}

        cond do
          bytes(value) > rows.limits.bytes ->
            {:error, :bytes}

          full?(rows, mine, key, incarnation) ->
            {:error, :keys}

          true ->
            {:ok, rows |> own(robot, boot, stamp) |> hold(robot, key, {stamp, value, now_ms})}
        end

      _not_mine ->
        {:error, :not_own}
    end
  end

  # Words of a former life give way.
  defp full?(rows, mine, key, incarnation) do
    not is_map_key(mine, key) and map_size(mine) >= rows.limits.keys and
      Enum.count(mine, &match?({_key, {{^incarnation, _}, _, _}}, &1)) >= rows.limits.keys
  end

  @doc "What a robot said, and how old that is in ms."
  @spec get(t(), atom(), key(), integer()) :: {:ok, term(), age_ms :: non_neg_integer()} | :error
  def get(rows, robot, key, now_ms) do
    case of(rows, robot) do
      %{^key => {_stamp, value, at_ms}} -> {:ok, value, now_ms - at_ms}
      _none -> :error
    end
  end

  @doc "One row as it travels now, or none."
  @spec rows(t(), atom(), key(), integer()) :: [row()]
  def rows(rows, robot, key, now_ms) do
    case of(rows, robot) do
      %{^key => {stamp, value, at_ms}} -> [{robot, key, stamp, max(now_ms - at_ms, 0), value}]
      _none -> []
    end
  end

  @doc "All rows of a robot as they travel now."
  @spec rows(t(), atom(), integer()) :: [row()]
  def rows(rows, robot, now_ms) do
    for {key, {stamp, value, at_ms}} <- Enum.sort(of(rows, robot)),
        do: {robot, key, stamp, max(now_ms - at_ms, 0), value}
  end

  @doc "How a row is held here: its stamp, its value, and since when by this node's clock."
  @spec held(t(), atom(), key()) :: {:ok, held()} | :error
  def held(rows, robot, key), do: Map.fetch(of(rows, robot), key)

  @doc "Takes what is new of rows from outside."
  @spec merge(t(), [row()], integer()) :: {t(), [note()]}
  def merge(rows, incoming, now_ms) do
    {rows, notes} =
      Enum.reduce(incoming, {rows, []}, fn row, {rows, notes} ->
        {rows, more} = merge_one(rows, row, now_ms)
        {rows, more ++ notes}
      end)

    {rows, notes |> Enum.reverse() |> Enum.uniq()}
  end

  defp merge_one(rows, {robot, key, stamp, age_ms, value}, now_ms) do
    cond do
      bytes(value) > rows.limits.bytes ->
        {rows, [{:refused, :bytes}]}

      is_map_key(rows.own, robot) ->
        mine(rows, robot, key, {stamp, value, now_ms - age_ms}, now_ms)

      is_map_key(rows.robots, robot) or others(rows) < rows.limits.robots ->
        take(rows, robot, key, {stamp, value, now_ms - age_ms})

      true ->
        {rows, [{:refused, :robots}]}
    end
  end

  defp others(rows),
    do: map_size(rows.robots) - Enum.count(rows.own, &is_map_key(rows.robots, elem(&1, 0)))

  defp take(rows, robot, key, {stamp, value, at_ms} = new) do
    case of(rows, robot) do
      %{^key => {newer, _value, _at_ms}} when newer > stamp ->
        {rows, []}

      %{^key => {^stamp, _value, older}} when older <= at_ms ->
        {rows, []}

      %{^key => {^stamp, _same, _}} ->
        {hold(rows, robot, key, {stamp, value, at_ms}), changed(robot, key)}

      _older_or_none ->
        taken(hold(rows, robot, key, new), robot, key, stamp)
    end
  end

  # The oldest row of too many goes, which may be this one.
  defp taken(rows, robot, key, stamp) do
    case held(rows, robot, key) do
      {:ok, {^stamp, _, _}} -> {rows, changed(robot, key)}
      _dropped -> {rows, []}
    end
  end

  defp changed(robot, key), do: [{:changed, robot, key}]

  defp mine(rows, robot, key, {{incarnation, sequence} = stamp, _value, at_ms} = new, now_ms) do
    {boot, {life, count}} = rows.own[robot]

    cond do
      incarnation > life and now_ms - at_ms < @rival_ms ->
        {rows, [{:rival, robot, incarnation}]}

      incarnation > life ->
        again(rows, robot, boot, {incarnation + 1, 0})

      # This robot's own words, which the board has lost since: never newer than what it says now.
      stamp > {life, count} ->
        known? = is_map_key(of(rows, robot), key)
        # Nothing counts as far by itself: then another life, with numbers that will last.
        on = if sequence > count + @leap, do: {life + 1, 0}, else: {life, sequence}
        {rows, notes} = again(rows, robot, boot, on)
        {rows, more} = if known?, do: {rows, []}, else: take(rows, robot, key, new)
        {rows, notes ++ more}

      true ->
        take(rows, robot, key, new)
    end
  end

  # Old words keep their order and their ages, and get stamps that win.
  defp again(rows, robot, boot, stamp) do
    {_boot, {life, _count}} = rows.own[robot]
    {said, former} = rows |> of(robot) |> Enum.split_with(&match?({_, {{^life, _}, _, _}}, &1))

    {said, stamp} =
      said
      |> Enum.sort_by(fn {_key, {stamp, _, _}} -> stamp end)
      |> Enum.map_reduce(stamp, fn {key, {_, value, at_ms}}, {incarnation, sequence} ->
        stamp = {incarnation, sequence + 1}
        {{key, {stamp, value, at_ms}}, stamp}
      end)

    rows = %{rows | robots: Map.put(rows.robots, robot, Map.new(said ++ former))}
    notes = for {key, _held} <- said, note <- changed(robot, key), do: note
    {own(rows, robot, boot, stamp), notes ++ [{:again, robot}]}
  end

  defp hold(rows, robot, key, held) do
    all = rows |> of(robot) |> Map.put(key, held)
    %{rows | robots: Map.put(rows.robots, robot, newest_of(all, rows.limits.keys))}
  end

  # The newest of the whole: so that it does not matter in which order they came.
  defp newest_of(all, most) when map_size(all) <= most, do: all

  defp newest_of(all, _most),
    do: Map.delete(all, all |> Enum.min_by(fn {key, held} -> {elem(held, 0), key} end) |> elem(0))

  @doc """
  Forgets robots whose newest row is over ten minutes old, and words of former lives that are. Those
  of this node are never forgotten.
  """
  @spec forget(t(), integer()) :: {t(), gone :: [{atom(), key()}]}
  def forget(rows, now_ms) do
    gone =
      for {robot, all} <- rows.robots,
          {{life, _}, _, _} = newest(rows, robot),
          youngest = all |> Map.values() |> Enum.map(&elem(&1, 2)) |> Enum.max(),
          {key, {{incarnation, _}, _, at_ms}} <- all,
          now_ms - at_ms >= @forget_ms,
          incarnation < life or
            (now_ms - youngest >= @forget_ms and not is_map_key(rows.own, robot)),
          do: {robot, key}

    {Enum.reduce(gone, rows, &drop/2), gone}
  end

  defp drop({robot, key}, rows) do
    case Map.delete(of(rows, robot), key) do
      none when none == %{} -> %{rows | robots: Map.delete(rows.robots, robot)}
      left -> %{rows | robots: Map.put(rows.robots, robot, left)}
    end
  end

  defp of(rows, robot), do: Map.get(rows.robots, robot, %{})

  defp bytes(value) when is_binary(value), do: byte_size(value)
  defp bytes(value), do: :erlang.external_size(value)
end
