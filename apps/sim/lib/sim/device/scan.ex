defmodule Sim.Device.Scan do
  @moduledoc "Simulates the lidar of a robot in a simulated world. Options as for `Sim.Device.Drive`."
  @behaviour Hal.Lidar
  alias Sim.World

  @impl Hal.Lidar
  def init(options) do
    options = Keyword.validate!(options, [:world, :robot])

    with {:ok, line} <- World.Server.attach(options[:world], options[:robot], :scan),
         do: {:ok, %{line: line, robot: options[:robot], least: nil}}
  end

  @impl Hal.Lidar
  defdelegate handle_message(message, lidar), to: Sim.Device

  @impl Hal.Lidar
  def terminate(lidar), do: World.Server.detach(lidar.line, lidar.robot, :scan)
end
