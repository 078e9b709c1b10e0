defmodule Hal.TurtleBot3.Packet do
  @moduledoc """
  Frames bytes as Dynamixel's protocol 2.0 has them: `FF FF FD 00`, id, length, instruction, parameters, CRC. Numbers have their
  least byte first; `FF FF FD` inside is sent as `FF FF FD FD`. Pure.
  """
  import Bitwise

  @id 200
  @reply 0x55
  # A read of the whole control table has fewer bytes; a frame that claims more is none, and not awaited.
  @longest 512

  @typedoc "The error byte and the data of a reply."
  @type reply :: {error :: byte(), data :: binary()}

  @doc """
  Asks for `size` bytes of the control table from this address on.

      iex> Base.encode16(Hal.TurtleBot3.Packet.read(136, 8))
      "FFFFFD00C8070002" <> "88000800" <> "835F"
  """
  @spec read(non_neg_integer(), pos_integer()) :: binary()
  def read(address, size), do: packet(2, <<address::little-16, size::little-16>>)

  @doc """
  Writes bytes to the control table.

      iex> Base.encode16(Hal.TurtleBot3.Packet.write(19, <<7>>))
      "FFFFFD00C8060003" <> "130007" <> "23A7"
  """
  @spec write(non_neg_integer(), binary()) :: binary()
  def write(address, data), do: packet(3, <<address::little-16, data::binary>>)

  defp packet(instruction, parameters) do
    body = stuff(<<instruction, parameters::binary>>)
    framed = <<0xFF, 0xFF, 0xFD, 0, @id, byte_size(body) + 2::little-16, body::binary>>
    <<framed::binary, crc(framed)::little-16>>
  end

  defp stuff(bytes),
    do: :binary.replace(bytes, <<0xFF, 0xFF, 0xFD>>, <<0xFF, 0xFF, 0xFD, 0xFD>>, [:global])

  defp unstuff(bytes),
    do: :binary.replace(bytes, <<0xFF, 0xFF, 0xFD, 0xFD>>, <<0xFF, 0xFF, 0xFD>>, [:global])

  @doc """
  Splits a stream into the replies of the board and the unfinished rest. Frames of others, and those with a wrong CRC, are passed
  over; after the latter the search goes on behind their first byte.

      iex> reply = <<0xFF, 0xFF, 0xFD, 0, 200, 5, 0, 0x55, 0, 7>>
      iex> crc = Hal.TurtleBot3.Packet.crc(reply)
      iex> Hal.TurtleBot3.Packet.cut("junk" <> reply <> <<crc::little-16, 0xFF, 0xFF>>)
      {[{0, <<7>>}], <<0xFF, 0xFF>>}
  """
  @spec cut(binary()) :: {[reply()], rest :: binary()}
  def cut(bytes), do: cut(bytes, [])

  defp cut(bytes, found) do
    case :binary.match(bytes, <<0xFF, 0xFF, 0xFD, 0>>) do
      {from, 4} -> bytes |> binary_part(from, byte_size(bytes) - from) |> frame(found)
      :nomatch -> {Enum.reverse(found), begun(bytes)}
    end
  end

  defp frame(<<_start::32, _id, size::little-16, _::binary>> = bytes, found)
       when size < 3 or size > @longest,
       do: skip(bytes, found)

  defp frame(<<_start::32, id, size::little-16, rest::binary>> = bytes, found)
       when byte_size(rest) >= size do
    body = binary_part(rest, 0, size - 2)
    later = binary_part(rest, size, byte_size(rest) - size)
    <<crc::little-16>> = binary_part(rest, size - 2, 2)

    if crc == crc(binary_part(bytes, 0, size + 5)),
      do: cut(later, reply(id, unstuff(body)) ++ found),
      else: skip(bytes, found)
  end

  defp frame(unfinished, found), do: {Enum.reverse(found), unfinished}

  defp skip(<<_first, rest::binary>>, found), do: cut(rest, found)

  defp reply(@id, <<@reply, error, data::binary>>), do: [{error, data}]
  defp reply(_id, _other), do: []

  # The last bytes may be the beginning of a start.
  defp begun(bytes) do
    Enum.find([<<0xFF, 0xFF, 0xFD>>, <<0xFF, 0xFF>>, <<0xFF>>], <<>>, fn start ->
      String.ends_with?(bytes, start)
    end)
  end

  @crcs (for n <- 0..255 do
           Enum.reduce(1..8, n <<< 8, fn _bit, crc ->
             shifted = crc <<< 1 &&& 0xFFFF
             if (crc &&& 0x8000) != 0, do: bxor(shifted, 0x8005), else: shifted
           end)
         end)
        |> List.to_tuple()

  @doc "The CRC-16 of these bytes: polynomial 8005, beginning with 0, not reflected."
  @spec crc(binary()) :: 0..0xFFFF
  def crc(bytes) do
    for <<byte <- bytes>>, reduce: 0 do
      crc -> bxor(crc <<< 8 &&& 0xFFFF, elem(@crcs, bxor(crc >>> 8, byte)))
    end
  end
end
