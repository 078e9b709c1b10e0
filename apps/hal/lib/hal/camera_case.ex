defmodule Hal.CameraCase do
  @moduledoc """
  Runs the driver of any camera at one that is emulated, and says what does not hold that must hold for all. For tests:

      @tag timeout: 300_000
      test "what holds for every camera" do
        driver = {Hal.Camera.FFmpeg, &[source: "unix://" <> &1, unsafe: true]}
        assert Hal.CameraCase.problems(driver, {Mine.EmulatedCamera, []}, size: {64, 48}, format: :yuyv) == []
      end

  `Hal.Device` runs the driver, as in a robot. Its options are a function of the link to the emulated camera, a path, or a list to
  which the kit adds the link as `port:`. The camera is a `Hal.Emulated` with the callbacks below; it gives ten pictures a second
  or more, and its noise falls into the middle of a picture, whose rest is lost. Each rule is a run of its own, in real time.

  | rule | must hold |
  |---|---|
  | `:options` | an option that it does not know is refused in one line that names it |
  | `:missing` | a camera that is not there is an error, and in words one line that names it; once it is there it sees |
  | `:pictures` | pictures have the size, the format and all the bytes that they should; their times, by the clock of the robot, are of now, do not go back, and do not stand |
  | `:sees` | what is before the camera is in its pictures |
  | `:newest` | while nothing takes its pictures none queue, and then the newest comes |
  | `:junk` | noise and cut pictures neither end it nor make its state grow, and it sees on |
  | `:messages` | nor do messages that it does not know |
  | `:unplug` | a camera that is gone is an error, and once it is back it sees again |
  | `:restart` | a camera that is switched off and on is found again |
  | `:program` | so is one whose port program was killed |
  | `:close`, `:killed` | after the end of the device, or the killing of its process, nothing comes, and no program of its runs on (on Linux) |
  """
  alias Hal.{Clock, DeviceCase, Frame, Options}
  import Hal.DeviceCase, only: [await: 3, on_emulated: 3, tell: 3]

  @doc "What is before the camera from now on: one of two scenes."
  @callback show(GenServer.server(), scene :: 0 | 1) :: :ok

  @doc "Which scene this is, by a frame or by the detections of a camera that detects by itself; `nil` if neither."
  @callback scene(picture :: struct()) :: 0 | 1 | nil

  @rules DeviceCase.rules([:pictures, :sees, :newest])
  @table DeviceCase.table(@rules, 300_000) ++
           [
             size: [{:check, &__MODULE__.size?/1, "{width, height}"}, default: nil],
             format: [{:one_of, Frame.formats()}, default: nil]
           ]
  @pictures 10
  # Within so many pictures it shows what is before it.
  @tries 100
  # A picture is no older than this when it comes.
  @old_ms 2_000
  # So long nothing takes its pictures.
  @slow_ms 2_000
  # What a device may have in its mailbox then, and how many pictures of before may come after.
  @queued 5
  @behind 3

  @doc """
  What does not hold, one line each. Options: `only` (these rules), `size` (`{width, height}`) and `format` of its frames (not judged
  unless given; a camera that detects by itself has none), `wait_ms` (how long a busy machine may take for what must come, 20,000),
  `bytes` (how large the device's state may be, 300,000), `seed` (of the noise). Raises `ArgumentError` for options that are wrong.
  """
  @spec problems(
          driver :: {module(), keyword() | (link :: String.t() -> keyword())},
          camera :: {module(), keyword()},
          keyword()
        ) :: [String.t()]
  def problems({_, _} = driver, {_, _} = camera, options \\ []) do
    options = Options.check!(options, @table, "camera case")
    t = %DeviceCase{kind: :camera, driver: driver, emulated: camera, options: options}
    DeviceCase.problems(t, &rule/2)
  end

  @doc false
  def size?({width, height}), do: width in 1..32_768 and height in 1..32_768
  def size?(_other), do: false

  defp rule(:pictures, t), do: on_emulated(t, [], &pictures(&1, @pictures, []))

  defp rule(:sees, t) do
    on_emulated(t, [], fn t ->
      with :ok <- sees(t, 0, "one scene"),
           :ok <- sees(t, 1, "another scene"),
           do: sees(t, 0, "the first scene again")
    end)
  end

  defp rule(:newest, t) do
    sinks = [{__MODULE__, :hear_slowly, [self(), t.ref]}]

    on_emulated(t, [sinks: sinks], fn t ->
      :ok = tell(t, :show, [0])

      with {:ok, slow} <- first(t, @tries) do
        :ok = tell(t, :show, [1])
        with :ok <- unasked(t), do: newest(t, slow, @behind)
      end
    end)
  end

  defp rule(rule, t), do: DeviceCase.rule(rule, t, &sees(&1, rem(&2, 2), &3))

  defp sees(%{emulated: {camera, _options}} = t, scene, what) do
    :ok = tell(t, :show, [scene])
    shown = &if(camera.scene(&1) == scene, do: &1)

    with {:ok, _picture} <- await(t, "does not see #{what}", &taken(&1, shown)), do: :ok
  end

  # A picture of either kind, with what the function makes of it.
  defp taken({kind, picture}, look) when kind in [:frame, :detections], do: look.(picture)
  defp taken(_other, _look), do: nil

  defp pictures(_t, 0, [newest | older]) do
    if newest.at_ms > List.last(older).at_ms,
      do: :ok,
      else: {:error, "the time of its pictures stands"}
  end

  defp pictures(t, left, before) do
    with {:ok, picture} <- await(t, "gives no picture", &taken(&1, fn picture -> picture end)),
         :ok <- whole(t.options, picture),
         :ok <- timely(picture, before, Clock.now_ms()),
         do: pictures(t, left - 1, [picture | before])
  end

  defp whole(options, %Frame{format: format, width: width, height: height, bytes: bytes}) do
    cond do
      options[:size] not in [nil, {width, height}] ->
        {:error, "its pictures are #{width} x #{height}"}

      options[:format] not in [nil, format] ->
        {:error, "its pictures are #{inspect(format)}"}

      Frame.byte_size(format, width, height) != {:ok, byte_size(bytes)} ->
        {:error,
         "#{byte_size(bytes)} bytes are no picture of #{width} x #{height} in #{inspect(format)}"}

      true ->
        :ok
    end
  end

  defp whole(_options, _detections), do: :ok

  defp timely(%{at_ms: at_ms}, before, now_ms) do
    cond do
      not is_integer(at_ms) or at_ms > now_ms or at_ms < now_ms - @old_ms ->
        {:error, "a picture that comes at #{now_ms} ms is of #{inspect(at_ms)} ms"}

      match?([%{at_ms: last_ms} | _] when last_ms > at_ms, before) ->
        {:error, "the time of its pictures goes back"}

      true ->
        :ok
    end
  end

  # With a picture the sink waits, and the device with it.
  @doc false
  def hear_slowly(pid, ref, {kind, _picture} = reading) when kind in [:frame, :detections] do
    send(pid, {ref, {:held, self(), reading}})

    receive do
      {^ref, :go_on} -> :ok
      # Its end is not delayed.
      {:EXIT, _from, :shutdown} = shutdown -> send(self(), shutdown)
    end
  end

  def hear_slowly(_pid, _ref, _health), do: :ok

  # The device, held with a picture of the first scene.
  defp first(_t, 0), do: {:error, "does not see one scene"}

  defp first(%{emulated: {camera, _options}} = t, left) do
    with {:ok, {device, picture}} <- await(t, "gives no picture", &held/1) do
      if camera.scene(picture) == 0 do
        {:ok, device}
      else
        send(device, {t.ref, :go_on})
        first(t, left - 1)
      end
    end
  end

  defp held({:held, device, {_kind, picture}}), do: {device, picture}
  defp held(_other), do: nil

  defp unasked(t) do
    receive do
    after
      @slow_ms -> :ok
    end

    {:message_queue_len, queued} = Process.info(t.device, :message_queue_len)

    if queued > @queued,
      do: {:error, "#{queued} messages queue while nothing takes its pictures"},
      else: :ok
  end

  defp newest(%{emulated: {camera, _options}} = t, device, left) do
    send(device, {t.ref, :go_on})

    with {:ok, {device, picture}} <- await(t, "gives no picture after it had to wait", &held/1) do
      cond do
        camera.scene(picture) == 1 -> :ok
        left == 0 -> {:error, "gives old pictures after it had to wait"}
        true -> newest(t, device, left - 1)
      end
    end
  end
end
