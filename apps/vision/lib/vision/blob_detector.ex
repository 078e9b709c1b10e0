defmodule Vision.BlobDetector do
  @moduledoc """
  Finds blobs, and marks if it is told to, in frames, in a process of its own. It works on the newest frame only: it drops older ones that wait in
  its mailbox, so it does not lag behind its camera.

  Options:

    * `:colours` - the `Vision.Colours` to look for
    * `:sink` - `{m, f, a}`; for each frame that was read it calls
      `apply(m, f, a ++ [{:detections, detections}])` with the frame's `Vision.Detections`, even
      if there are no blobs
    * `:marks` - the `Vision.Marks` to look for; `nil` (the default) for none. Without the library
      (`Vision.Marks.available/1`) the detections have none, and `status/1` says why
    * `:backend` - a `Vision.Backend`; by default the one that `Vision.blobs/4` selects
    * `:ptz` - `true`: the camera is on a pan-tilt unit, whose readings are passed to `aim/2`
    * `:clock` - `{m, f, a}` that returns integer milliseconds, by the clock of the frames
    * `:name` - as in `GenServer`

  A frame that has a direction is taken as it is. With a pan-tilt unit, any other frame gets the
  direction and field of view that the unit had when the frame was taken (`Hal.Ptz.History`); if
  they are not known, as when the unit has reported nothing for a second, the frame counts as
  wrong (`:no_aim`). Without a unit the camera is taken to look straight ahead.

  A frame that cannot be read gives no detections, so that the last ones become stale at the sink:
  to see nothing, and not to see, are different. `status/1` counts such frames.

  A camera's device passes its frames on by the sink `{Vision.BlobDetector, :frame, [detector]}`,
  a pan-tilt unit's device its readings by `{Vision.BlobDetector, :aim, [detector]}`.
  """
  use GenServer
  alias Hal.{Frame, Ptz}
  alias Vision.{Colours, Detections, Filter, Marks}

  defguardp is_aim(reading)
            when is_map(reading) and is_number(reading.pan) and is_number(reading.tilt) and
                   is_number(reading.field_of_view)

  @type status :: %{
          read: non_neg_integer(),
          dropped: non_neg_integer(),
          wrong: non_neg_integer(),
          last_error: term(),
          marks: :none | :ok | {:error, line :: String.t()}
        }

  @doc "Starts the blob detector. Wrong options raise `ArgumentError`."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options) do
    {name, options} = Keyword.split(options, [:name])
    GenServer.start_link(__MODULE__, check!(options), name)
  end

  @doc """
  Passes a frame, or a camera's reading, to the blob detector. Other readings (such as a device's
  health) are ignored.
  """
  @spec frame(GenServer.server(), Frame.t() | Hal.Camera.reading() | tuple()) :: :ok
  def frame(detector, %Frame{} = frame), do: GenServer.cast(detector, {:frame, frame})
  def frame(detector, {:frame, frame}), do: GenServer.cast(detector, {:frame, frame})
  def frame(_eye, _other_reading), do: :ok

  @doc "Passes a pan-tilt unit's reading to the blob detector. Its health, and a reading without numbers, are ignored."
  @spec aim(GenServer.server(), Hal.Ptz.reading() | tuple()) :: :ok
  def aim(detector, {:ptz, reading}) when is_aim(reading),
    do: GenServer.cast(detector, {:aim, reading})

  def aim(_eye, _other_reading), do: :ok

  @doc """
  How many frames were read, how many were dropped for a newer one, how many were wrong, and the
  last error; whether marks are looked for.
  """
  @spec status(GenServer.server()) :: status()
  def status(detector), do: GenServer.call(detector, :status)

  @impl GenServer
  def init(options) do
    counts = %{read: 0, dropped: 0, wrong: 0, last_error: nil}
    scratch = Vision.scratch(options[:colours], options[:backend])

    {:ok,
     Map.merge(Map.new(options), %{
       counts: counts,
       aim: Ptz.History.new(),
       scratch: scratch,
       detector: options[:marks] && Marks.detector(options[:marks]),
       schedule: %Marks.Schedule{}
     })}
  end

  @impl GenServer
  def handle_cast({:aim, reading}, state), do: {:noreply, note(reading, state)}

  def handle_cast({:frame, frame}, state) do
    {frame, dropped} = newest(frame, 0)
    state = state |> count(:dropped, dropped) |> newest_aim()

    with {:ok, frame} <- direct(frame, state),
         {:ok, blobs} <- read(frame, state),
         {:ok, marks, schedule} <- marks(frame, state) do
      # A backend may be anybody's.
      blobs = Filter.real(blobs, {frame.width, frame.height})
      {m, f, a} = state.sink
      apply(m, f, a ++ [{:detections, Detections.new(frame, blobs, marks)}])
      {:noreply, count(%{state | schedule: schedule}, :read, 1)}
    else
      {:error, reason} ->
        {:noreply, state |> count(:wrong, 1) |> put_in([:counts, :last_error], reason)}
    end
  end

  @impl GenServer
  def handle_call(:status, _from, state) do
    marks =
      case state.detector do
        nil -> :none
        {:ok, _detector} -> :ok
        error -> error
      end

    {:reply, Map.put(state.counts, :marks, marks), state}
  end

  # Frames that have come in the meantime are further down in the mailbox.
  defp newest(frame, dropped) do
    receive do
      {:"$gen_cast", {:frame, newer}} -> newest(newer, dropped + 1)
    after
      0 -> {frame, dropped}
    end
  end

  # Readings that the pan-tilt unit has sent in the meantime: some are from before this frame was
  # taken.
  defp newest_aim(state) do
    receive do
      {:"$gen_cast", {:aim, reading}} -> newest_aim(note(reading, state))
    after
      0 -> state
    end
  end

  defp note(reading, %{clock: {m, f, a}} = state),
    do: %{state | aim: Ptz.History.note(state.aim, reading, apply(m, f, a))}

  defp direct(%Frame{pan: nil} = frame, %{ptz: true, aim: aim}) do
    case Ptz.History.at(aim, frame.at_ms) do
      nil -> {:error, :no_aim}
      direction -> {:ok, struct!(frame, direction)}
    end
  end

  defp direct(frame, _state), do: {:ok, frame}

  defp read(%Frame{} = frame, state),
    do: Vision.blobs(frame, state.colours, state.backend, state.scratch)

  defp read(_other, _state), do: {:error, :no_frame}

  defp marks(frame, %{detector: {:ok, detector}} = state),
    do: Marks.look(state.marks, detector, state.schedule, frame)

  defp marks(_frame, state), do: {:ok, nil, state.schedule}

  defp count(state, what, n), do: update_in(state, [:counts, what], &(&1 + n))

  defp check!(options) do
    options =
      Keyword.validate!(options, [
        :colours,
        :sink,
        backend: nil,
        marks: nil,
        ptz: false,
        clock: {System, :monotonic_time, [:millisecond]}
      ])

    unless is_boolean(options[:ptz]),
      do: raise(ArgumentError, "blob detector option ptz: expected true or false")

    unless match?(%Colours{}, options[:colours]),
      do: raise(ArgumentError, "blob detector option colours: expected a %Vision.Colours{}")

    unless options[:marks] == nil or match?(%Marks{}, options[:marks]),
      do: raise(ArgumentError, "blob detector option marks: expected a %Vision.Marks{}")

    case options[:sink] do
      {m, f, a} when is_atom(m) and is_atom(f) and is_list(a) ->
        options

      other ->
        raise(
          ArgumentError,
          "blob detector option sink: expected {m, f, a}, got #{inspect(other)}"
        )
    end
  end
end
