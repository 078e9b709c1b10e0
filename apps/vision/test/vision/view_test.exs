defmodule Vision.ViewTest do
  use ExUnit.Case, async: true
  alias Hal.Frame
  alias Vision.View
  alias Vision.View.{EncoderControl, Picture, Subscribers}
  @moduletag :realtime

  @moduletag if(System.find_executable("ffmpeg"), do: [], else: [skip: "ffmpeg is missing"])
  @full "scale=in_range=full:out_range=full:in_color_matrix=bt601:out_color_matrix=bt601"

  # A view, and a real camera that looks at ffmpeg's test picture, 100 times a second.
  defp view(options \\ []) do
    demand = View.demand()
    view = start_supervised!({View, Keyword.merge([demand: demand], options)})
    {view, demand}
  end

  defp look(options \\ [], source \\ "lavfi:testsrc2=size=64x48:rate=100") do
    {view, demand} = view(options)

    start_supervised!(
      {Hal.Device,
       kind: :camera,
       driver: {Hal.Camera.FFmpeg, source: source},
       sinks: [{View, :frame, [view, demand]}]}
    )

    view
  end

  defp frame(width \\ 4, height \\ 2) do
    {:ok, frame} = Frame.new(:yuyv, width, height, :binary.copy(<<128>>, 2 * width * height), 7)
    frame
  end

  defp pictures(view, ref, count) do
    for _ <- 1..count do
      assert_receive {:picture, ^ref, picture}, 10_000
      View.next(view, ref)
      picture
    end
  end

  defp ffmpeg!(arguments) do
    {out, 0} = System.cmd("ffmpeg", ~w(-nostdin -loglevel error) ++ arguments)
    out
  end

  @tag :tmp_dir
  test "frames of every format are the same picture as JPEG", %{tmp_dir: folder} do
    {view, demand} = view()

    raw = %{yuyv: "yuyv422", i420: "yuv420p", nv12: "nv12", yuv444: "yuv444p", rgb24: "rgb24"}

    # Blurred a little, as a lens does; each format also in an odd shape, where it allows that.
    sizes = %{yuyv: {320, 239}, i420: {96, 64}, nv12: {96, 64}, yuv444: {97, 65}, rgb24: {97, 65}}
    jpeg = Path.join(folder, "a.jpg")

    for format <- Frame.formats(), {width, height} <- [{64, 48}, sizes[format]] do
      source = "testsrc=size=#{width}x#{height}"
      filter = "scale=out_range=full:out_color_matrix=bt601,format=#{raw[format]},gblur=sigma=1"

      bytes =
        ffmpeg!(
          ~w(-f lavfi -i #{source} -vf #{filter},format=#{raw[format]} -frames:v 1) ++
            ~w(-f rawvideo -pix_fmt #{raw[format]} pipe:1)
        )

      {:ok, frame} = Frame.new(format, width, height, bytes, 5)
      task = Task.async(fn -> View.snapshot(view) end)
      feed(view, demand, frame)

      assert {:ok, %Picture{width: ^width, height: ^height, at_ms: 5} = picture} =
               Task.await(task)

      File.write!(jpeg, picture.jpeg)

      again = ffmpeg!(["-i", jpeg] ++ ~w(-vf #{@full},format=#{raw[format]} -f rawvideo pipe:1))

      assert byte_size(again) == byte_size(bytes)
      assert psnr(bytes, again) > 35.0, "#{format}: #{psnr(bytes, again)} dB"
    end
  end

  # Until the view has asked for a frame.
  defp feed(view, demand, %Frame{} = frame), do: feed(view, demand, {:frame, frame})

  defp feed(view, demand, reading) do
    if :atomics.get(demand, 1) == 1 do
      View.frame(view, demand, reading)
    else
      receive do
        :never -> :ok
      after
        1 -> feed(view, demand, reading)
      end
    end
  end

  # In dB, over all bytes.
  defp psnr(one, other) do
    square =
      Enum.zip_reduce(:binary.bin_to_list(one), :binary.bin_to_list(other), 0, fn a, b, sum ->
        sum + (a - b) * (a - b)
      end)

    10 * :math.log10(255 * 255 * byte_size(one) / max(square, 1))
  end

  test "a snapshot of a real camera; then nobody looks, and nothing is made" do
    view = look()
    assert {:ok, %Picture{jpeg: <<0xFF, 0xD8, _::binary>>, width: 64}} = View.snapshot(view)
    assert %{made: 1, viewers: 0, encoder: :open, failed: 0} = View.status(view)
    ffmpeg = children_of_view(view)
    # What the clock says after 5 s.
    send(view, {EncoderControl, :idle, 1})
    assert %{made: 1, encoder: :closed} = View.status(view)
    for pid <- ffmpeg, do: assert(gone?(pid))
  end

  test "while nobody looks, not even a message is sent" do
    {view, demand} = view()
    :sys.suspend(view)
    for _ <- 1..1_000, do: View.frame(view, demand, {:frame, frame()})
    assert Process.info(view, :message_queue_len) == {:message_queue_len, 0}
    :sys.resume(view)
    assert %{made: 0, encoder: :closed} = View.status(view)
  end

  test "a view that hangs is sent one frame, however many there are" do
    {view, demand} = view()
    {:ok, _ref} = View.subscribe(view)
    assert %{viewers: 1} = View.status(view)
    :sys.suspend(view)
    for _ <- 1..1_000, do: View.frame(view, demand, {:frame, frame()})
    assert Process.info(view, :message_queue_len) == {:message_queue_len, 1}
    :sys.resume(view)
  end

  test "a viewer gets what it asks for, in the order of time, at its rate" do
    view = look()
    {:ok, ref} = View.subscribe(view, rate: 20)
    [%{at_ms: first} | _] = taken = pictures(view, ref, 12)
    times = Enum.map(taken, & &1.at_ms)
    assert times == Enum.sort(times) and length(Enum.uniq(times)) == 12
    # 11 pictures behind the first one, each 50 ms later; two may come early.
    assert List.last(times) - first >= 9 * 50
    View.unsubscribe(view, ref)
    assert %{viewers: 0} = View.status(view)
  end

  test "a viewer that never asks gets one picture and slows nobody; one that dies is forgotten" do
    view = look()
    test = self()

    slow =
      spawn(fn ->
        {:ok, _ref} = View.subscribe(view, rate: 30)
        send(test, :looks)
        receive do: (:never -> :ok)
      end)

    assert_receive :looks, 5_000
    {:ok, ref} = View.subscribe(view, rate: 30)
    pictures(view, ref, 20)
    assert Process.info(slow, :message_queue_len) == {:message_queue_len, 1}
    assert %{viewers: 2} = View.status(view)
    monitor = Process.monitor(slow)
    Process.exit(slow, :kill)
    assert_receive {:DOWN, ^monitor, :process, _, :killed}
    pictures(view, ref, 1)
    assert %{viewers: 1} = View.status(view)
  end

  test "an ffmpeg that is killed, or hangs, is told of and replaced" do
    view = look()
    test = self()

    for event <- [:failed, :healed] do
      handler = {__MODULE__, event, view}

      :ok = Hal.Event.attach(handler, [:vision, :view, event], &__MODULE__.tell/4, {view, test})

      on_exit(fn -> Hal.Event.detach(handler) end)
    end

    {:ok, ref} = View.subscribe(view, rate: 30)

    for {signal, reasons} <- [{"-KILL", [137, :epipe, :closed]}, {"-STOP", [:late]}] do
      pictures(view, ref, 2)

      # The last one that is made before the signal; only one that is asked for after it can come late.
      assert_receive {:picture, ^ref, _picture}, 10_000
      [pid] = children_of_view(view)
      {_, 0} = System.cmd("kill", [signal, pid])
      on_exit(fn -> System.cmd("kill", ["-KILL", pid], stderr_to_stdout: true) end)
      View.next(view, ref)
      assert_receive {:failed, %{reason: reason, line: line}}, 15_000
      reason = with {:exit, reason} <- reason, do: reason
      assert reason in reasons and line =~ "ffmpeg"
      assert gone?(pid)
      pictures(view, ref, 3)
      assert_receive {:healed, _}, 10_000
    end

    assert %{failed: 2, why: "ffmpeg gave no picture in time"} = View.status(view)
  end

  @doc false
  def tell([:vision, :view, event], _measured, %{view: view} = about, {view, test}),
    do: send(test, {event, about})

  def tell(_event, _measured, _another, _config), do: :ok

  test "an ffmpeg that hangs does not outlive a view that is ended" do
    {view, demand} = view()
    {:ok, ref} = View.subscribe(view, rate: 30)
    feed(view, demand, frame(320, 240))
    pictures(view, ref, 1)
    [pid] = children_of_view(view)
    {_, 0} = System.cmd("kill", ["-STOP", pid])
    on_exit(fn -> System.cmd("kill", ["-KILL", pid], stderr_to_stdout: true) end)
    # More than its pipe holds, and so more than a port that is only closed gets rid of.
    feed(view, demand, frame(320, 240))
    stop_supervised!(View)
    assert gone?(pid)
  end

  test "what is no ffmpeg is said, and tried again later and later" do
    view = look(ffmpeg: "/bin/echo")
    assert {:error, "ffmpeg " <> _} = View.snapshot(view)
    assert {:error, "ffmpeg " <> _} = View.snapshot(view)
    assert %{made: 0, failed: 2} = View.status(view)
  end

  test "a camera that gives another shape gets another encoder" do
    {view, demand} = view()

    for width <- [4, 8, 4] do
      task = Task.async(fn -> View.snapshot(view) end)
      feed(view, demand, frame(width, 2))
      assert {:ok, %{width: ^width}} = Task.await(task)
    end
  end

  test "a frame that is none makes no picture, and the next one does" do
    {view, demand} = view()
    task = Task.async(fn -> View.snapshot(view) end)
    feed(view, demand, %{frame() | bytes: <<1>>})
    assert {:error, "the camera gave something that is not a frame"} = Task.await(task)
    task = Task.async(fn -> View.snapshot(view) end)
    feed(view, demand, frame())
    assert {:ok, %{width: 4}} = Task.await(task)
  end

  test "why there is no picture: offline, no frames, blobs only, too many, another node, ended" do
    {view, demand} = view(snapshot_ms: 500, viewers: 1)
    assert {:error, "the camera gave no frame within 500 ms"} = View.snapshot(view)
    View.frame(view, demand, {:health, :camera, {{:offline, :enoent}, 0}})
    assert {:error, "the camera is offline (:enoent)"} = View.snapshot(view)
    View.frame(view, demand, {:health, :camera, {:online, 0}})
    {:ok, ref} = View.subscribe(view)
    assert {:error, "1 viewers are the maximum"} = View.snapshot(view)
    View.unsubscribe(view, ref)
    assert %{viewers: 0} = View.status(view)
    task = Task.async(fn -> View.snapshot(view) end)

    feed(
      view,
      demand,
      {:detections, %Vision.Detections{blobs: [], at_ms: 1, pan: 0.0, tilt: 0.0}}
    )

    assert {:error, "this camera gives coloured blobs, and no pictures"} = Task.await(task)

    for bad <- [[rate: 0], [rate: 1.0e300], [rate: "5"], [speed: 1], :fast] do
      assert {:error, line} = View.subscribe(view, bad)
      refute line =~ "\n"
    end

    assert {:error, line} = View.subscribe({View, :"mag2@far.away"})
    assert line =~ "do not leave their node: the camera is on mag2@far.away"
    stop_supervised!(View)
    assert {:error, "the view of the camera has ended"} = View.snapshot(view)
    assert {:error, "there is no camera here"} = View.snapshot(:no_view_of_this_name)
  end

  test "ffmpeg ends with its view" do
    view = look()
    {:ok, ref} = View.subscribe(view)
    pictures(view, ref, 1)
    [pid] = children_of_view(view)
    Process.exit(view, :kill)
    assert_receive {:DOWN, ^ref, :process, _, :killed}
    assert gone?(pid)
  end

  test "whoever asks when: no viewer faster than its rate, none forgotten, no picture for nobody" do
    for _ <- 1..100 do
      every = for id <- 1..3, into: %{}, do: {id, :rand.uniform(100)}

      subscribers =
        Enum.reduce(every, Subscribers.new(3), fn {id, ms}, subscribers ->
          {:ok, subscribers} = Subscribers.join(subscribers, id, ms, 0)
          subscribers
        end)

      {_audience, served} =
        Enum.reduce(1..300, {subscribers, %{}}, fn step, {subscribers, served} ->
          now = 7 * step
          due = Subscribers.due(subscribers, now)
          {ids, subscribers} = Subscribers.serve(subscribers, now)
          assert due == 0 == (ids != [])
          served = Enum.reduce(ids, served, &Map.update(&2, &1, 1, fn n -> n + 1 end))
          asks = Enum.filter(1..3, fn _ -> :rand.uniform(2) == 1 end)
          {Enum.reduce(asks, subscribers, &Subscribers.ask(&2, &1)), served}
        end)

      for {id, count} <- served, do: assert(count <= div(2_100, every[id]) + 2)
    end
  end

  # The processes that a view's port runs: ffmpeg, which has taken the place of `nice`.
  defp children_of_view(view) do
    for port <- Port.list(),
        Port.info(port, :connected) == {:connected, view},
        {:os_pid, pid} <- [Port.info(port, :os_pid)],
        do: "#{pid}"
  end

  defp gone?(pid, left_ms \\ 20_000)
  defp gone?(_pid, left_ms) when left_ms <= 0, do: false

  defp gone?(pid, left_ms) do
    case File.read("/proc/#{pid}/stat") do
      {:error, _} ->
        true

      {:ok, stat} ->
        stat =~ ~r/\) Z / or
          receive do
            :never -> false
          after
            20 -> gone?(pid, left_ms - 20)
          end
    end
  end
end
