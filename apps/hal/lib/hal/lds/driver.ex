defmodule Hal.Lds.Driver do
  @moduledoc """
  Reads the lidar of a TurtleBot3, an LDS-01 or an LDS-02, on a serial line, run by `Hal.Device`.

      {Hal.Device, kind: :scan, driver: {Hal.Lds.Driver, port: "/dev/ttyUSB0", model: :lds01}, sinks: [...]}

  | option | | default |
  |---|---|---|
  | `:port` | path of the serial device | required |
  | `:model` | `:lds01`, with a motor under the board, or `:lds02`, which has its own baud | required |
  | `:upside_down` | whether it hangs: then it turns the other way | `false` |
  | `:serial` | `:module` of `Hal.Serial.open/1` | `[]` |

  Errors are those of `Hal.Serial` and of `Hal.Lds.Session`.
  """
  @behaviour Hal.Lidar
  alias Hal.Lds.Session
  alias Hal.Lidar.Line
  alias Hal.{Options, Serial}

  @speeds %{lds01: 230_400, lds02: 115_200}
  @table [
    port: [:path, required: true],
    model: [{:one_of, [:lds01, :lds02]}, required: true],
    upside_down: [:boolean, default: false],
    serial: [{:keys, Keyword.take(Serial.table(), [:module])}, default: []]
  ]

  @impl Hal.Lidar
  def option_table, do: @table

  @impl Hal.Lidar
  def init(options) do
    options = Options.check!(options, @table, "lds")
    speed = Map.fetch!(@speeds, options[:model])
    Line.open(Session, options, options[:serial] ++ [port: options[:port], speed: speed])
  end

  @impl Hal.Lidar
  defdelegate handle_message(message, line), to: Line

  @impl Hal.Lidar
  defdelegate terminate(line), to: Line, as: :close

  @doc """
  Describes an error in words.

      iex> Hal.Lds.Driver.explain(:silent, port: "/dev/ttyUSB0", model: :lds02)
      "/dev/ttyUSB0: no LDS-02 is heard (is it an LDS-01, model: :lds01?)"
  """
  @impl Hal.Lidar
  def explain(:silent, options) do
    [ours, other] =
      if options[:model] == :lds02, do: ["LDS-02", "LDS-01"], else: ["LDS-01", "LDS-02"]

    model = other |> String.downcase() |> String.replace("-", "")
    "#{options[:port]}: no #{ours} is heard (is it an #{other}, model: :#{model}?)"
  end

  def explain(reason, options), do: Serial.explain(reason, "#{options[:port]}")
end
