defmodule Hal.Camera.FFmpegTest do
  use ExUnit.Case, async: true
  doctest Hal.Camera.Source
  doctest Hal.Camera.FFmpeg
  alias Hal.Camera.FFmpeg

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
    IO.puts("\#{System.pid()} \#{program}")
    receive do :never -> :ok end
    """

    arguments = ["-pa", Application.app_dir(:hal, "ebin"), "-e", code]
    elixir = System.find_executable("elixir")
    vm = Port.open({:spawn_executable, elixir}, [:binary, line: 100, args: arguments])
    assert_receive {^vm, {:data, {:eol, line}}}, 20_000
    [node, program] = String.split(line)
    [ffmpeg] = children(program)
    {_, 0} = System.cmd("kill", ["-9", node])
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
    assert FFmpeg.init(source: "lib") == {:error, :eisdir}
    assert {:unreadable, words} = take(open(source: "mix.exs"))
    assert words =~ "Invalid data"
    assert {:unreadable, "Stream map" <> _} = take(open(source: "lavfi:anullsrc"))
    assert take(open(source: "testsrc", ffmpeg: "/no/such/ffmpeg")) == :no_ffmpeg
    assert take(open(source: "testsrc", ffmpeg: "/bin/echo")) |> elem(0) == :unreadable
  end

  test "every reason has words" do
    for reason <- [:enoent, :eisdir, :no_ffmpeg, :eof, {:unreadable, "x"}, {:exit, 1}] do
      assert FFmpeg.explain(reason) =~ ~r/^[^\n]+$/
    end
  end

  test "wrong options are named" do
    for option <- [size: {3, 2}, format: :rgb24, every: 1, rate: 0, source: ""] do
      assert_raise ArgumentError, ~r/#{elem(option, 0)}/, fn ->
        FFmpeg.init([{:source, "testsrc"}, option] |> Enum.uniq_by(&elem(&1, 0)) |> put(option))
      end
    end

    assert_raise ArgumentError, ~r/:source is missing/, fn -> FFmpeg.init([]) end
  end

  defp put(options, {key, value}), do: Keyword.put(options, key, value)

  defp children(pid) do
    "/proc/#{pid}/task/#{pid}/children" |> File.read!() |> String.split()
  end

  # Waits until the process is no more, or only its entry in the table.
  defp gone?(pid, left_ms \\ 5_000)
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
