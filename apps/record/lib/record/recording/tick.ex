defmodule Record.Recording.Tick do
  @moduledoc """
  Packs a tick of a run in lockstep into the form in which a recording holds it. Pure.

  A recording must cost its run next to nothing, and most of a tick is the same again and again: a
  message is among the effects of its sender and among the inputs of each robot that hears it, and
  every struct has the names of its fields. So each message is written once, and its copies as its
  number; what comes in each tick is written without names. What else there is stays as it is.
  """
  alias Hal.{Odometry, Pose, Twist}
  alias Swarm.Member
  alias Vision.{Blob, Detections}

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

  defp input({:detections, %Detections{marks: nil} = seen}, id, effects) do
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
    do: entries(entries, messages, [])

  def unpack(_other), do: :error

  # The entries of packed ones behind those that are `done`, which are newest first.
  defp entries(packed, messages, done)

  defp entries([{:world, _at_ms, _event} = entry | rest], messages, done),
    do: entries(rest, messages, [entry | done])

  defp entries(
         [
           {@readings, id, at_ms, x, y, heading, linear, turn, ranges, bumpers, volts, pan, tilt,
            width, effects}
           | rest
         ],
         messages,
         done
       ) do
    pose = %Pose{x: x, y: y, heading: heading}
    odometry = %Odometry{pose: pose, twist: %Twist{linear: linear, turn: turn}}

    with {:ok, effects} <- all(effects, &read_effect(&1, messages)) do
      entries(rest, messages, [
        {:step, id, {:reading, {:ptz, %{field_of_view: width, pan: pan, tilt: tilt}}, at_ms}, []},
        {:step, id, {:reading, {:power, volts}, at_ms}, []},
        {:step, id, {:reading, {:bumpers, bumpers}, at_ms}, []},
        {:step, id, {:reading, {:sonar, ranges}, at_ms}, effects},
        {:step, id, {:reading, {:odometry, odometry}, at_ms}, []} | done
      ])
    end
  end

  defp entries([{@message, at_ms, heard} | rest], messages, done) when is_list(heard) do
    with {:ok, done} <- read_heard(heard, at_ms, messages, done),
         do: entries(rest, messages, done)
  end

  defp entries([packed | rest], messages, done)
       when is_tuple(packed) and tuple_size(packed) > 3 do
    effects = elem(packed, tuple_size(packed) - 1)

    with {:ok, input} <- read(packed),
         {:ok, effects} <- all(effects, &read_effect(&1, messages)) do
      entries(rest, messages, [{:step, elem(packed, 1), input, effects} | done])
    end
  end

  defp entries([], _messages, done), do: {:ok, Enum.reverse(done)}
  defp entries(_other, _messages, _done), do: :error

  defp read_heard([id, number | rest], at_ms, messages, done) do
    with {:ok, message} <- at(messages, number),
         do:
           read_heard(rest, at_ms, messages, [{:step, id, {:message, message, at_ms}, []} | done])
  end

  defp read_heard([], _at_ms, _messages, done), do: {:ok, done}
  defp read_heard(_other, _at_ms, _messages, _done), do: :error

  defp read({@detections, _id, at_ms, pan, tilt, width, pose, blobs, _effects})
       when is_list(blobs) do
    with {:ok, blobs} <- all(blobs, &read_blob/1) do
      {:ok,
       {:detections,
        %Detections{
          at_ms: at_ms,
          blobs: blobs,
          pan: pan,
          tilt: tilt,
          field_of_view: width,
          pose: pose
        }}}
    end
  end

  defp read({@tick, _id, at_ms, _effects}), do: {:ok, {:tick, at_ms}}
  defp read({@reflex, _id, at_ms, _effects}), do: {:ok, {:reflex, at_ms}}
  defp read({@other, _id, input, _effects}), do: {:ok, input}
  defp read(_other), do: :error

  defp read_effect({@other, effect}, _messages), do: {:ok, effect}

  defp read_effect({linear, turn}, _messages) when is_float(linear),
    do: {:ok, {:drive, %Twist{linear: linear, turn: turn}}}

  defp read_effect({@look, pan, tilt}, _messages), do: {:ok, {:look, pan, tilt}}

  defp read_effect({@send, to, number}, messages) do
    with {:ok, message} <- at(messages, number), do: {:ok, {:send, to, message}}
  end

  defp read_effect(_other, _messages), do: :error

  defp at(messages, number)
       when is_integer(number) and number in 0..(tuple_size(messages) - 1)//1,
       do: {:ok, elem(messages, number)}

  defp at(_messages, _number), do: :error

  defp read_blob(
         {colour, area, share, x, y, left, top, right, bottom, width, height, distance, clipped?}
       ) do
    {:ok,
     %Blob{
       colour: colour,
       area: area,
       share: share,
       x: x,
       y: y,
       left: left,
       top: top,
       right: right,
       bottom: bottom,
       width: width,
       height: height,
       distance: distance,
       clipped?: clipped?
     }}
  end

  defp read_blob(_other), do: :error

  # All of a list, as `read` reads them; what is no list is an error.
  defp all([first | rest], read) do
    with {:ok, first} <- read.(first), {:ok, rest} <- all(rest, read), do: {:ok, [first | rest]}
  end

  defp all([], _read), do: {:ok, []}
  defp all(_other, _read), do: :error
end
