defmodule Hal.RFlex.Protocol.Report do
  @moduledoc false
  # Decodes the controller's reports, in raw units. Pure. Of a report that is longer than
  # documented, the documented part is read; shorter ones are `:malformed`; undocumented ports and
  # opcodes are `:unknown`.
  alias Hal.RFlex.Protocol.Packet

  @type axis :: %{
          axis: byte(),
          timestamp: non_neg_integer(),
          position: integer(),
          velocity: integer()
        }
  @type t ::
          {:axis, axis()}
          | {:sonar, [{id :: byte(), raw :: 0..0xFFFF}]}
          | {:infrared, [<<_::64>>]}
          | {:input, address :: byte(), state :: byte()}
          | {:status, centivolts :: non_neg_integer(), brake :: byte()}
          | {:joystick, x :: integer(), y :: integer(), buttons :: byte()}
          | {:screen, row :: byte(), binary()}

  @doc """
  Decodes a packet.

      iex> alias Hal.RFlex.Protocol.{Packet, Report}
      iex> Report.decode(%Packet{port: 5, opcode: 1, data: <<5000::32, 0x41, 0x0080::16>>})
      {:input, 0x41, 0x80}
      iex> Report.decode(%Packet{port: 9, opcode: 1})
      :unknown
  """
  @spec decode(Packet.t()) :: t() | :unknown | :malformed
  def decode(%Packet{port: 2, opcode: 33, data: data}) do
    case data do
      <<_rv::32, timestamp::32, axis, position::signed-32, velocity::signed-32, _acceleration::32,
        _torque::32, _::binary>> ->
        {:axis, %{axis: axis, timestamp: timestamp, position: position, velocity: velocity}}

      _short ->
        :malformed
    end
  end

  def decode(%Packet{port: 4, opcode: 2, data: <<_unknown::32, _timestamp::32, records::binary>>})
      when rem(byte_size(records), 3) == 0,
      do: {:sonar, for(<<id, raw::16 <- records>>, do: {id, raw})}

  def decode(%Packet{port: 4, opcode: 2}), do: :malformed

  def decode(%Packet{port: 6, opcode: 1, data: <<banks, rest::binary>>})
      when byte_size(rest) >= 13 * banks do
    rest = binary_part(rest, 0, 13 * banks)
    {:infrared, for(<<_timestamp::32, values::binary-8, _reserved <- rest>>, do: values)}
  end

  def decode(%Packet{port: 6, opcode: 1}), do: :malformed

  def decode(%Packet{port: 5, opcode: 1, data: data}) do
    case data do
      <<_timestamp::32, address, _offset, state, _::binary>> -> {:input, address, state}
      _short -> :malformed
    end
  end

  def decode(%Packet{port: 1, opcode: 1, data: data}) do
    case data do
      <<_timestamp::32, centivolts::32, brake, _::binary>> -> {:status, centivolts, brake}
      _short -> :malformed
    end
  end

  def decode(%Packet{port: 3, opcode: 0, data: data}) do
    case data do
      <<_timestamp::32, x::signed-32, y::signed-32, buttons, _::binary>> ->
        {:joystick, x, y, buttons}

      _short ->
        :malformed
    end
  end

  def decode(%Packet{port: 1, opcode: 0, data: data}) do
    case data do
      <<_timestamp::32, row, n, bytes::binary-size(n), _::binary>> -> {:screen, row, bytes}
      _short -> :malformed
    end
  end

  def decode(%Packet{}), do: :unknown
end
