defmodule Hal.Camera.FFmpeg do
  alias Hal.Camera.{Options, Source}
  alias Hal.Frame

  @moduledoc """
  Reads any source that ffmpeg can read: a V4L2 device, a stream, a video file, a
  picture, a test picture (`Hal.Camera.Source`).

  Options:

    * `:source` - what to read
    * `:format` - `:yuyv` (default) or `:i420`; always full range, BT.601
    * `:size` - `{width, height}`, even; by default the size of the source, without an odd last
      column (and, for `:i420`, an odd last row)
    * `:every` - `false` (default): the newest frame wins, and files run in real time. `true`:
      every frame in turn, as fast as frames are requested, with its time taken from its place in
      the file
    * `:loop` - `true`: starts a file again at its end
    * `:unsafe` - `true`: open also what `Hal.Camera.Source.refused/1` refuses: filter graphs, which can
      write files, and unknown schemes

  and, for a V4L2 device only:

    * `:rate` - frames per second to request, 0.1 to 1000
    * `:norm` - for an analog camera: `:pal`, `:ntsc` or `:secam`
    * `:input` - the number of the frame grabber's socket that the camera is plugged into, from 0
    * `:pixel_format` - the format to request from a device that can send several:
      #{Enum.map_join(Source.pixel_formats(), ", ", &"`#{inspect(&1)}`")}. The compressed ones
      need less USB bandwidth, but time to decompress

  A V4L2 option that is left out keeps the setting of the device's last user.

  ffmpeg runs behind the port program `newest_frame`, which keeps one frame and sends it when
  `next/1` asks, so nothing queues. ffmpeg ends with this process or its VM, however they end.

  The process that calls `init/1` receives the messages and is linked to the port program. It must
  trap exits, as `Hal.Device` does, to see the killing of the port program as an error.

  ffmpeg scales all pictures to the size of the first, if no `:size` is given. So a stream whose size
  changes is an error, `{:resized, old, new}`, after which the device opens it again in its new size;
  of a file it is told, once, that its later pictures are scaled.

  Errors: `:no_ffmpeg`, `:enoent` (no such file or device), `:eacces`, `:eisdir`, `:eof` (the
  source ended after at least one frame), `{:unreadable, what ffmpeg says}`, `{:exit, status}`.
  """
  @behaviour Hal.Camera

  @enforce_keys [:port, :format, :every, :kind]
  defstruct @enforce_keys

  @opaque t :: %__MODULE__{
            port: port(),
            format: Frame.format(),
            every: boolean(),
            kind: Source.kind()
          }

  @doc """
  Checks the options and adds the defaults; the error is one line that says what is wrong.

      iex> Hal.Camera.FFmpeg.options(source: "testsrc", loop: 1)
      {:error, "camera option loop: expected true or false, got 1"}
  """
  @spec options(keyword()) :: {:ok, keyword()} | {:error, line :: String.t()}
  defdelegate options(options), to: Options, as: :check

  @impl Hal.Camera
  defdelegate option_table, to: Options, as: :table

  @impl Hal.Camera
  def init(options) do
    options = check!(options)

    with :ok <- Source.check(options[:source]),
         {:ok, ffmpeg} <- find_ffmpeg(options) do
      arguments = [
        if(options[:every], do: "every", else: "newest"),
        ffmpeg | Source.arguments(options[:source], options)
      ]

      program = Application.app_dir(:hal, "priv/newest_frame")
      settings = [:binary, :exit_status, packet: 4, args: arguments]
      port = Port.open({:spawn_executable, program}, settings)
      kind = Source.kind(options[:source])
      {:ok, %__MODULE__{port: port, format: options[:format], every: options[:every], kind: kind}}
    end
  end

  @impl Hal.Camera
  def next(%__MODULE__{port: port} = state) do
    # Unlike `Port.command/2`, this does not raise if the program has ended by itself; the
    # program's last message is then still on its way.
    send(port, {self(), {:command, "n"}})
    {:ok, state}
  end

  @impl Hal.Camera
  def handle_message({port, {:data, <<?F, picture::binary>>}}, %__MODULE__{port: port} = state),
    do: {:ok, [{:frame, frame(picture, state)}], state}

  def handle_message(
        {port, {:data, <<?S, w::32, h::32, width::32, height::32>>}},
        %__MODULE__{port: port} = state
      ),
      do: resized({w, h}, {width, height}, state)

  def handle_message(
        {port, {:data, <<?E, status, count::64, words::binary>>}},
        %{port: port} = state
      ),
      do: {:error, end_reason(status, count, words), state}

  def handle_message({port, {:exit_status, status}}, %__MODULE__{port: port} = state),
    do: {:error, {:exit, status}, state}

  def handle_message({:EXIT, port, reason}, %__MODULE__{port: port} = state),
    do: {:error, {:exit, reason}, state}

  def handle_message(_other, state), do: {:ok, [], state}

  @impl Hal.Camera
  def terminate(%__MODULE__{port: port}) do
    send(port, {self(), :close})
    :ok
  end

  @doc """
  Describes an error in a few words, for one line.

      iex> Hal.Camera.FFmpeg.explain(:enoent)
      "no such file or device"
  """
  @spec explain(reason :: term()) :: String.t()
  def explain(:enoent), do: "no such file or device"
  def explain(:eacces), do: "permission denied (a camera wants its user in the group video)"
  def explain(:eisdir), do: "is a folder"
  def explain(:no_ffmpeg), do: "the program ffmpeg is missing (on Debian: apt install ffmpeg)"
  def explain(:eof), do: "ended"
  def explain(:mute), do: "is open, and gives no picture"
  def explain({:unreadable, words}), do: "not a readable picture, video or stream (#{words})"

  def explain({:resized, old, new}),
    do: "its pictures were #{pixels(old)} and are #{pixels(new)} now; it is opened again"

  def explain({:exit, reason}), do: "the reader ended (#{inspect(reason)})"
  def explain(other), do: inspect(other, limit: 5, printable_limit: 40)

  @doc "The same, with the name of the source in front."
  @impl Hal.Camera
  def explain(reason, options), do: "#{options[:source]}: #{explain(reason)}"

  defp resized(old, new, %{kind: kind} = state) when kind in [:stream, :device],
    do: {:error, {:resized, old, new}, state}

  # It would begin from its beginning.
  defp resized(old, new, state) do
    line =
      "its pictures are #{pixels(new)} now, and are scaled to the #{pixels(old)} of the first"

    {:ok, [{:odd, line}], state}
  end

  defp pixels({width, height}), do: "#{width} x #{height}"

  defp frame(picture, state) do
    <<_chroma, width::32, height::32, rate::32, per::32, number::64, age_us::64, bytes::binary>> =
      picture

    at_ms =
      if state.every and rate > 0,
        do: div(number * per * 1000 + div(rate, 2), rate),
        else: Hal.Clock.now_ms() - div(age_us, 1000)

    {:ok, frame} = Frame.new(state.format, width, height, bytes, at_ms)
    frame
  end

  defp end_reason(0, count, _words) when count > 0, do: :eof
  defp end_reason(127, 0, ""), do: :no_ffmpeg

  # The port program could not parse the stream; y4m.c has its limits.
  defp end_reason(255, _count, ""),
    do: {:unreadable, "no frames, or above 64 million pixels or 32768 a side"}

  defp end_reason(status, _count, words) do
    case words |> printable() |> String.split("\n", trim: true) |> Enum.reject(&hint?/1) do
      [] -> {:unreadable, "status #{status}, no frame"}
      lines -> {:unreadable, lines |> reason() |> String.trim()}
    end
  end

  defp hint?(line), do: String.starts_with?(line, "To ignore this")

  # The last line is the reason, except that ffmpeg 7 then adds which file and option it concerns.
  @echoes [
    "Error opening input file",
    "Error opening output file",
    "Error parsing options for",
    "Failed to set value"
  ]

  defp reason(lines) do
    reason = lines |> Enum.reverse() |> Enum.find(&(not String.starts_with?(&1, @echoes)))
    # Strips which part of ffmpeg reports it, such as "[in#0 @ 0x5575da885000] ".
    Regex.replace(~r/^\[[^\]]* @ 0x[^\]]*\] /, reason || List.last(lines), "")
  end

  # File names may be in any encoding.
  defp printable(words),
    do: for(<<byte <- words>>, byte in 32..126 or byte == ?\n, into: "", do: <<byte>>)

  defp find_ffmpeg(options) do
    case options[:ffmpeg] || System.find_executable("ffmpeg") do
      nil -> {:error, :no_ffmpeg}
      path -> {:ok, path}
    end
  end

  defp check!(options) do
    case options(options) do
      {:ok, options} -> options
      {:error, line} -> raise ArgumentError, line
    end
  end
end
