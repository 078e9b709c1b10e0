defmodule Vision.View do
  @moduledoc """
  Pictures for people: the frames of a camera as JPEG, made only while there is a viewer.

      {:ok, ref} = Vision.View.subscribe(view, rate: 5)
      receive do {:picture, ^ref, %Vision.View.Picture{jpeg: jpeg}} -> jpeg end
      :ok = Vision.View.next(view, ref)

  A viewer requests each picture after the first, so that at most one is in its mailbox: a viewer
  that is slow or hangs does not slow others down. The view in turn requests a frame from the
  camera's device, through a `t:demand/0` of one credit, when a picture is due. Without a request
  a frame costs one read of a counter. The newest frame wins: a frame that was not requested is
  not copied, sent or kept.

  An ffmpeg outside the VM makes the pictures (`Vision.Jpeg.Encoder`). It runs only while it is
  needed, and is restarted if it ends or hangs (`Vision.View.EncoderControl`).

  Options:

    * `:demand` - the one in the camera's sink, `{Vision.View, :frame, [view, demand]}`
    * `:viewers` - how many viewers there may be at a time, default 16
    * `:ffmpeg` - its path; by default the view looks for it
    * `:snapshot_ms` - how long a snapshot waits for the camera, default 5000
    * `:name` - as in `GenServer`

  Pictures do not leave their node: a viewer on another one is refused.
  """
  alias Hal.Frame
  alias Vision.View.{Picture, Server}

  @rates {0.001, 30}

  @typedoc "Holds 1 while the view requests a frame."
  @type demand :: :atomics.atomics_ref()

  @type status :: %{
          viewers: non_neg_integer(),
          made: non_neg_integer(),
          failed: non_neg_integer(),
          why: String.t() | nil,
          encoder: :open | :closed
        }

  @doc "A demand, to share between a view and its camera's sink."
  @spec demand() :: demand()
  def demand, do: :atomics.new(1, [])

  @doc "The child specification of a view."
  @spec child_spec(keyword()) :: Supervisor.child_spec()
  def child_spec(options), do: %{id: __MODULE__, start: {__MODULE__, :start_link, [options]}}

  @doc "Starts the view. Wrong options raise `ArgumentError`."
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options) do
    {name, options} = Keyword.split(options, [:name])
    options = Keyword.validate!(options, [:demand, viewers: 16, ffmpeg: nil, snapshot_ms: 5_000])
    GenServer.start_link(Server, Map.new(options), name)
  end

  @doc """
  A sink for a camera's device: passes a frame on if the view has requested one, and each change
  of the camera's health.
  """
  @spec frame(GenServer.server(), demand(), tuple()) :: :ok
  def frame(view, demand, {:frame, %Frame{} = frame}) do
    if :atomics.get(demand, 1) == 1 and :atomics.exchange(demand, 1, 0) == 1,
      do: GenServer.cast(view, {:frame, frame}),
      else: :ok
  end

  def frame(view, _demand, {:health, _device, {condition, _since}}),
    do: GenServer.cast(view, {:camera, condition})

  # From a camera that detects blobs by itself.
  def frame(view, demand, {:detections, _detections}) do
    if :atomics.get(demand, 1) == 1 and :atomics.exchange(demand, 1, 0) == 1,
      do: GenServer.cast(view, :no_frames),
      else: :ok
  end

  def frame(_view, _demand, _other_reading), do: :ok

  @doc """
  Subscribes the calling process. It receives `{:picture, ref, %Vision.View.Picture{}}`, the first
  one as soon as it is made and each further one after a request (`next/2`), at most `rate:` per
  second (0.001 to 30, default 5). `ref` is also a monitor of the view.
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

  @doc "Whether the calling process is subscribed with this `ref`."
  @spec looks?(GenServer.server(), reference()) :: boolean()
  def looks?(view, ref) when is_reference(ref) do
    with {:ok, pid} <- here(view), do: ask(pid, {:looks, ref}) == true, else: (_error -> false)
  end

  @doc "Requests the next picture."
  @spec next(GenServer.server(), reference()) :: :ok
  def next(view, ref) when is_reference(ref), do: GenServer.cast(view, {:next, ref})

  @doc "Ends the subscription. A picture that was on its way may still be in the mailbox."
  @spec unsubscribe(GenServer.server(), reference()) :: :ok
  def unsubscribe(view, ref) when is_reference(ref) do
    Process.demonitor(ref, [:flush])
    GenServer.cast(view, {:unsubscribe, ref})
  end

  @doc """
  One new picture, or a line that says why there is none. Waits for the view's `:snapshot_ms` at
  most, by default 5 s.
  """
  @spec snapshot(GenServer.server()) :: {:ok, Picture.t()} | {:error, line :: String.t()}
  def snapshot(view) do
    with {:ok, pid} <- here(view), do: ask(pid, :snapshot)
  end

  @doc """
  The number of viewers, how many pictures were made, how often ffmpeg failed, and why it failed
  last.
  """
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

  # The server itself limits how long it waits for anything.
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
        {:error, "rate: expected #{lowest} to #{highest} pictures a second, got #{shown(rate)}"}

      other ->
        {:error, "viewer: expected rate: pictures a second, got #{shown(other)}"}
    end
  end

  defp shown(value), do: inspect(value, limit: 5, printable_limit: 40)
end
