defmodule Sim.Device.Drive do
  @moduledoc """
  Simulates the wheels, sonars and bumpers of a robot in a simulated world. Options: `world` (its name), `robot`. Until
  the world is up, and after it has ended, the error is `{:error, :no_world}`.
  """
  @behaviour Hal.Drive
  alias Hal.Twist
  alias Sim.World

  @impl Hal.Drive
  def init(options) do
    options = Keyword.validate!(options, [:world, :robot])

    with {:ok, {server, _} = line} <-
           World.Server.attach(options[:world], options[:robot], :drive) do
      World.Server.drive(server, options[:robot], Twist.zero())
      {:ok, %{line: line, robot: options[:robot], least: nil}}
    end
  end

  @impl Hal.Drive
  def explain(:no_world, _options), do: "its simulated world is not there"
  def explain(:silent, _options), do: "its body in the world says nothing"
  def explain(reason, _options), do: inspect(reason)

  @impl Hal.Drive
  def drive(twist, %{line: {server, _}} = drive) do
    World.Server.drive(server, drive.robot, twist)
    {:ok, drive}
  end

  @impl Hal.Drive
  defdelegate handle_message(message, drive), to: Sim.Device

  @impl Hal.Drive
  def terminate(drive), do: World.Server.detach(drive.line, drive.robot, :drive)
end
