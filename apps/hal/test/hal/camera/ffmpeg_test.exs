defmodule Hal.Camera.FFmpegTest do
  use ExUnit.Case, async: true
  @moduletag :realtime
  doctest Hal.Camera.Source
  doctest Hal.Camera.Options
  doctest Hal.Camera.FFmpeg
  alias Hal.Camera.{FFmpeg, Source}

  @moduletag if(System.find_executable("ffmpeg"), do: [], else: [skip: "ffmpeg is missing"])

  defp open(options) do
    {:ok, camera} = FFmpeg.init(options)
    camera
  end

  # What comes for one credit: a frame or an error.
  defp take(camera) do
    {:ok, camera} = FFmpeg.next(camera)
    wait(camera)
  end

  defp wait(camera) do
    assert_receive message, 10_000

    case FFmpeg.handle_message(message, camera) do
      {:ok, [], camera} -> wait(camera)
      {:ok, [{:frame, frame}], _camera} -> frame
      {:error, reason, _camera} -> reason
    end
  end

  defp all(camera, taken \\ []) do
    case take(camera) do
      %Hal.Frame{} = frame -> all(camera, [frame | taken])
      reason -> {Enum.reverse(taken), reason}
    end
  end

  test "each frame of a source, in order, timed by its rate, then the end" do
    source = "lavfi:testsrc=size=32x24:rate=20:duration=1"
    {frames, :eof} = all(open(source: source, every: true))
    assert Enum.map(frames, & &1.at_ms) == Enum.to_list(0..950//50)
    assert [%{width: 32, height: 24, format: :yuyv} | _] = frames
  end

  test "both formats carry the same colours, in full range" do
    source = "lavfi:color=color=white:size=4x4:rate=1:duration=1"
    {[yuyv], :eof} = all(open(source: source, every: true))
    {[i420], :eof} = all(open(source: source, every: true, format: :i420))
    assert yuyv.bytes == :binary.copy(<<255, 128>>, 16)
    assert i420.bytes == :binary.copy(<<255>>, 16) <> :binary.copy(<<128>>, 8)
  end

  test "odd sizes lose their last column, a given size scales" do
    source = "lavfi:testsrc=size=33x25:rate=1:duration=1"
    assert {[%{width: 32, height: 25}], :eof} = all(open(source: source, every: true))

    assert {[%{width: 32, height: 24}], :eof} =
             all(open(source: source, every: true, format: :i420))

    assert {[%{width: 16, height: 12}], :eof} =
             all(open(source: source, every: true, size: {16, 12}))
  end

  test "nothing comes without credit, and then the newest" do
    camera = open(source: "lavfi:testsrc=size=32x24:rate=100")
    first = take(camera)
    refute_receive {_port, {:data, _}}, 400
    # Of a queue this would be the frame 10 ms later.
    assert take(camera).at_ms > first.at_ms + 100
    FFmpeg.terminate(camera)
  end

  test "ffmpeg ends with its camera" do
    camera = open(source: "testsrc")
    assert %Hal.Frame{} = take(camera)
    {:os_pid, program} = Port.info(camera.port, :os_pid)
    [ffmpeg] = children(program)
    FFmpeg.terminate(camera)
    assert gone?(program) and gone?(ffmpeg)
  end

  test "ffmpeg ends with a port program that is killed" do
    camera = open(source: "testsrc")
    assert %Hal.Frame{} = take(camera)
    {:os_pid, program} = Port.info(camera.port, :os_pid)
    [ffmpeg] = children(program)
    Process.flag(:trap_exit, true)
    {_, 0} = System.cmd("kill", ["-9", "#{program}"])
    # The second when our credit finds it gone before its end is told.
    assert take(camera) in [{:exit, 137}, {:exit, :epipe}]
    assert gone?(ffmpeg)
  end

  test "ffmpeg ends with its VM, even when that is killed" do
    code = """
    {:ok, camera} = Hal.Camera.FFmpeg.init(source: "testsrc")
    {:ok, _} = Hal.Camera.FFmpeg.next(camera)
    receive do {_port, {:data, _frame}} -> :ok end
    {:os_pid, program} = Port.info(camera.port, :os_pid)
    program
    """

    vm = Vm.start_one()
    :ok = Vm.start_apps(vm, [:elixir])
    # An agent keeps the camera.
    {:ok, agent} = Vm.call(vm, Agent, :start, [Code, :eval_string, [code]], 20_000)
    {program, _names} = Vm.call(vm, :sys, :get_state, [agent])
    [ffmpeg] = children(program)
    Vm.signal(vm, "KILL")
    assert gone?(program) and gone?(ffmpeg)
  end

  @tag :tmp_dir
  test "a looped picture goes on", %{tmp_dir: folder} do
    picture = Path.join(folder, "a: b%d.png")
    words = ~w(-loglevel error -f lavfi -i testsrc=size=32x24 -frames:v 1 -update 1)
    {_, 0} = System.cmd("ffmpeg", words ++ ["file:" <> picture])
    camera = open(source: picture, loop: true)
    for _ <- 1..3, do: assert(%Hal.Frame{width: 32} = take(camera))
    FFmpeg.terminate(camera)
    assert {[_one], :eof} = all(open(source: picture))
  end

  test "every wrong source is an error with its reason" do
    assert FFmpeg.init(source: "no/such/file.png") == {:error, :enoent}
    assert FFmpeg.init(source: "/dev/video77") == {:error, :enoent}
    assert {:unreadable, words} = take(open(source: "/dev/null", norm: :pal, input: 1))
    assert words =~ ~r/^[^\[].*: Inappropriate ioctl/
    assert FFmpeg.init(source: "lib") == {:error, :eisdir}
    assert {:unreadable, words} = take(open(source: "mix.exs"))
    assert words =~ ~r/^[^\[].*: Invalid data/
    assert {:unreadable, "Stream map" <> _} = take(open(source: "lavfi:anullsrc", unsafe: true))
    assert take(open(source: "testsrc", ffmpeg: "/no/such/ffmpeg")) == :no_ffmpeg
    assert take(open(source: "testsrc", ffmpeg: "/bin/echo")) |> elem(0) == :unreadable
  end

  # Two seconds of pictures of this size, as a broadcaster sends them.
  defp recording(folder, {width, height}) do
    file = Path.join(folder, "#{width}.ts")
    source = "testsrc=size=#{width}x#{height}:rate=10:duration=2"
    arguments = ~w(-v error -y -f lavfi -i #{source} -c:v mpeg2video -bf 0 -f mpegts) ++ [file]
    {"", 0} = System.cmd("ffmpeg", arguments, stderr_to_stdout: true)
    File.read!(file)
  end

  # Whoever connects first gets the first part, several times, and the second when this process is told to; whoever comes
  # later gets the second.
  defp broadcast(first, second) do
    {:ok, listener} = :gen_tcp.listen(0, [:binary, ip: {127, 0, 0, 1}, active: false])
    {:ok, port} = :inet.port(listener)

    sender =
      start_supervised!(
        {Task,
         fn ->
           {:ok, socket} = :gen_tcp.accept(listener)
           for _ <- 1..10, do: :gen_tcp.send(socket, first)
           receive do: (:go_on -> :ok)
           for _ <- 1..10, do: :gen_tcp.send(socket, second)
           {:ok, socket} = :gen_tcp.accept(listener)
           for _ <- 1..1_000, do: :gen_tcp.send(socket, second)
         end}
      )

    {sender, "tcp://127.0.0.1:#{port}"}
  end

  @tag :tmp_dir
  test "a stream that changes its size is followed, and told", %{tmp_dir: folder} do
    {sender, source} = broadcast(recording(folder, {320, 240}), recording(folder, {640, 360}))

    start_supervised!(
      {Hal.Device,
       kind: :camera, driver: {FFmpeg, source: source}, sinks: [{Kernel, :send, [self()]}]}
    )

    assert_receive {:frame, %{width: 320, height: 240}}, 20_000
    send(sender, :go_on)
    resized = {:resized, {320, 240}, {640, 360}}
    assert_receive {:health, :camera, {{:offline, ^resized}, _}}, 20_000

    assert Hal.Device.Explanation.offline({FFmpeg, source: source}, resized) ==
             "#{source}: its pictures were 320 x 240 and are 640 x 360 now; it is opened again"

    assert_receive {:frame, %{width: 640, height: 360}}, 20_000
    assert_receive {:health, :camera, {:online, _}}, 20_000
  end

  @tag :tmp_dir
  test "a file whose size changes is scaled, and told once; with a given size that is asked for",
       %{
         tmp_dir: folder
       } do
    file = Path.join(folder, "both.ts")
    File.write!(file, [recording(folder, {320, 240}), recording(folder, {640, 360})])

    {frames, told, :eof} = everything(open(source: file, every: true))
    assert frames |> Enum.map(&{&1.width, &1.height}) |> Enum.uniq() == [{320, 240}]
    assert length(frames) > 30
    assert ["its pictures are 640 x 360 now, and are scaled to the 320 x 240 of the first"] = told

    assert {_frames, [], :eof} = everything(open(source: file, every: true, size: {64, 48}))
  end

  # All frames, and what was odd.
  defp everything(camera, frames \\ [], told \\ []) do
    {:ok, camera} = FFmpeg.next(camera)
    everything_heard(camera, frames, told)
  end

  defp everything_heard(camera, frames, told) do
    assert_receive message, 10_000

    case FFmpeg.handle_message(message, camera) do
      {:ok, [], camera} -> everything_heard(camera, frames, told)
      {:ok, [odd: line], camera} -> everything_heard(camera, frames, [line | told])
      {:ok, [{:frame, frame}], camera} -> everything(camera, [frame | frames], told)
      {:error, reason, _camera} -> {Enum.reverse(frames), Enum.reverse(told), reason}
    end
  end

  test "every reason has words" do
    resized = {:resized, {320, 240}, {640, 360}}

    for reason <-
          [:enoent, :eacces, :eisdir, :no_ffmpeg, :eof, resized, {:unreadable, "x"}, {:exit, 1}] do
      assert FFmpeg.explain(reason) =~ ~r/^[^\n]+$/
    end
  end

  test "wrong options are named" do
    for option <- [size: {3, 2}, format: :rgb24, every: 1, rate: 0, source: ""] do
      assert_raise ArgumentError, ~r/#{elem(option, 0)}/, fn ->
        FFmpeg.init([{:source, "testsrc"}, option] |> Enum.uniq_by(&elem(&1, 0)) |> put(option))
      end
    end

    assert_raise ArgumentError, ~r/option source is missing/, fn -> FFmpeg.init([]) end
  end

  test "a V4L2 device is asked for size, rate, norm, input and pixel format, each if it is given" do
    device = fn options ->
      {:ok, options} = FFmpeg.options([source: "/dev/video0"] ++ options)
      line = Enum.join(Source.arguments("/dev/video0", options), " ")

      [_, asked] =
        Regex.run(~r/^-nostdin -hide_banner -loglevel level\+[a-z]+ (.*) -map 0:v:0 /, line)

      asked
    end

    assert device.([]) == "-f v4l2 -i /dev/video0"

    assert device.(size: {320, 240}, rate: 12.5, norm: :secam, input: 2, pixel_format: :mjpeg) ==
             "-f v4l2 -channel 2 -standard SECAM -input_format mjpeg -video_size 320x240 " <>
               "-framerate 12.5 -i /dev/video0"

    assert device.(norm: :ntsc, input: 0) == "-f v4l2 -channel 0 -standard NTSC -i /dev/video0"
    for format <- Source.pixel_formats(), do: assert(device.(pixel_format: format) =~ "_format ")
  end

  test "ffmpeg itself knows all that a device is asked for" do
    {help, 0} = System.cmd("ffmpeg", ~w(-hide_banner -h demuxer=v4l2))
    {formats, 0} = System.cmd("ffmpeg", ~w(-hide_banner -pix_fmts))
    {decoders, 0} = System.cmd("ffmpeg", ~w(-hide_banner -decoders))
    asked = Keyword.merge(all_of_a_device(), every: false, loop: false, format: :yuyv)

    for "-" <> _ = word <- Source.arguments("/dev/video0", asked) |> Enum.slice(4, 12),
        word not in ["-f", "-i"],
        do: assert(help =~ ~r/ #{word} /)

    for format <- Source.pixel_formats() do
      words = Source.arguments("/dev/video0", Keyword.put(asked, :pixel_format, format))
      name = Enum.at(words, Enum.find_index(words, &(&1 == "-input_format")) + 1)
      assert formats =~ ~r/^I.* #{name} /m or decoders =~ ~r/^ V.* #{name} /m
    end
  end

  defp all_of_a_device,
    do: [size: {320, 240}, rate: 10, norm: :pal, input: 1, pixel_format: :yuyv]

  test "what only a device understands is refused for another source, in a line each" do
    for source <- ["testsrc", "film.mp4", "rtsp://cam/1"],
        {name, _} = option <- Keyword.delete(all_of_a_device(), :size) do
      assert {:error, line} = FFmpeg.options([option, source: source])
      assert line =~ "option #{name} is for a V4L2 device" and line =~ inspect(source)
    end

    assert {:ok, _} = FFmpeg.options([source: "/dev/video0"] ++ all_of_a_device())
  end

  test "what no device can be asked for is refused, with what is allowed" do
    for {name, values} <- [
          norm: ["PAL", :palm, 1],
          input: [-1, 32, 1.0, "1", 1.0e300],
          pixel_format: [:yuv, "yuyv", 7],
          rate: [0, -1, 0.01, 1.0e300, "10", :fast],
          size: [{3, 2}, {0, 0}, {1.0e300, 2}, {320}, "320x240", {32_770, 2}]
        ],
        value <- values do
      assert {:error, line} = FFmpeg.options([{name, value}, source: "/dev/video0"])
      assert line =~ ~r/^camera option #{name}: expected [^\n]+, got [^\n]+/
    end

    assert {:error, line} = FFmpeg.options(source: "/dev/video0", pixel_formt: :yuyv)
    assert line =~ "did you mean pixel_format?"
  end

  @tag :tmp_dir
  test "a device that its user may not open says so", %{tmp_dir: folder} do
    closed = Path.join(folder, "closed")
    File.write!(closed, "")
    File.chmod!(closed, 0o000)
    # Root opens whatever there is.
    expected = if File.stat!(closed).access == :none, do: {:error, :eacces}, else: :ok
    assert Source.check(closed) == expected
  end

  defp put(options, {key, value}), do: Keyword.put(options, key, value)

  defp children(pid) do
    "/proc/#{pid}/task/#{pid}/children" |> File.read!() |> String.split()
  end

  # Waits until the process is no more, or only its entry in the table.
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

  test "of ffmpeg's generators those pass that cannot touch a file, and nothing beside them" do
    for good <- [
          "testsrc",
          "lavfi:testsrc",
          "lavfi:testsrc2=size=64x48:rate=30000/1001",
          "a,b.png"
        ],
        do: assert(Source.refused(good) == nil, good)

    for bad <- [
          "lavfi:",
          "lavfi:movie=/etc/passwd",
          "lavfi:life=filename=a",
          "lavfi:testsrc,metadata=print:file=a",
          "lavfi:testsrc;color",
          "lavfi:testsrc[a]",
          "lavfi:testsrc=size='4x4'",
          "lavfi:testsrc=size=4\\\\x4",
          "lavfi:testsrc\n,metadata=print:file=a",
          "lavfi:testsrc\n",
          "FILE:///etc/passwd",
          "concat://a",
          "ftp://a/b.png"
        ],
        do: assert(is_binary(Source.refused(bad)), bad)
  end
end
