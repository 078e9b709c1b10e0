defmodule Hal.Camera.FFmpeg do
  alias Hal.Camera.{Options, Source}
  alias Hal.Frame

  @moduledoc """
  A camera from any source that ffmpeg reads: a V4L2 device, a stream, a video file, a picture, a
  test picture (`Hal.Camera.Source`).

  Options:

    * `:source` - what to read
    * `:format` - `:yuyv` (default) or `:i420`; always full range, BT.601
    * `:size` - `{width, height}`, even; by default the source's own, less an odd last column
      (and for `:i420` an odd last row)
    * `:every` - `false`: the newest frame wins, files run in real time. `true`: each frame in
      turn, as fast as it is asked for, and timed by its place in the file
    * `:loop` - `true`: start a file again at its end

  and of a V4L2 device only:

    * `:rate` - frames a second to ask of it, 0.1 to 1000
    * `:norm` - of an analog camera: `:pal`, `:ntsc` or `:secam`
    * `:input` - the number of the socket of a frame grabber that the camera is plugged into, from 0
    * `:pixel_format` - what the device is to send, where it can send several:
      #{Enum.map_join(Source.pixel_formats(), ", ", &"`#{inspect(&1)}`")}. The compressed ones take
      less of a USB line, and time to unpack

  What of these is left out is as the device was left by whoever used it last.

  ffmpeg runs behind the port program `newest_frame`, which keeps one frame and gives it out when
  `next/1` asks; nothing queues, and ffmpeg ends with this process or its VM, however they end.

  The process that calls `init/1` gets the messages and is linked to the port program. To see the
  end of a killed one as an error, it traps exits, as `Hal.Device` does.

  Errors: `:no_ffmpeg`, `:enoent` (no such file or device), `:eacces`, `:eisdir`, `:eof` (the source ended
  after at least one frame), `{:unreadable, what ffmpeg says}`, `{:exit, status}`.
  """
  @behaviour Hal.Camera

  @enforce_keys [:port, :format, :every]
  defstruct @enforce_keys

  @opaque t :: %__MODULE__{port: port(), format: Frame.format(), every: boolean()}

  @doc """
  The options with their defaults, or one line that says what is wrong.

      iex> Hal.Camera.FFmpeg.options(source: "testsrc", loop: 1)
      {:error, "camera option loop cannot be 1: true or false is allowed"}
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
      {:ok, %__MODULE__{port: port, format: options[:format], every: options[:every]}}
    end
  end

  @impl Hal.Camera
  def next(%__MODULE__{port: port} = state) do
    # The program may have ended by itself; its last message is then under way to us.
    send(port, {self(), {:command, "n"}})
    {:ok, state}
  end

  @impl Hal.Camera
  def handle_message({port, {:data, <<?F, picture::binary>>}}, %__MODULE__{port: port} = state),
    do: {:ok, [{:frame, frame(picture, state)}], state}

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
  An error in a person's words, for one line.

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
  def explain({:exit, reason}), do: "the reader ended (#{inspect(reason)})"
  def explain(other), do: inspect(other, limit: 5, printable_limit: 40)

  @doc "The same with the name of its source."
  @impl Hal.Camera
  def explain(reason, options), do: "#{options[:source]}: #{explain(reason)}"

  defp frame(picture, state) do
    <<_chroma, width::32, height::32, rate::32, per::32, number::64, age_us::64, bytes::binary>> =
      picture

    at_ms =
      if state.every and rate > 0,
        do: div(number * per * 1000 + div(rate, 2), rate),
        else: System.monotonic_time(:millisecond) - div(age_us, 1000)

    {:ok, frame} = Frame.new(state.format, width, height, bytes, at_ms)
    frame
  end

  defp end_reason(0, count, _words) when count > 0, do: :eof
  defp end_reason(127, 0, ""), do: :no_ffmpeg

  # The port program could not make sense of the stream: see y4m.c for its limits.
  defp end_reason(255, _count, ""),
    do: {:unreadable, "no frames, or above 64 million pixels or 32768 a side"}

  defp end_reason(status, _count, words) do
    case words |> printable() |> String.split("\n", trim: true) |> Enum.reject(&hint?/1) do
      [] -> {:unreadable, "status #{status}, no frame"}
      lines -> {:unreadable, lines |> reason() |> String.trim()}
    end
  end

  defp hint?(line), do: String.starts_with?(line, "To ignore this")

  # The last line is the reason, but ffmpeg 7 goes on to say of which file and option it was.
  @echoes [
    "Error opening input file",
    "Error opening output file",
    "Error parsing options for",
    "Failed to set value"
  ]

  defp reason(lines) do
    reason = lines |> Enum.reverse() |> Enum.find(&(not String.starts_with?(&1, @echoes)))
    # Which part of ffmpeg says it, at which address, as in "[in#0 @ 0x5575da885000] ".
    Regex.replace(~r/^\[[^\]]* @ 0x[^\]]*\] /, reason || List.last(lines), "")
  end

  # Names of files come in any encoding.
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
