defmodule Sim.Emulator.ViscaCamera.Packet do
  @moduledoc false
  # Packets as the camera reads and writes them (fact sheet VISCA, sections 2 to 4). Pure.
  #
  # Numbers of 16 bits travel as four bytes of four bits each. The camera is the first of its chain.

  # Header, 14 bytes and terminator.
  @longest 16

  @typedoc "What was sent to the camera; `:long` and `:other` have no readable content."
  @type t :: {:to_me, binary()} | {:to_all, binary()} | :long | :other

  @doc """
  Splits a stream into packets and the unfinished rest; only as much of the rest is kept as shows
  that it is too long.

      iex> Sim.Emulator.ViscaCamera.Packet.cut(<<0x81, 0x09, 0x04, 0x00, 0xFF, 0x88, 0x30>>)
      {[{:to_me, <<0x09, 0x04, 0x00>>}], <<0x88, 0x30>>}
  """
  @spec cut(binary()) :: {[t()], rest :: binary()}
  def cut(bytes) do
    {packets, [rest]} = bytes |> :binary.split(<<0xFF>>, [:global]) |> Enum.split(-1)
    {Enum.map(packets, &read/1), binary_part(rest, 0, min(byte_size(rest), @longest))}
  end

  defp read(packet) when byte_size(packet) >= @longest, do: :long
  defp read(<<0x81, said, rest::binary>>), do: {:to_me, <<said, rest::binary>>}
  defp read(<<0x88, said, rest::binary>>), do: {:to_all, <<said, rest::binary>>}
  defp read(_other), do: :other

  @doc "An answer to the controller."
  @spec answer(binary()) :: binary()
  def answer(bytes), do: <<0x90, bytes::binary, 0xFF>>

  @doc """
  A signed number in four bytes.

      iex> Sim.Emulator.ViscaCamera.Packet.nibbles(-264)
      <<0x0F, 0x0E, 0x0F, 0x08>>
  """
  @spec nibbles(integer()) :: <<_::32>>
  def nibbles(number) do
    for <<(four::4 <- <<number::16>>)>>, into: <<>>, do: <<four>>
  end

  @doc """
  The number in four bytes; `:error` if one of the bytes has more than four bits.

      iex> Sim.Emulator.ViscaCamera.Packet.number(<<0x0F, 0x0E, 0x0F, 0x08>>)
      {:ok, -264}
  """
  @spec number(<<_::32>>) :: {:ok, integer()} | :error
  def number(<<0::4, a::4, 0::4, b::4, 0::4, c::4, 0::4, d::4>>) do
    <<number::signed-16>> = <<a::4, b::4, c::4, d::4>>
    {:ok, number}
  end

  def number(_too_large), do: :error
end
