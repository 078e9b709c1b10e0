defmodule Record.Recording.Tick.Unpack do
  @moduledoc "Reads what `Record.Recording.Tick.pack/1` has packed; what it does not make is an error. Pure."
  alias Hal.{Odometry, Pose, Twist}
  alias Vision.{Blob, Detections}

  @other 0
  @readings 1
  @detections 2
  @message 3
  @tick 4
  @reflex 5
  @look 6
  @send 7

  @doc "The entries of packed ones behind those that are `done`, which are newest first."
  @spec entries(list(), messages :: tuple(), done :: [Record.Recording.Tick.entry()]) ::
          {:ok, [Record.Recording.Tick.entry()]} | :error
  def entries(packed, messages, done)

  def entries([{:world, _at_ms, _event} = entry | rest], messages, done),
    do: entries(rest, messages, [entry | done])

  def entries(
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

    with {:ok, effects} <- all(effects, &effect(&1, messages)) do
      entries(rest, messages, [
        {:step, id, {:reading, {:ptz, %{field_of_view: width, pan: pan, tilt: tilt}}, at_ms}, []},
        {:step, id, {:reading, {:power, volts}, at_ms}, []},
        {:step, id, {:reading, {:bumpers, bumpers}, at_ms}, []},
        {:step, id, {:reading, {:sonar, ranges}, at_ms}, effects},
        {:step, id, {:reading, {:odometry, odometry}, at_ms}, []} | done
      ])
    end
  end

  def entries([{@message, at_ms, heard} | rest], messages, done) when is_list(heard) do
    with {:ok, done} <- read_heard(heard, at_ms, messages, done),
         do: entries(rest, messages, done)
  end

  def entries([packed | rest], messages, done) when is_tuple(packed) and tuple_size(packed) > 3 do
    effects = elem(packed, tuple_size(packed) - 1)

    with {:ok, input} <- read(packed),
         {:ok, effects} <- all(effects, &effect(&1, messages)) do
      entries(rest, messages, [{:step, elem(packed, 1), input, effects} | done])
    end
  end

  def entries([], _messages, done), do: {:ok, Enum.reverse(done)}
  def entries(_other, _messages, _done), do: :error

  defp read_heard([id, number | rest], at_ms, messages, done) do
    with {:ok, message} <- at(messages, number),
         do:
           read_heard(rest, at_ms, messages, [{:step, id, {:message, message, at_ms}, []} | done])
  end

  defp read_heard([], _at_ms, _messages, done), do: {:ok, done}
  defp read_heard(_other, _at_ms, _messages, _done), do: :error

  defp read({@detections, _id, at_ms, pan, tilt, width, pose, blobs, _effects})
       when is_list(blobs) do
    with {:ok, blobs} <- all(blobs, &blob/1) do
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

  defp effect({@other, effect}, _messages), do: {:ok, effect}

  defp effect({linear, turn}, _messages) when is_float(linear),
    do: {:ok, {:drive, %Twist{linear: linear, turn: turn}}}

  defp effect({@look, pan, tilt}, _messages), do: {:ok, {:look, pan, tilt}}

  defp effect({@send, to, number}, messages) do
    with {:ok, message} <- at(messages, number), do: {:ok, {:send, to, message}}
  end

  defp effect(_other, _messages), do: :error

  defp at(messages, number)
       when is_integer(number) and number in 0..(tuple_size(messages) - 1)//1,
       do: {:ok, elem(messages, number)}

  defp at(_messages, _number), do: :error

  defp blob(
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

  defp blob(_other), do: :error

  # All of a list, as `read` reads them; what is no list is an error.
  defp all([first | rest], read) do
    with {:ok, first} <- read.(first), {:ok, rest} <- all(rest, read), do: {:ok, [first | rest]}
  end

  defp all([], _read), do: {:ok, []}
  defp all(_other, _read), do: :error
end
