defmodule Nav.MapFile.Pgm do
  @moduledoc "Reads PGM pictures, plain (P2) and raw (P5), of up to 65,535 greys. Pure."
  alias Nav.MapFile.Picture

  @damaged {:error, "the picture is damaged"}

  @doc """
  Reads the picture after the two letters of its kind; it may have at most so many pixels.

      iex> Nav.MapFile.Pgm.decode(?2, "\\n# a comment\\n3 2\\n255\\n0 255 255\\n255 255 100\\n", 99)
      {:ok, {3, 2, [<<0, 255, 255>>, <<255, 255, 100>>]}}
      iex> Nav.MapFile.Pgm.decode(?5, "\\n3 2\\n255\\nabc", 99)
      {:error, "the picture is damaged"}
  """
  @spec decode(?2 | ?5, binary(), pos_integer()) :: {:ok, Picture.t()} | {:error, String.t()}
  def decode(kind, bytes, most_pixels) do
    with {:ok, width, bytes} <- number(bytes),
         {:ok, height, bytes} <- number(bytes),
         {:ok, most, <<blank, bytes::binary>>} when blank in ~c" \t\r\n" <- number(bytes) do
      with true <- most in 1..65_535 || @damaged,
           :ok <- Picture.size(width, height, most_pixels),
           do: pixels(kind, bytes, width, height, most)
    else
      _ -> @damaged
    end
  end

  defp pixels(?5, bytes, width, height, most)
       when most > 255 and byte_size(bytes) >= 2 * width * height do
    pixels = binary_part(bytes, 0, 2 * width * height)
    greys = for <<grey::16 <- pixels>>, into: <<>>, do: <<shade(grey, most)>>
    {:ok, {width, height, cut(greys, width)}}
  end

  defp pixels(?5, bytes, width, height, most)
       when most <= 255 and byte_size(bytes) >= width * height do
    pixels = binary_part(bytes, 0, width * height)

    pixels =
      if most == 255,
        do: pixels,
        else: for(<<grey <- pixels>>, into: <<>>, do: <<shade(grey, most)>>)

    {:ok, {width, height, cut(pixels, width)}}
  end

  defp pixels(?2, bytes, width, height, most) do
    case plain(bytes, width * height, most, <<>>) do
      {:ok, pixels} -> {:ok, {width, height, cut(pixels, width)}}
      :error -> @damaged
    end
  end

  defp pixels(_kind, _bytes, _width, _height, _most), do: @damaged

  defp plain(_bytes, 0, _most, done), do: {:ok, done}

  defp plain(bytes, left, most, done) do
    case number(bytes) do
      {:ok, grey, bytes} -> plain(bytes, left - 1, most, <<done::binary, shade(grey, most)>>)
      :error -> :error
    end
  end

  defp cut(pixels, width) do
    for row <- 0..(div(byte_size(pixels), width) - 1)//1,
        do: binary_part(pixels, row * width, width)
  end

  defp shade(grey, most), do: min(div(grey * 255, most), 255)

  defp number(<<blank, rest::binary>>) when blank in ~c" \t\r\n", do: number(rest)

  defp number(<<"#", rest::binary>>) do
    case :binary.split(rest, "\n") do
      [_comment, rest] -> number(rest)
      _no_end -> :error
    end
  end

  defp number(<<digit, _::binary>> = bytes) when digit in ?0..?9, do: digits(bytes, 0)
  defp number(_other), do: :error

  # No valid number has more than nine digits.
  defp digits(<<digit, rest::binary>>, number) when digit in ?0..?9 and number < 100_000_000,
    do: digits(rest, 10 * number + digit - ?0)

  defp digits(<<digit, _::binary>>, _number) when digit in ?0..?9, do: :error
  defp digits(rest, number), do: {:ok, number, rest}
end
