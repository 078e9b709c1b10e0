defmodule Hal.RFlex do
  @moduledoc """
  Speaks the byte protocol of the rFLEX motion controller (Magellan Pro, ATRV mini, B21r): frames, commands, reports,
  and their meaning in metres and radians. All of it is pure except the parts of the driver; the process and the line
  belong to `Hal.RFlex.Driver`.

  | module | subject |
  |---|---|
  | `Hal.RFlex.Protocol.Packet` | a frame: port, id, opcode, data, checksum |
  | `Hal.RFlex.Protocol.Decoder` | finds frames in a stream of bytes, even if it is split or damaged |
  | `Hal.RFlex.Protocol.Command` | the commands to the controller |
  | `Hal.RFlex.Protocol.Report` | the reports of the controller |
  | `Hal.RFlex.Conversions` | units per metre and radian; which are missing |
  | `Hal.RFlex.Sensors.Odometry` | pose and speed from two counters |
  | `Hal.RFlex.Sensors.Sonar`, `.Infrared`, `.Bumpers`, `.IndexSwitch` | the other sensors |
  | `Hal.RFlex.Protocol.Queue` | which command goes next, and when |
  | `Hal.RFlex.Options` | a robot's configuration, checked |
  | `Hal.RFlex.Speeds`, `.Reception`, `.Counters`, `.Schedule` | the parts of the driver: speeds for the wheels, reception, counters, times |
  | `Hal.RFlex.PowerSwitch` | prints the phrase after which the controller cuts the power |

  There is no vendor document: the facts are what public drivers do. Where these are uncertain,
  the modules say so.
  """

  @doc """
  The signed difference of two 32-bit counters, `later - earlier`; both may have wrapped.

      iex> Hal.RFlex.difference(-0x8000_0000, 0x7FFF_FFFF)
      1
      iex> Hal.RFlex.difference(5, 7)
      -2
  """
  @spec difference(later :: integer(), earlier :: integer()) :: integer()
  def difference(later, earlier) do
    <<difference::signed-32>> = <<later - earlier::32>>
    difference
  end
end
