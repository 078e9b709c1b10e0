defmodule Vision.Picture do
  @moduledoc """
  Draws blobs into their frame, for people: a box in the display colour of the class with a dark
  edge, a cross at the centroid, and a label. ffmpeg writes the picture.
  """
  alias Hal.Frame
  alias Vision.{Blob, Colours, Pixels, Rgb}

  @black {0, 0, 0}
  @white {255, 255, 255}

  @doc """
  The frame as RGB bytes with the blobs drawn in. Options: `classified: true` shows the pixels
  that have one of the colours in its display colour, and makes all others dark and grey; `boxes`
  draws white boxes `{left, top, right, bottom}`.
  """
  @spec draw(Frame.t(), [Blob.t()], Colours.t(), keyword()) :: binary()
  def draw(
        %Frame{width: width} = frame,
        blobs,
        %Colours{classes: classes} = colours,
        options \\ []
      ) do
    options = Keyword.validate!(options, classified: false, boxes: [])

    boxes =
      for {left, top, right, bottom} <- options[:boxes], do: box(left, top, right, bottom, @white)

    paint = if options[:classified], do: &classified(&1, colours), else: &Rgb.from_yuv/1
    shown = Map.new(classes, &{&1.name, &1.rgb})
    # In reverse, so that the label of a larger blob stays readable.
    ink =
      (List.flatten(boxes) ++
         (blobs |> Enum.reverse() |> Enum.flat_map(&strokes(&1, shown[&1.colour], width))))
      |> Map.new()

    for {yuv, index} <- Enum.with_index(Pixels.yuv(frame)), into: <<>> do
      place = {rem(index, width), div(index, width)}
      {r, g, b} = Map.get_lazy(ink, place, fn -> paint.(yuv) end)
      <<r, g, b>>
    end
  end

  # The lowest bit of a mask is the first class; its `rgb` is for display.
  defp classified({y, _u, _v} = yuv, %Colours{classes: classes} = colours) do
    mask = Colours.mask(colours, yuv)

    class =
      Enum.find(Enum.with_index(classes), fn {_class, k} -> Bitwise.band(mask, 2 ** k) != 0 end)

    case class do
      nil -> Rgb.from_yuv({div(y, 3), 128, 128})
      {%{rgb: rgb}, _k} -> rgb
    end
  end

  @doc """
  Writes the picture as PNG or JPEG, by the ending of `path`; options as in `draw/4`. The error is
  one line.
  """
  @spec write(Path.t(), Frame.t(), [Blob.t()], Colours.t(), keyword()) ::
          :ok | {:error, String.t()}
  def write(path, %Frame{} = frame, blobs, %Colours{} = colours, options \\ []) do
    raw =
      Path.join(
        System.tmp_dir!(),
        "blobs-#{System.pid()}-#{System.unique_integer([:positive])}.rgb"
      )

    try do
      File.write!(raw, draw(frame, blobs, colours, options))
      encode(raw, path, frame)
    after
      File.rm(raw)
    end
  end

  defp encode(raw, path, frame) do
    arguments =
      ~w(-nostdin -hide_banner -loglevel error -y -f rawvideo -pix_fmt rgb24 -video_size) ++
        ["#{frame.width}x#{frame.height}", "-i", raw, "-frames:v", "1"] ++
        ~w(-update 1 -q:v 2) ++ ["file:" <> path]

    case System.cmd("ffmpeg", arguments, stderr_to_stdout: true) do
      {_words, 0} ->
        :ok

      {words, _status} ->
        {:error, "#{path}: #{words |> String.split("\n", trim: true) |> List.last()}"}
    end
  end

  defp strokes(%Blob{} = blob, rgb, width) do
    scale = if width >= 300, do: 2, else: 1

    text =
      if blob.distance, do: "#{blob.colour} #{Float.round(blob.distance, 2)}m", else: blob.colour

    top = max(blob.top - 7 * scale, 0)

    box(blob.left - 1, blob.top - 1, blob.right + 1, blob.bottom + 1, @black) ++
      box(blob.left, blob.top, blob.right, blob.bottom, rgb) ++
      cross(round(blob.x), round(blob.y)) ++
      letters(text, {blob.left, top}, scale, @white, @black)
  end

  defp box(left, top, right, bottom, rgb) do
    for(x <- left..right, y <- [top, bottom], do: {{x, y}, rgb}) ++
      for y <- top..bottom, x <- [left, right], do: {{x, y}, rgb}
  end

  defp cross(x, y), do: for(d <- -3..3, place <- [{x + d, y}, {x, y + d}], do: {place, @white})

  # Letters of 3 by 5 dots. Each digit is a row; its bits are the dots from left to right.

  @dots Map.new(
          ~w(A25755 B65656 C34443 D65556 E74647 F74644 G34553 H55755 I72227 J11152 K55655 L44447
             M57755 N65555 O25552 P65644 Q25563 R65655 S34216 T72222 U55557 V55522 W55775 X55255
             Y55222 Z71247 075557 126227 271747 371717 455711 574717 674757 771111 875757 975717
             .00002 -00700 _00007 :02020 =07070 %51245),
          fn <<letter, rows::binary>> -> {letter, for(<<row <- rows>>, do: row - ?0)} end
        )
  # For characters that are not in it.
  @unknown [7, 5, 5, 5, 7]

  # The dots of a text on a dark ground, as `{place, colour}`; the ground comes first.
  defp letters(text, {left, top}, scale, ink, ground) do
    of_text = text |> String.upcase() |> String.to_charlist()
    across = scale * (4 * length(of_text) + 1)

    under = for x <- 0..(across - 1), y <- 0..(7 * scale - 1), do: {{left + x, top + y}, ground}

    dots =
      for {letter, column} <- Enum.with_index(of_text),
          {row, y} <- Enum.with_index(rows(letter)),
          {bit, x} <- [{4, 0}, {2, 1}, {1, 2}],
          Bitwise.band(row, bit) != 0,
          dx <- 1..scale,
          dy <- 1..scale do
        {{left + scale * (4 * column + x + 1) + dx - 1, top + scale * (y + 1) + dy - 1}, ink}
      end

    under ++ dots
  end

  defp rows(?\s), do: [0, 0, 0, 0, 0]
  defp rows(letter), do: Map.get(@dots, letter, @unknown)
end
