defmodule Sim.Emulator.RFlexController.Frame do
  @moduledoc """
  Frames bytes as the controller sends and receives them (fact sheet rFLEX, sections 2 and 13). Pure.

      1B 02 | port | id | opcode | N | N bytes | checksum | 1B 03

  The checksum is the exclusive or of everything from `port` to the last of the N bytes.
  """

  @start <<0x1B, 0x02>>

  # The longest command has 21 bytes. A frame that claims to have more is not a command, and not
  # awaited.
  @longest 32

  @typedoc "Port, id, opcode, data."
  @type t :: {byte(), byte(), byte(), binary()}

  @typedoc """
  Where a 0x1B inside a frame is followed by one more byte: nowhere, after the length of an
  infrared report (as seen on Magellans), or anywhere in id, length or data.
  """
  @type ghost :: :off | :infrared | :all

  @doc """
  The bytes of a frame.

      iex> Sim.Emulator.RFlexController.Frame.encode({1, 0, 1, <<>>}, :off)
      <<0x1B, 0x02, 0x01, 0x00, 0x01, 0x00, 0x00, 0x1B, 0x03>>
  """
  @spec encode(t(), ghost()) :: binary()
  def encode({port, id, opcode, data}, ghost) do
    size = byte_size(data)
    sum = sum(<<port, id, opcode, size, data::binary>>)

    inside =
      case ghost do
        :all -> [port, double(<<id>>), opcode, double(<<size, data::binary>>)]
        :infrared when port == 6 and size == 0x1B -> [port, id, opcode, size, 0x1B, data]
        _none -> [port, id, opcode, size, data]
      end

    IO.iodata_to_binary([@start, inside, sum, 0x1B, 0x03])
  end

  defp double(bytes), do: :binary.replace(bytes, <<0x1B>>, <<0x1B, 0x1B>>, [:global])

  @doc """
  Splits a stream into frames, the unfinished rest, and the number of false beginnings: after each
  of these the search goes on with the next byte.

      iex> frame = Sim.Emulator.RFlexController.Frame.encode({2, 0, 12, <<>>}, :off)
      iex> Sim.Emulator.RFlexController.Frame.cut("noise" <> frame <> <<0x1B, 0x02>>)
      {[{2, 0, 12, ""}], <<0x1B, 0x02>>, 0}
  """
  @spec cut(binary()) :: {[t()], rest :: binary(), bad :: non_neg_integer()}
  def cut(bytes), do: cut(bytes, [], 0)

  defp cut(bytes, frames, bad) do
    case :binary.match(bytes, @start) do
      {from, 2} ->
        bytes |> binary_part(from, byte_size(bytes) - from) |> read(frames, bad)

      :nomatch ->
        {Enum.reverse(frames), half(bytes), bad}
    end
  end

  defp read(<<_start::16, _ids::24, size, rest::binary>> = bytes, frames, bad)
       when size > @longest or byte_size(rest) >= size + 3 do
    case bytes do
      <<_start::16, port, id, opcode, n, data::binary-size(n), sum, 0x1B, 0x03, rest::binary>>
      when n <= @longest ->
        inside = <<port, id, opcode, n, data::binary>>

        if sum(inside) == sum,
          do: cut(rest, [{port, id, opcode, data} | frames], bad),
          else: skip(bytes, frames, bad)

      _no_end ->
        skip(bytes, frames, bad)
    end
  end

  defp read(unfinished, frames, bad), do: {Enum.reverse(frames), unfinished, bad}

  @doc "The same, if the rest of a frame does not arrive: the search goes on after its beginning."
  @spec give_up(binary()) :: {[t()], rest :: binary(), bad :: non_neg_integer()}
  def give_up(<<@start, _::binary>> = bytes), do: skip(bytes, [], 0)
  def give_up(_half_a_start), do: {[], <<>>, 0}

  defp skip(<<_first, bytes::binary>>, frames, bad), do: cut(bytes, frames, bad + 1)

  # The last byte may be half of a start.
  defp half(bytes) do
    if bytes != <<>> and :binary.last(bytes) == 0x1B, do: <<0x1B>>, else: <<>>
  end

  defp sum(bytes), do: for(<<byte <- bytes>>, reduce: 0, do: (sum -> Bitwise.bxor(sum, byte)))
end
