defmodule Hal.RFlex.Protocol.Packet do
  @moduledoc """
  Holds one frame of the rFLEX protocol, the same in both directions; integers are big-endian. Pure.

      1B 02 | port | id | opcode | N | N bytes of data | checksum | 1B 03

  The checksum is the exclusive or of everything from the port to the last data byte. It detects
  any damage to one byte, and 255 of 256 cases of random damage to several bytes; it does not
  detect bytes that changed places, or the same bit flipped in two bytes.
  """
  import Bitwise

  @enforce_keys [:port, :opcode]
  defstruct [:port, :opcode, id: 0, data: <<>>]

  @type t :: %__MODULE__{port: byte(), id: byte(), opcode: byte(), data: binary()}

  @doc """
  The bytes of a frame. Its data has at most 255 bytes.

      iex> Hal.RFlex.Protocol.Packet.encode(%Hal.RFlex.Protocol.Packet{port: 2, opcode: 10})
      <<0x1B, 0x02, 0x02, 0x00, 0x0A, 0x00, 0x08, 0x1B, 0x03>>
  """
  @spec encode(t()) :: binary()
  def encode(%__MODULE__{data: data} = packet) when byte_size(data) <= 255 do
    body = <<packet.port, packet.id, packet.opcode, byte_size(data), data::binary>>
    <<0x1B, 0x02, body::binary, checksum(body), 0x1B, 0x03>>
  end

  @doc """
  The exclusive or of all bytes.

      iex> Hal.RFlex.Protocol.Packet.checksum(<<0x02, 0x00, 0x0C, 0x00>>)
      0x0E
  """
  @spec checksum(binary()) :: byte()
  def checksum(bytes), do: checksum(bytes, 0)

  defp checksum(<<byte, rest::binary>>, sum), do: checksum(rest, bxor(sum, byte))
  defp checksum(<<>>, sum), do: sum
end
