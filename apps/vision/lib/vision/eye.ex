defmodule Vision.Eye do
  @moduledoc """
  The process that makes blobs of frames. It works on the newest frame only: older ones that
  wait in its mailbox are dropped, so it never falls behind its camera.

  Options:

    * `:colours` - the `Vision.Colours` to look for
    * `:sink` - `{m, f, a}`; each frame that was read gives
      `apply(m, f, a ++ [{:blobs, blobs, %{at_ms: …, pan: …, tilt: …}}])`, also without blobs
    * `:backend` - a `Vision.Backend`; by default the fastest that reads the frame
    * `:name` - as in `GenServer`

  A frame that cannot be read gives nothing, so that its blobs grow old at the sink: "seen
  nothing" and "did not see" are not the same. `status/1` counts them.

  A camera's device feeds it with the sink `{Vision.Eye, :frame, [eye]}`.
  """
  use GenServer
  alias Hal.Frame
  alias Vision.Colours

  @type meta :: %{at_ms: integer(), pan: float(), tilt: float()}
  @type status :: %{
          read: non_neg_integer(),
          dropped: non_neg_integer(),
          wrong: non_neg_integer(),
          last_error: term()
        }

  @doc "Starts the eye. Wrong options raise `ArgumentError`."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options) do
    {name, options} = Keyword.split(options, [:name])
    GenServer.start_link(__MODULE__, check!(options), name)
  end

  @doc "Hands a frame, or a camera's reading, to the eye. Other readings (a device's health) are passed over."
  @spec frame(GenServer.server(), Frame.t() | Hal.Camera.reading() | tuple()) :: :ok
  def frame(eye, %Frame{} = frame), do: GenServer.cast(eye, {:frame, frame})
  def frame(eye, {:frame, frame}), do: GenServer.cast(eye, {:frame, frame})
  def frame(_eye, _other_reading), do: :ok

  @doc "How many frames were read, dropped for a newer one, and wrong, and what was wrong with the last of these."
  @spec status(GenServer.server()) :: status()
  def status(eye), do: GenServer.call(eye, :status)

  @impl GenServer
  def init(options) do
    counts = %{read: 0, dropped: 0, wrong: 0, last_error: nil}
    {:ok, Map.merge(Map.new(options), %{counts: counts})}
  end

  @impl GenServer
  def handle_cast({:frame, frame}, state) do
    {frame, dropped} = newest(frame, 0)
    state = count(state, :dropped, dropped)

    case read(frame, state) do
      {:ok, blobs} ->
        {m, f, a} = state.sink
        apply(m, f, a ++ [{:blobs, blobs, Map.take(frame, [:at_ms, :pan, :tilt])}])
        {:noreply, count(state, :read, 1)}

      {:error, reason} ->
        {:noreply, state |> count(:wrong, 1) |> put_in([:counts, :last_error], reason)}
    end
  end

  @impl GenServer
  def handle_call(:status, _from, state), do: {:reply, state.counts, state}

  # The frames that came in the meantime are further down in our own mailbox.
  defp newest(frame, dropped) do
    receive do
      {:"$gen_cast", {:frame, newer}} -> newest(newer, dropped + 1)
    after
      0 -> {frame, dropped}
    end
  end

  defp read(%Frame{} = frame, state), do: Vision.blobs(frame, state.colours, state.backend)
  defp read(_other, _state), do: {:error, :no_frame}

  defp count(state, what, n), do: update_in(state, [:counts, what], &(&1 + n))

  defp check!(options) do
    options = Keyword.validate!(options, [:colours, :sink, backend: nil])

    unless match?(%Colours{}, options[:colours]),
      do: raise(ArgumentError, "eye option :colours must be a %Vision.Colours{}")

    case options[:sink] do
      {m, f, a} when is_atom(m) and is_atom(f) and is_list(a) -> options
      other -> raise(ArgumentError, "eye option :sink must be {m, f, a}, not #{inspect(other)}")
    end
  end
end
