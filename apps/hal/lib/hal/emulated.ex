defmodule Hal.Emulated do
  @moduledoc """
  Defines the device at the other end of a line, as `Hal.DriveCase`, `Hal.ScanCase`, `Hal.CameraCase` and `Hal.PtzCase` use it;
  `Sim.Emulator` is one.
  """

  @doc "Starts a device at the other end of a line, whose link (`link:`) the kit adds to these options."
  @callback start_link(keyword()) :: GenServer.on_start() | {:error, line :: String.t()}
  @doc "Pulls the cable."
  @callback unplug(GenServer.server()) :: :ok
  @doc "Plugs it in again."
  @callback plug(GenServer.server()) :: :ok
  @doc "Switches the device off and on."
  @callback restart(GenServer.server()) :: :ok
  @doc "Puts noise on the line to the driver."
  @callback noise(GenServer.server(), binary()) :: :ok
end
