defmodule Hal.RPLidar.Driver do
  @moduledoc """
  Reads a SLAMTEC RPLIDAR A1 or A2 on a serial line, run by `Hal.Device`.

      {Hal.Device, kind: :scan, driver: {Hal.RPLidar.Driver, port: "/dev/ttyUSB1"}, sinks: [...]}

  | option | | default |
  |---|---|---|
  | `:port` | path of the serial device | required |
  | `:speed` | baud | `115_200`; 256,000 for an A2 of hardware 6 |
  | `:mode` | `:express` (4000 measurements a second) or `:standard` (2000) | `:express` |
  | `:upside_down` | whether it hangs: then it turns the other way | `false` |
  | `:serial` | `:module` of `Hal.Serial.open/1` | `[]` |

  `Hal.RPLidar.Session`, which is pure, decides what to say; errors are those of `Hal.Serial` and those of the session. The motor
  of an A1 turns while the line DTR is cleared, that of an A2 by a command: both are done.
  """
  @behaviour Hal.Lidar
  alias Hal.Lidar.Line
  alias Hal.{Options, Serial}
  alias Hal.RPLidar.Session

  @table [
    port: [:path, required: true],
    speed: [{:integer, 1, 20_000_000, "baud"}, default: 115_200],
    mode: [{:one_of, [:express, :standard]}, default: :express],
    upside_down: [:boolean, default: false],
    serial: [{:keys, Keyword.take(Serial.table(), [:module])}, default: []]
  ]

  @impl Hal.Lidar
  def option_table, do: @table

  @impl Hal.Lidar
  def init(options) do
    options = Options.check!(options, @table, "rplidar")
    serial = options[:serial] ++ Keyword.take(options, [:port, :speed]) ++ [dtr: false]
    Line.open(Session, options, serial)
  end

  @impl Hal.Lidar
  defdelegate handle_message(message, line), to: Line

  @impl Hal.Lidar
  defdelegate terminate(line), to: Line, as: :close

  @doc """
  Describes an error in words.

      iex> Hal.RPLidar.Driver.explain({:no_answer, :info}, port: "/dev/ttyUSB1")
      "/dev/ttyUSB1: no RPLIDAR answers (an A2 of hardware 6 does at speed: 256000)"
      iex> Hal.RPLidar.Driver.explain(:enoent, port: "/dev/ttyUSB1")
      "/dev/ttyUSB1: no such device"
  """
  @impl Hal.Lidar
  def explain({:no_answer, :info}, options),
    do: "#{options[:port]}: no RPLIDAR answers (an A2 of hardware 6 does at speed: 256000)"

  def explain({:no_answer, what}, options),
    do: "#{options[:port]}: the RPLIDAR does not answer when asked for #{what}"

  def explain({:fault, code}, options),
    do: "#{options[:port]}: the RPLIDAR says that it has a fault, code #{code}"

  def explain(:silent, options),
    do: "#{options[:port]}: the RPLIDAR measures nothing (does its motor turn?)"

  def explain(reason, options), do: Serial.explain(reason, "#{options[:port]}")
end
