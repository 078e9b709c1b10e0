defmodule Record.Recorder.Queue do
  @moduledoc false
  # Passes a robot's entries to its recorder: messages, of which only so many may be under way. Above that they are
  # counted instead of sent, so that a recorder whose disk is slow costs a robot neither time nor memory.
  #
  # Each role has its own counters, which only its own process and the recorder write: what a role
  # lost is told before its next entry.
  alias Robot.Trace

  @enforce_keys [:counters, :bound]
  defstruct @enforce_keys

  @type t :: %__MODULE__{counters: :atomics.atomics_ref(), bound: pos_integer()}

  # 20 s of a gate that hears much.
  @bound 2_000
  @roles Trace.roles() |> Enum.with_index() |> Enum.map(fn {role, k} -> {role, 3 * k} end)
  @known Map.new(@roles)
  @waiting 1
  @lost 2
  @due 3

  @doc "The roles whose entries are sent."
  @spec roles() :: [atom(), ...]
  def roles, do: Keyword.keys(@roles)

  @doc "A queue for at most `bound` entries of each role."
  @spec new(pos_integer()) :: t()
  def new(bound \\ @bound) do
    queue = %__MODULE__{counters: :atomics.new(3 * length(@roles), signed: true), bound: bound}
    ask(queue)
    queue
  end

  @doc "Wants a checkpoint of each role."
  @spec ask(t()) :: :ok
  def ask(queue), do: Enum.each(@roles, fn {role, _at} -> put(queue, role, @due, 1) end)

  @doc """
  Sends an entry to the recorder as `{:entry, robot, entry, now_ms}`, with the VM's monotonic time;
  a checkpoint only if one is wanted. Called in the process of the entry's role.
  """
  @spec send_entry(t(), pid(), robot :: atom(), Trace.entry()) :: :ok
  def send_entry(queue, recorder, robot, {role, :checkpoint, state, at_ms})
      when is_map_key(@known, role) do
    if get(queue, role, @due) == 1 and room?(queue, role) do
      put(queue, role, @due, 0)
      deliver(queue, recorder, robot, {role, :checkpoint, state.(), at_ms})
    end

    :ok
  end

  def send_entry(queue, recorder, robot, {role, _kind, _what, _at_ms} = entry)
      when is_map_key(@known, role) do
    if room?(queue, role),
      do: deliver(queue, recorder, robot, entry),
      else: :atomics.add(queue.counters, slot(role, @lost), 1)

    :ok
  end

  def send_entry(_queue, _recorder, _robot, _other_role), do: :ok

  defp deliver(queue, recorder, robot, {role, _kind, _what, at_ms} = entry) do
    case :atomics.exchange(queue.counters, slot(role, @lost), 0) do
      0 ->
        :ok

      # Without a state what follows cannot be replayed.
      lost ->
        put(queue, role, @due, 1)
        put_under_way(queue, recorder, robot, {role, :lost, lost, at_ms})
    end

    put_under_way(queue, recorder, robot, entry)
  end

  defp put_under_way(queue, recorder, robot, {role, _kind, _what, _at_ms} = entry) do
    :atomics.add(queue.counters, slot(role, @waiting), 1)
    send(recorder, {:entry, robot, entry, Hal.Clock.now_ms()})
  end

  @doc "The recorder has taken an entry of this role."
  @spec taken(t(), role :: atom()) :: :ok
  def taken(queue, role), do: :atomics.sub(queue.counters, slot(role, @waiting), 1)

  @doc "How many entries of all roles were lost, and not told yet."
  @spec untold(t()) :: non_neg_integer()
  def untold(queue), do: for({role, _at} <- @roles, do: get(queue, role, @lost)) |> Enum.sum()

  @doc "The losses that were not told yet, for the end of a recording; they count as told then."
  @spec take_untold(t()) :: [{role :: atom(), lost :: pos_integer()}]
  def take_untold(queue) do
    for {role, _at} <- @roles,
        lost = :atomics.exchange(queue.counters, slot(role, @lost), 0),
        lost > 0,
        do: {role, lost}
  end

  defp room?(queue, role), do: get(queue, role, @waiting) < queue.bound
  defp get(queue, role, what), do: :atomics.get(queue.counters, slot(role, what))
  defp put(queue, role, what, value), do: :atomics.put(queue.counters, slot(role, what), value)

  for {role, at} <- @roles do
    defp slot(unquote(role), what), do: unquote(at) + what
  end
end
