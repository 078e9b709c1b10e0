defmodule Nav.MapFile.Bmp do
  @moduledoc false
  # Reads BMP pictures without compression: 1, 4 or 8 bits with a palette, and 24 or 32 bits; others are refused in a line.
  # Colours become greys. Pure.
  alias Nav.MapFile.Picture

  @damaged {:error, "the picture is damaged"}

  @doc "Reads the picture after the two letters of its kind; it may have at most so many pixels."
  @spec decode(binary(), pos_integer()) :: {:ok, Picture.t()} | {:error, String.t()}
  def decode(
        <<_size::32, _reserved::32, start::little-32, head::little-32, width::little-signed-32,
          height::little-signed-32, 1::little-16, depth::little-16, compression::little-32,
          _sizes::binary-12, used::little-32, _important::32, rest::binary>> = bytes,
        most
      )
      when head >= 40 and start >= 14 + head do
    # What is left out here are the letters.
    {start, palette} = {start - 2, 14 + head - 2 - (byte_size(bytes) - byte_size(rest))}

    with :ok <- kind(depth, compression),
         :ok <- Picture.size(width, abs(height), most),
         {:ok, palette} <- palette(rest, palette, depth, used),
         stride = div(width * depth + 31, 32) * 4,
         true <- start + stride * abs(height) <= byte_size(bytes) || @damaged do
      rows =
        for j <- 0..(abs(height) - 1),
            do: row(binary_part(bytes, start + j * stride, stride), width, depth, palette)

      # Its lowest row is the first, unless its height is negative.
      {:ok, {width, abs(height), if(height > 0, do: Enum.reverse(rows), else: rows)}}
    end
  end

  def decode(_other, _most), do: @damaged

  defp kind(depth, 0) when depth in [1, 4, 8, 24, 32], do: :ok

  defp kind(depth, _compression),
    do:
      {:error,
       "is a BMP picture with #{depth} bits a pixel that is compressed or of another order than most; save it as PNG"}

  defp palette(_rest, _at, depth, _used) when depth > 8, do: {:ok, nil}

  defp palette(rest, at, depth, used) do
    count = if used in 1..Bitwise.bsl(1, depth), do: used, else: Bitwise.bsl(1, depth)

    case rest do
      <<_::binary-size(at), colours::binary-size(4 * count), _::binary>> ->
        {:ok, List.to_tuple(for <<b, g, r, _ <- colours>>, do: grey(r, g, b))}

      _cut ->
        @damaged
    end
  end

  defp row(bytes, width, 24, nil),
    do: for(<<b, g, r <- binary_part(bytes, 0, 3 * width)>>, into: <<>>, do: <<grey(r, g, b)>>)

  defp row(bytes, width, 32, nil),
    do: for(<<b, g, r, _ <- binary_part(bytes, 0, 4 * width)>>, into: <<>>, do: <<grey(r, g, b)>>)

  # A colour that the palette does not have is black. The last byte may hold more pixels than the row has.
  defp row(bytes, width, depth, palette) do
    greys =
      for <<k::size(depth) <- bytes>>,
        into: <<>>,
        do: <<if(k < tuple_size(palette), do: elem(palette, k), else: 0)>>

    binary_part(greys, 0, width)
  end

  defp grey(r, g, b), do: div(299 * r + 587 * g + 114 * b, 1_000)
end
