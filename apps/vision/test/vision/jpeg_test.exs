defmodule Vision.JpegTest do
  use ExUnit.Case, async: true
  doctest Vision.Jpeg
  doctest Vision.Jpeg.Encoder
  doctest Vision.View.Subscribers
  alias Vision.Jpeg

  test "whatever the pieces that it comes in, the pictures are the same" do
    pictures = for n <- 1..5, do: <<0xFF, 0xD8>> <> :binary.copy(<<n>>, 40 * n) <> <<0xFF, 0xD9>>

    stream =
      for picture <- pictures, into: "--ffmpeg\r\n" do
        "Content-type: image/jpeg\r\nContent-length: #{byte_size(picture)}\r\n\r\n" <>
          picture <> "\r\n--ffmpeg\r\n"
      end

    for _ <- 1..200, do: assert(read(pieces(stream), "", []) == pictures)
  end

  defp pieces(""), do: []

  defp pieces(stream) do
    size = min(:rand.uniform(90), byte_size(stream))
    {piece, rest} = :erlang.split_binary(stream, size)
    [piece | pieces(rest)]
  end

  defp read(pieces, buffer, taken) do
    case {Jpeg.take(buffer, 10_000), pieces} do
      {{:ok, jpeg, rest}, _} -> read(pieces, rest, [jpeg | taken])
      {:more, [piece | pieces]} -> read(pieces, buffer <> piece, taken)
      {:more, []} -> Enum.reverse(taken)
    end
  end

  test "what is no picture is said to be none, and nothing grows" do
    head = "--ffmpeg\r\nContent-length: "

    for bad <- [
          head <> "99999999999\r\n\r\n",
          head <> "-4\r\n\r\n",
          head <> "many\r\n\r\n",
          head <> "8\r\n\r\nnot jpeg",
          head <> "8\r\n\r\n" <> <<0xFF, 0xD9>>,
          "\r\n\r\n",
          :binary.copy("x", 256)
        ],
        do: assert(Jpeg.take(bad, 1_000) == {:error, :unreadable})

    for _ <- 1..2_000, bytes = :rand.bytes(300), do: assert(Jpeg.take(bytes, 1_000) != :more)
  end
end
