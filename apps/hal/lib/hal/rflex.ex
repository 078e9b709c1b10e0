defmodule Hal.RFlex do
  @moduledoc """
  The byte protocol of the rFLEX motion controller (Magellan Pro, ATRV mini, B21r): frames,
  commands, reports, and what they mean in metres and radians. All of it is pure but the driver's
  parts; the process and the line belong to `Hal.RFlex.Driver`.

  | module | subject |
  |---|---|
  | `Hal.RFlex.Protocol.Packet` | a frame: port, id, opcode, data, checksum |
  | `Hal.RFlex.Protocol.Decoder` | frames out of a stream of bytes, however cut or damaged |
  | `Hal.RFlex.Protocol.Command` | what we may say |
  | `Hal.RFlex.Protocol.Report` | what the controller says |
  | `Hal.RFlex.Conversions` | units per metre and radian; which are missing |
  | `Hal.RFlex.Sensors.Odometry` | pose and speed from two counters |
  | `Hal.RFlex.Sensors.Sonar`, `.Infrared`, `.Bumpers`, `.IndexSwitch` | the other senses |
  | `Hal.RFlex.Protocol.Queue` | which command goes next, and when |
  | `Hal.RFlex.Options` | a robot's configuration, checked |
  | `Hal.RFlex.Speeds`, `.Reception`, `.Counters`, `.Schedule` | the driver's parts: what it tells the wheels, what it hears, what it counts, and when |
  | `Hal.RFlex.PowerSwitch` | the phrase after which the controller cuts the power |

  There is no vendor document: the facts are what public drivers do. Where those are unsure the
  modules say so.
  """

  @doc """
  The difference of two 32-bit counters: `later - earlier`, where both may have wrapped.

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
