defmodule Sim.Device.Ptz do
  @moduledoc "Simulates the pan-tilt unit of a robot in a simulated world. Options as for `Sim.Device.Drive`."
  @behaviour Hal.Ptz
  alias Sim.World

  @impl Hal.Ptz
  def init(options) do
    options = Keyword.validate!(options, [:world, :robot])

    with {:ok, line} <- World.Server.attach(options[:world], options[:robot], :ptz),
         do: {:ok, %{line: line, robot: options[:robot], least: nil}}
  end

  @impl Hal.Ptz
  def look(pan, tilt, %{line: {server, _}} = ptz) do
    World.Server.look(server, ptz.robot, pan, tilt)
    {:ok, ptz}
  end

  @doc "Takes any angle from 0.05 to 3 radians, at once."
  @impl Hal.Ptz
  def zoom(field_of_view, %{line: {server, _}} = ptz) do
    World.Server.zoom(server, ptz.robot, field_of_view)
    {:ok, ptz}
  end

  @impl Hal.Ptz
  defdelegate handle_message(message, ptz), to: Sim.Device

  @impl Hal.Ptz
  def terminate(ptz), do: World.Server.detach(ptz.line, ptz.robot, :ptz)
end
