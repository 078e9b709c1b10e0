defmodule Hal.Camera.Source do
  @moduledoc """
  Lists the sources that a camera can read, and ffmpeg's arguments for them. Pure, except that `check/1` looks at the
  file system.

  | source | is |
  |---|---|
  | `"/dev/video0"` | a V4L2 camera |
  | `"rtsp://…"`, any `scheme://` | a stream |
  | `"testsrc"` | ffmpeg's test picture, 320 by 240, 10 frames per second |
  | `"lavfi:GRAPH"` | any other generator of ffmpeg |
  | anything else | a video file or a picture |

  A filter graph can read and write files with the rights of its user, and so can some of
  ffmpeg's protocols. A source may come from somebody else, so `refused/1` lets pass what can only
  be read: known schemes, and single generators that have no option for a file.
  """

  @type kind :: :device | :stream | :generator | :file

  @pictures ~w(.png .jpg .jpeg .bmp .ppm .pgm .tif .tiff .webp)

  # Our names, as in `Hal.Frame`, and ffmpeg's, for the formats that cameras send.
  @pixel_formats [
    yuyv: "yuyv422",
    uyvy: "uyvy422",
    i420: "yuv420p",
    nv12: "nv12",
    rgb24: "rgb24",
    bgr24: "bgr24",
    grey: "gray",
    mjpeg: "mjpeg",
    h264: "h264"
  ]
  @norms [pal: "PAL", ntsc: "NTSC", secam: "SECAM"]

  @schemes ~w(rtsp rtsps rtmp rtmps rtp srt udp tcp http https)
  @generators ~w(allrgb allyuv color colorspectrum gradients mandelbrot pal75bars pal100bars rgbtestsrc
    smptebars smptehdbars testsrc testsrc2 yuvtestsrc)
  # One generator with its numbers and words: no other filter, no label, no quote, no escape.
  @generator ~r/\A([a-z0-9]+)(?:=[A-Za-z0-9_.:=\/#@+-]*)?\z/

  @doc "The formats that can be requested from a V4L2 device."
  @spec pixel_formats() :: [atom(), ...]
  def pixel_formats, do: Keyword.keys(@pixel_formats)

  @doc "The norms of analog cameras."
  @spec norms() :: [atom(), ...]
  def norms, do: Keyword.keys(@norms)

  @doc """
  The kind of a source.

      iex> Enum.map(["/dev/video0", "rtsp://cam/1", "testsrc", "a/b.png"], &Hal.Camera.Source.kind/1)
      [:device, :stream, :generator, :file]
  """
  @spec kind(String.t()) :: kind()
  def kind("/dev/" <> _device), do: :device
  def kind("testsrc"), do: :generator
  def kind("lavfi:" <> _graph), do: :generator

  def kind(source), do: if(source =~ ~r/^[A-Za-z][A-Za-z0-9+.-]*:\/\//, do: :stream, else: :file)

  @doc """
  Why a source is not opened unless its user says that it is safe; `nil` for the others.

      iex> Hal.Camera.Source.refused("lavfi:color=color=white:size=64x48")
      nil
      iex> Hal.Camera.Source.refused("rtsp://camera/1")
      nil
      iex> Hal.Camera.Source.refused("lavfi:testsrc,metadata=print:file=out.txt")
      "expected one generator such as testsrc2=size=64x48, because a filter graph can write files"
      iex> Hal.Camera.Source.refused("gopher://camera/1")
      "expected a stream by rtsp, rtsps, rtmp, rtmps, rtp, srt, udp, tcp, http, https"
  """
  @spec refused(String.t()) :: nil | (why :: String.t())
  def refused("lavfi:" <> graph) do
    case Regex.run(@generator, graph, capture: :all_but_first) do
      [name] when name in @generators ->
        nil

      _other ->
        "expected one generator such as testsrc2=size=64x48, because a filter graph can write files"
    end
  end

  def refused(source) do
    with :stream <- kind(source),
         [scheme, _rest] = String.split(source, ":", parts: 2),
         false <- String.downcase(scheme) in @schemes do
      "expected a stream by #{Enum.join(@schemes, ", ")}"
    else
      _known -> nil
    end
  end

  @doc """
  Whether the source can be opened, as far as its file status shows. Streams and generators are
  not checked.

      iex> Hal.Camera.Source.check("no/such.png")
      {:error, :enoent}
      iex> Hal.Camera.Source.check("testsrc")
      :ok
  """
  @spec check(String.t()) :: :ok | {:error, :enoent | :eacces | :eisdir}
  def check(source),
    do: if(kind(source) in [:stream, :generator], do: :ok, else: readable(File.stat(source)))

  defp readable({:ok, %File.Stat{type: :directory}}), do: {:error, :eisdir}
  defp readable({:ok, %File.Stat{access: access}}) when access in [:read, :read_write], do: :ok
  defp readable({:ok, _closed}), do: {:error, :eacces}
  defp readable({:error, :eacces}), do: {:error, :eacces}
  defp readable({:error, _reason}), do: {:error, :enoent}

  @doc """
  ffmpeg's arguments to write that source to its output as a yuv4mpeg stream; options as in
  `Hal.Camera.FFmpeg`.

      iex> "/dev/video0"
      ...> |> Hal.Camera.Source.arguments(format: :yuyv, norm: :pal, input: 1)
      ...> |> Enum.slice(4, 8)
      ["-f", "v4l2", "-channel", "1", "-standard", "PAL", "-i", "/dev/video0"]
  """
  @spec arguments(String.t(), keyword()) :: [String.t()]
  def arguments(source, options) do
    ["-nostdin", "-hide_banner", "-loglevel", level(options)] ++
      pace(kind(source), options) ++
      input(kind(source), source, options) ++
      ~w(-map 0:v:0 -vf) ++
      [filters(options)] ++ ~w(-nostats -fps_mode passthrough -f yuv4mpegpipe pipe:1)
  end

  # The port program reads the level of each line, and the sizes that showinfo tells.
  defp level(options), do: if(options[:size], do: "level+error", else: "level+info")

  # A file takes the place of a camera, so it runs in real time unless every frame is wanted.
  defp pace(kind, options) when kind in [:file, :generator],
    do: if(options[:every], do: [], else: ["-re"]) ++ if(options[:loop], do: loop(kind), else: [])

  defp pace(:stream, options),
    do: if(options[:every], do: [], else: ~w(-fflags nobuffer -flags low_delay))

  defp pace(:device, _options), do: []

  defp loop(:file), do: ~w(-stream_loop -1)
  defp loop(:generator), do: []

  defp input(:device, source, options) do
    asked =
      for {option, word} <- [
            input: "-channel",
            norm: "-standard",
            pixel_format: "-input_format",
            size: "-video_size",
            rate: "-framerate"
          ],
          value = options[option],
          text <- [word, asked(option, value)],
          do: text

    ~w(-f v4l2) ++ asked ++ ["-i", source]
  end

  defp input(:generator, "testsrc", _options),
    do: ~w(-f lavfi -i testsrc=size=320x240:rate=10)

  defp input(:generator, "lavfi:" <> graph, _options), do: ["-f", "lavfi", "-i", graph]
  defp input(:stream, source, _options), do: ["-i", source]
  # Without `file:`, ffmpeg would read a colon in a file name as the end of a protocol's name.
  defp input(:file, source, _options), do: literal(source) ++ ["-i", "file:" <> source]

  defp asked(:size, {width, height}), do: "#{width}x#{height}"
  defp asked(:norm, norm), do: @norms[norm]
  defp asked(:pixel_format, format), do: @pixel_formats[format]
  defp asked(option, number) when option in [:rate, :input], do: to_string(number)

  # ffmpeg would take a per cent sign in a picture's name for a pattern of numbered pictures.
  defp literal(source) do
    if String.contains?(source, "%") and String.downcase(Path.extname(source)) in @pictures,
      do: ~w(-f image2 -pattern_type none),
      else: []
  end

  # Colour files are made for full range and BT.601; ffmpeg would give 16 to 235.
  defp filters(options) do
    size =
      case options[:size] do
        {width, height} -> "scale=#{width}:#{height}"
        nil -> "showinfo=checksum=0," <> crop(options[:format])
      end

    "#{size},scale=out_color_matrix=bt601:out_range=full,format=#{pixel_format(options[:format])}"
  end

  # Pairs of pixels share chroma, so an odd last column (with i420, an odd last row too) is
  # dropped.
  defp crop(:yuyv), do: "crop=trunc(iw/2)*2:ih:0:0"
  defp crop(:i420), do: "crop=trunc(iw/2)*2:trunc(ih/2)*2:0:0"

  defp pixel_format(:yuyv), do: "yuv422p"
  defp pixel_format(:i420), do: "yuv420p"
end
