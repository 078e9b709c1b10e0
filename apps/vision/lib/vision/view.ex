defmodule Vision.View do
  @moduledoc """
  Pictures for people (R103): the frames of a camera as JPEG, made only while somebody looks.

      {:ok, ref} = Vision.View.subscribe(view, rate: 5)
      receive do {:picture, ^ref, %Vision.View.Picture{jpeg: jpeg}} -> jpeg end
      :ok = Vision.View.next(view, ref)

  A viewer asks for each picture after the first, so that at most one lies in its mailbox: one that is
  slow or hangs slows nobody. The view in turn asks the camera's device for a frame, through a
  `t:demand/0` of one credit, when a picture is due: who does not look costs one read of a counter a
  frame. Newest wins: a frame that nobody has asked for is never copied, sent or kept.

  The pictures are made by an ffmpeg outside the VM (`Vision.Jpeg.Encoder`), which is there only while it is
  needed, and started again if it ends or hangs (`Vision.View.EncoderControl`).

  Options:

    * `:demand` - as the camera's sink has it: `{Vision.View, :frame, [view, demand]}`
    * `:viewers` - how many may look at a time, default 16
    * `:ffmpeg` - its path; looked for, by default
    * `:snapshot_ms` - how long a snapshot waits for the camera, default 5000
    * `:name` - as in `GenServer`

  Pictures do not leave their node: a viewer of another one is refused.
  """
  alias Hal.Frame
  alias Vision.View.{Picture, Server}

  @rates {0.001, 30}

  @typedoc "Holds 1 while the view wants a frame."
  @type demand :: :atomics.atomics_ref()

  @type status :: %{
          viewers: non_neg_integer(),
          made: non_neg_integer(),
          failed: non_neg_integer(),
          why: String.t() | nil,
          encoder: :open | :closed
        }

  @doc "A demand for a view and its camera's sink."
  @spec demand() :: demand()
  def demand, do: :atomics.new(1, [])

  @doc "A child of a supervisor."
  @spec child_spec(keyword()) :: Supervisor.child_spec()
  def child_spec(options), do: %{id: __MODULE__, start: {__MODULE__, :start_link, [options]}}

  @doc "Starts the view. Wrong options raise `ArgumentError`."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options) do
    {name, options} = Keyword.split(options, [:name])
    options = Keyword.validate!(options, [:demand, viewers: 16, ffmpeg: nil, snapshot_ms: 5_000])
    GenServer.start_link(Server, Map.new(options), name)
  end

  @doc "A sink for a camera's device: hands a reading on if the view has asked for one."
  @spec frame(GenServer.server(), demand(), tuple()) :: :ok
  def frame(view, demand, {:frame, %Frame{} = frame}) do
    if :atomics.get(demand, 1) == 1 and :atomics.exchange(demand, 1, 0) == 1,
      do: GenServer.cast(view, {:frame, frame}),
      else: :ok
  end

  def frame(view, _demand, {:health, _device, {condition, _since}}),
    do: GenServer.cast(view, {:camera, condition})

  # A camera that detects by itself.
  def frame(view, demand, {:detections, _detections}) do
    if :atomics.get(demand, 1) == 1 and :atomics.exchange(demand, 1, 0) == 1,
      do: GenServer.cast(view, :no_frames),
      else: :ok
  end

  def frame(_view, _demand, _other_reading), do: :ok

  @doc """
  Lets this process look. It gets `{:picture, ref, %Vision.View.Picture{}}`, a first one as soon as there is
  one and each further one when it asks (`next/2`), at most `rate:` a second (0.001 to 30, default 5).
  `ref` is also a monitor of the view.
  """
  @spec subscribe(GenServer.server(), keyword()) ::
          {:ok, reference()} | {:error, line :: String.t()}
  def subscribe(view, options \\ []) do
    with {:ok, every_ms} <- every(options), {:ok, pid} <- here(view) do
      ref = Process.monitor(pid)

      case ask(pid, {:subscribe, ref, every_ms}) do
        :ok ->
          {:ok, ref}

        error ->
          Process.demonitor(ref, [:flush])
          error
      end
    end
  end

  @doc "Whether the calling process looks by this `ref`."
  @spec looks?(GenServer.server(), reference()) :: boolean()
  def looks?(view, ref) when is_reference(ref) do
    with {:ok, pid} <- here(view), do: ask(pid, {:looks, ref}) == true, else: (_error -> false)
  end

  @doc "Asks for the next picture."
  @spec next(GenServer.server(), reference()) :: :ok
  def next(view, ref) when is_reference(ref), do: GenServer.cast(view, {:next, ref})

  @doc "Ends looking. A picture that was under way may still be in the mailbox."
  @spec unsubscribe(GenServer.server(), reference()) :: :ok
  def unsubscribe(view, ref) when is_reference(ref) do
    Process.demonitor(ref, [:flush])
    GenServer.cast(view, {:unsubscribe, ref})
  end

  @doc "One picture of now, or a line that says why there is none. Waits 5 s at most, unless the view says otherwise."
  @spec snapshot(GenServer.server()) :: {:ok, Picture.t()} | {:error, line :: String.t()}
  def snapshot(view) do
    with {:ok, pid} <- here(view), do: ask(pid, :snapshot)
  end

  @doc "How many look, how many pictures were made, how often ffmpeg failed, and why it last did."
  @spec status(GenServer.server()) :: status()
  def status(view), do: GenServer.call(view, :status)

  defp here(view) do
    case GenServer.whereis(view) do
      nil -> {:error, "there is no camera here"}
      pid when is_pid(pid) and node(pid) == node() -> {:ok, pid}
      pid when is_pid(pid) -> {:error, Server.elsewhere(node(pid), node())}
      {_name, there} -> {:error, Server.elsewhere(there, node())}
    end
  end

  # The server has its own clock for all that it waits for.
  defp ask(pid, request) do
    GenServer.call(pid, request, :infinity)
  catch
    :exit, {_gone, {GenServer, :call, _call}} -> {:error, "the view of the camera has ended"}
  end

  defp every(options) do
    {lowest, highest} = @rates

    case options do
      [] ->
        {:ok, 200}

      [rate: rate] when is_number(rate) and rate >= lowest and rate <= highest ->
        {:ok, round(1000 / rate)}

      [rate: rate] ->
        {:error,
         "rate cannot be #{shown(rate)}: pictures a second are allowed, #{lowest} to #{highest}"}

      other ->
        {:error, "#{shown(other)} is not an option of a viewer; it has rate: pictures a second"}
    end
  end

  defp shown(value), do: inspect(value, limit: 5, printable_limit: 40)
end
