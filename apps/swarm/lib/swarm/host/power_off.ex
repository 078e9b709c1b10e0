defmodule Swarm.Host.PowerOff do
  @moduledoc """
  Makes the controller of this machine's robot cut the power of both (`Hal.RFlex.PowerSwitch`), by
  the `console:` of the robot's file. Without that key, it sends nothing.

  While a robot runs here, it has the line of its base, and the power stays on: a machine that still drives
  has not halted. So it does where the line cannot be looked at, for instance without permission. A base on another line
  than its own file says is not found out. Whether a controller listens to the console nobody can know: what is answered
  is that it was told.
  """
  alias Hal.RFlex.PowerSwitch
  alias Hal.Serial

  @doc "Says the phrase; or why not, in a line. `nil` is a node without a robot."
  @spec say(Robot.File.t() | nil) :: {:ok, line :: String.t()} | {:error, line :: String.t()}
  def say(nil), do: {:error, "has no robot that could be switched off"}

  def say(%Robot.File{console: nil}),
    do: {:error, "has no console: in its file; the power stays on"}

  def say(%Robot.File{console: console, drive: {_driver, options}}) do
    with :ok <- idle(options[:port]), :ok <- PowerSwitch.halt(console) do
      {:ok, "#{console[:port]} was told; a controller that listens there cuts the power now"}
    end
  end

  defp idle(nil), do: :ok

  defp idle(port) do
    case Serial.open(port: port) do
      {:ok, line} ->
        Serial.close(line)

      {:error, :ebusy} ->
        {:error, "a robot runs here: #{Serial.explain(:ebusy, port)}; the power stays on"}

      # A base that is not there drives nobody.
      {:error, not_there} when not_there in [:enoent, :enodev, :enxio, :eio] ->
        :ok

      {:error, reason} ->
        {:error, "a robot may run here: #{Serial.explain(reason, port)}; the power stays on"}
    end
  end
end
