defmodule Record.Recording.Tick do
  @moduledoc """
  Packs a tick of a run in lockstep into the form in which a recording holds it. Pure.

  A recording must cost its run next to nothing, and most of a tick is the same again and again: a
  message is among the effects of its sender and among the inputs of each robot that hears it, and
  every struct has the names of its fields. So each message is written once, and its copies as its
  number; what comes in each tick is written without names. What else there is stays as it is.
  """
  alias Hal.{Odometry, Pose, Twist}
  alias Record.Recording.Tick.Unpack
  alias Swarm.Member
  alias Vision.{Blob, Detections}

  # `Record.Recording.Tick.Unpack` has the same.
  @other 0
  @readings 1
  @detections 2
  @message 3
  @tick 4
  @reflex 5
  @look 6
  @send 7

  @typedoc "An input of a robot with the effects that it had, or what happened in the world."
  @type entry ::
          {:step, robot :: atom(), Member.input(), [Member.effect()]}
          | {:world, at_ms :: non_neg_integer(), event :: tuple()}

  @typedoc "The messages, by number, and the entries."
  @type packed :: {messages :: tuple(), entries :: [tuple()]}

  @doc """
  The entries of a tick, packed.

      iex> message = Swarm.Message.new(:mag1, :heartbeat, :beat)
      iex> entries = [
      ...>   {:step, :mag1, {:tick, 100}, [{:send, :all, message}]},
      ...>   {:step, :mag2, {:message, message, 150}, []}
      ...> ]
      iex> {{^message}, _entries} = packed = Record.Recording.Tick.pack(entries)
      iex> Record.Recording.Tick.unpack(packed)
      {:ok, entries}
  """
  @spec pack([entry()]) :: packed()
  def pack(entries) do
    {entries, {_count, messages, _by_sender}} = pack(entries, {0, [], %{}}, [])
    {messages |> Enum.reverse() |> List.to_tuple(), entries}
  end

  # What a robot of ours senses at once.
  defp pack(
         [
           {:step, id, {:reading, {:odometry, %Odometry{frame: nil} = odometry}, at_ms}, []},
           {:step, id, {:reading, {:sonar, ranges}, at_ms}, effects},
           {:step, id, {:reading, {:bumpers, bumpers}, at_ms}, []},
           {:step, id, {:reading, {:power, volts}, at_ms}, []},
           {:step, id,
            {:reading, {:ptz, %{field_of_view: width, pan: pan, tilt: tilt} = ptz}, at_ms}, []}
           | rest
         ],
         table,
         done
       )
       when map_size(ptz) == 3 do
    %{pose: %Pose{x: x, y: y, heading: heading}, twist: %Twist{linear: linear, turn: turn}} =
      odometry

    {effects, table} = effects(effects, table)

    entry =
      {@readings, id, at_ms, x, y, heading, linear, turn, ranges, bumpers, volts, pan, tilt,
       width, effects}

    pack(rest, table, [entry | done])
  end

  # Many hear the same at once.
  defp pack([{:step, _id, {:message, %{from: _sender}, at_ms}, []} | _] = entries, table, done) do
    {rest, table, heard} = heard(entries, at_ms, table, [])
    pack(rest, table, [{@message, at_ms, heard} | done])
  end

  defp pack([{:step, id, input, effects} | rest], table, done) do
    {effects, table} = effects(effects, table)
    pack(rest, table, [input(input, id, effects) | done])
  end

  defp pack([other | rest], table, done), do: pack(rest, table, [other | done])
  defp pack([], table, done), do: {Enum.reverse(done), table}

  defp heard(
         [{:step, id, {:message, %{from: _sender} = message, at_ms}, []} | rest],
         at_ms,
         table,
         heard
       ) do
    {number, table} = number(table, message)
    heard(rest, at_ms, table, [number, id | heard])
  end

  defp heard(rest, _at_ms, table, heard), do: {rest, table, Enum.reverse(heard)}

  defp effects([], table), do: {[], table}
  defp effects(effects, table), do: Enum.map_reduce(effects, table, &effect/2)

  defp input({:detections, %Detections{} = seen}, id, effects) do
    {@detections, id, seen.at_ms, seen.pan, seen.tilt, seen.field_of_view, seen.pose,
     Enum.map(seen.blobs, &blob/1), effects}
  end

  defp input({:tick, at_ms}, id, effects), do: {@tick, id, at_ms, effects}
  defp input({:reflex, at_ms}, id, effects), do: {@reflex, id, at_ms, effects}
  defp input(other, id, effects), do: {@other, id, other, effects}

  defp effect({:drive, %Twist{linear: linear, turn: turn}}, table) when is_float(linear),
    do: {{linear, turn}, table}

  defp effect({:look, pan, tilt}, table), do: {{@look, pan, tilt}, table}

  defp effect({:send, to, %{from: _sender} = message}, table) do
    {number, table} = number(table, message)
    {{@send, to, number}, table}
  end

  defp effect(other, table), do: {{@other, other}, table}

  # A copy is mostly the same term in memory, which is compared at once; of one sender there are few.
  defp number({count, messages, by_sender} = table, %{from: sender} = message) do
    of_sender = Map.get(by_sender, sender, [])

    case same(of_sender, message) do
      number when number != nil ->
        {number, table}

      nil ->
        by_sender = Map.put(by_sender, sender, [{message, count} | of_sender])
        {count, {count + 1, [message | messages], by_sender}}
    end
  end

  # Equal to the byte: 0 is not 0.0.
  defp same([{message, number} | _rest], message), do: number
  defp same([_other | rest], message), do: same(rest, message)
  defp same([], _message), do: nil

  defp blob(%Blob{} = blob) do
    {blob.colour, blob.area, blob.share, blob.x, blob.y, blob.left, blob.top, blob.right,
     blob.bottom, blob.width, blob.height, blob.distance, blob.clipped?}
  end

  @doc "The entries again; `:error` for what `pack/1` does not make."
  @spec unpack(term()) :: {:ok, [entry()]} | :error
  def unpack({messages, entries}) when is_tuple(messages) and is_list(entries),
    do: Unpack.entries(entries, messages, [])

  def unpack(_other), do: :error
end
