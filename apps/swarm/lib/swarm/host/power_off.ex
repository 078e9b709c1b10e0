defmodule Swarm.Host.PowerOff do
  @moduledoc """
  Makes the controller of this machine's robot cut the power of robot and machine
  (`Hal.RFlex.PowerSwitch`), by the `console:` of the robot's file. Without that key, it sends
  nothing.

  While a robot runs here, it holds the line of its base, and the power stays on: a machine that
  still drives has not halted. The power also stays on if the line cannot be checked, for instance
  without permission. A base on another line than its own file says is not noticed. It cannot be
  known whether a controller listens to the console, so the answer says only that the phrase was
  sent.
  """
  alias Hal.RFlex.PowerSwitch
  alias Hal.Serial

  @doc "Sends the phrase; the error says in one line why not. `nil` is a node without a robot."
  @spec say(Robot.File.t() | nil) :: {:ok, line :: String.t()} | {:error, line :: String.t()}
  def say(nil), do: {:error, "has no robot to switch off"}

  def say(%Robot.File{console: nil}),
    do: {:error, "has no console: in its file; the power stays on"}

  def say(%Robot.File{console: console, drive: {_driver, options}}) do
    with :ok <- idle(options[:port]), :ok <- PowerSwitch.halt(console) do
      {:ok,
       "#{console[:port]} got the phrase; a controller that listens there cuts the power now"}
    end
  end

  defp idle(nil), do: :ok

  defp idle(port) do
    case Serial.open(port: port) do
      {:ok, line} ->
        Serial.close(line)

      {:error, :ebusy} ->
        {:error, "a robot runs here: #{Serial.explain(:ebusy, port)}; the power stays on"}

      # A base that does not exist cannot drive.
      {:error, not_there} when not_there in [:enoent, :enodev, :enxio, :eio] ->
        :ok

      {:error, reason} ->
        {:error, "a robot may run here: #{Serial.explain(reason, port)}; the power stays on"}
    end
  end
end
