defmodule Hal.RFlex.Protocol.Command do
  @moduledoc false
  # Encodes the commands to the controller as bytes to write to the line. Pure; raw units.
  #
  # Axis 0 moves, axis 1 turns. A speed is always two frames, one for each axis. Torques and the
  # acceleration of axis 1 are the constants that public drivers send.
  import Bitwise
  alias Hal.RFlex.Protocol.Packet

  @torque {30_000, 35_000}
  @turn_acceleration 100_000
  @largest 0xFFFF_FFFF

  @type axis :: 0 | 1

  @doc """
  Requests motor reports of the axes in `mask` every `period` (assumed to be microseconds); 0, 0
  ends them.
  """
  @spec system_reports(non_neg_integer(), non_neg_integer()) :: binary()
  def system_reports(period, mask), do: frame(2, 34, <<period::32, mask::32>>)

  @doc """
  Requests reports of the digital inputs every `period` (assumed to be microseconds); 0 ends them.
  """
  @spec input_reports(non_neg_integer()) :: binary()
  def input_reports(0), do: frame(5, 0, <<0::32>>, 4)
  def input_reports(period), do: frame(5, 0, <<period::32>>)

  @doc "Resets the controller's own settings to their defaults."
  @spec defaults() :: binary()
  def defaults, do: frame(2, 10, <<>>)

  @doc "Sets the brake."
  @spec brake() :: binary()
  def brake, do: frame(2, 11, <<>>)

  @doc """
  Releases the brake.

      iex> Hal.RFlex.Protocol.Command.release()
      <<0x1B, 0x02, 0x02, 0x00, 0x0C, 0x00, 0x0E, 0x1B, 0x03>>
  """
  @spec release() :: binary()
  def release, do: frame(2, 12, <<>>)

  @doc """
  The first frame of an axis after the opening: at rest, with this acceleration. Neither a byte of
  the acceleration nor, unless that is 0, the checksum is `1B`: see `turn/2`.
  """
  @spec prepare(axis(), non_neg_integer()) :: binary()
  def prepare(axis, acceleration) do
    bytes = frame(2, 7, <<axis, 0::32, plain(acceleration)::32, 0::32, 0>>)

    if summed?(bytes) and acceleration > 0,
      do: prepare(axis, plain(acceleration) - 1),
      else: bytes
  end

  @doc """
  The signed speed of axis 0, and the acceleration with which the controller gets there. Neither a
  byte of these two nor, unless the acceleration is 0, the checksum is `1B`: see `turn/2`.
  """
  @spec move(integer(), non_neg_integer()) :: binary()
  def move(speed, acceleration) when abs(speed) <= @largest,
    do: axis(0, plain(abs(speed)) * sign(speed), acceleration)

  @doc """
  The signed speed of axis 1, whose magnitude should not exceed `greatest`.

  The controller misunderstands a speed that has a byte `1B`. Public drivers avoid it in the
  second byte by going to `1AFF` or `1C00`, whichever is nearer, and so does this function. It
  also avoids what they leave alone: a last byte `1B`, the same in axis 0 (both towards zero), in
  the acceleration, and a checksum `1B` (the acceleration is lowered by a unit or two). None of
  this raises a speed above `greatest`.
  """
  @spec turn(integer(), non_neg_integer()) :: binary()
  def turn(speed, greatest \\ @largest) when abs(speed) <= @largest,
    do: axis(1, avoid(abs(speed), greatest) * sign(speed), @turn_acceleration)

  @doc """
  The magnitude of a turning speed without any byte `1B`, after the public drivers.

      iex> Hal.RFlex.Protocol.Command.avoid(0x1B80, 0xFFFF)
      0x1C00
      iex> Hal.RFlex.Protocol.Command.avoid(0x1B80, 0x1B90)
      0x1AFF
      iex> Hal.RFlex.Protocol.Command.avoid(0x11B05, 0xFFFFF)
      0x11AFF
  """
  @spec avoid(non_neg_integer(), non_neg_integer()) :: non_neg_integer()
  def avoid(speed, greatest \\ @largest) do
    speed = speed |> second(greatest) |> top(greatest)
    plain(speed)
  end

  @doc """
  Starts the sonars: listening time per ping, pause after it, pause after a sweep; microseconds.
  """
  @spec sonar_on(non_neg_integer(), non_neg_integer(), non_neg_integer()) :: binary()
  def sonar_on(echo, ping, set), do: frame(4, 0, <<echo::32, ping::32, set::32, 2>>, 4)

  @doc "Stops the sonars."
  @spec sonar_off() :: binary()
  def sonar_off, do: frame(4, 0, <<0::104>>, 4)

  @doc "Starts the infrareds, with the five times that public drivers send."
  @spec infrared_on() :: binary()
  def infrared_on, do: frame(6, 0, <<0::32, 70::32, 10::32, 20::32, 150::32, 2>>)

  @doc "Stops the infrareds."
  @spec infrared_off() :: binary()
  def infrared_off, do: frame(6, 0, <<0::168>>)

  @doc "Requests the state of battery and brake."
  @spec status() :: binary()
  def status, do: frame(1, 1, <<>>)

  @doc "Requests the state of the joystick."
  @spec joystick() :: binary()
  def joystick, do: frame(3, 0, <<>>)

  defp axis(axis, speed, acceleration) do
    direction = if speed < 0, do: 0, else: 1
    torque = elem(@torque, axis)
    data = <<axis, abs(speed)::32, plain(acceleration)::32, torque::32, direction>>
    bytes = frame(2, 7, data)

    if summed?(bytes) and acceleration > 0,
      do: axis(axis, speed, plain(acceleration) - 1),
      else: bytes
  end

  # The checksum is the third byte from the end. Another acceleration changes it.
  defp summed?(bytes), do: :binary.at(bytes, byte_size(bytes) - 3) == 0x1B

  defp frame(port, opcode, data, id \\ 0),
    do: Packet.encode(%Packet{port: port, id: id, opcode: opcode, data: data})

  defp sign(speed) when speed < 0, do: -1
  defp sign(_speed), do: 1

  defp second(speed, greatest) when band(speed, 0xFF00) == 0x1B00 do
    base = speed - band(speed, 0xFFFF)

    if band(speed, 0xFF) > 127 and base + 0x1C00 <= greatest,
      do: base + 0x1C00,
      else: base + 0x1AFF
  end

  defp second(speed, _greatest), do: speed

  defp top(speed, greatest) when speed >>> 24 == 0x1B do
    low = band(speed, 0xFFFFFF)

    if band(speed, 0xFF0000) > 0x7F0000 and bor(low, 0x1C000000) <= greatest,
      do: bor(low, 0x1C000000),
      else: bor(low, 0x1AFF0000)
  end

  defp top(speed, _greatest), do: speed

  # The next number towards zero without any byte 1B.
  defp plain(number) do
    case <<number::32>> do
      <<0x1B, _::24>> -> 0x1AFFFFFF
      <<top, 0x1B, _::16>> -> (top <<< 24) + 0x1AFFFF
      <<high::16, 0x1B, _>> -> (high <<< 16) + 0x1AFF
      <<_::24, 0x1B>> -> number - 1
      _ -> number
    end
  end
end
