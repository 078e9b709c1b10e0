defmodule Nav.MapFile.Ffmpeg do
  @moduledoc false
  # Reads PNG and BMP pictures by the program ffmpeg. Colours become greys, what is transparent white, or of another shade if it
  # means something else: then what is less than half opaque has that, and the rest its own.
  alias Nav.MapFile.Picture

  @damaged {:error, "the picture is damaged"}

  @doc "The kind and size of a picture by its head: `nil` for one of another kind, `error` for one that is cut short."
  @spec head(binary()) :: {:png | :bmp, {integer(), integer()}} | :error | nil
  def head(<<0x89, "PNG\r\n", 0x1A, "\n", _size::32, "IHDR", w::32, h::32, _::binary>>),
    do: {:png, {w, h}}

  # ffmpeg takes what is missing of a BMP picture for black.
  def head(
        <<"BM", size::little-32, _::binary-12, w::little-signed-32, h::little-signed-32,
          _::binary>> = bytes
      ),
      do: if(byte_size(bytes) < size, do: :error, else: {:bmp, {w, abs(h)}})

  def head(<<0x89, "PNG", _::binary>>), do: :error
  def head(<<"BM", _::binary>>), do: :error
  def head(_other), do: nil

  @doc "The picture in a file of this kind and size; `transparent` is the shade of what is transparent in it."
  @spec decode(Path.t(), :png | :bmp, {pos_integer(), pos_integer()}, transparent :: byte()) ::
          {:ok, Picture.t()} | {:error, String.t()}
  def decode(file, kind, {width, height}, transparent) do
    stride = 4 * width

    case run(file, kind) do
      {:ok, pixels} when byte_size(pixels) == stride * height ->
        rows =
          for <<row::binary-size(stride) <- pixels>>,
            do: for(<<r, g, b, a <- row>>, into: <<>>, do: <<grey(r, g, b, a, transparent)>>)

        {:ok, {width, height, rows}}

      {:ok, _of_another_size} ->
        @damaged

      error ->
        error
    end
  end

  # A file's name may begin like an option or a protocol.
  defp run(file, kind) do
    arguments =
      ~w(-nostdin -v quiet -timelimit 60 -max_alloc 1000000000 -xerror -err_detect crccheck+explode -f #{kind}_pipe -i) ++
        ["file:" <> file] ++ ~w(-frames:v 1 -f rawvideo -pix_fmt rgba -)

    case System.find_executable("ffmpeg") do
      nil ->
        {:error, "the program ffmpeg, which reads PNG and BMP, is not installed; PGM needs none"}

      ffmpeg ->
        case System.cmd(ffmpeg, arguments) do
          {pixels, 0} -> {:ok, pixels}
          {_nothing, _status} -> @damaged
        end
    end
  end

  defp grey(_r, _g, _b, alpha, shade) when alpha < 128 and shade != 255, do: shade
  defp grey(r, g, b, _alpha, shade) when shade != 255, do: grey(r, g, b, 255)
  defp grey(r, g, b, alpha, _on_white), do: grey(r, g, b, alpha)

  # On a white background.
  defp grey(r, g, b, alpha),
    do: div(255 * 255_000 - alpha * (255_000 - (299 * r + 587 * g + 114 * b)), 255_000)
end
