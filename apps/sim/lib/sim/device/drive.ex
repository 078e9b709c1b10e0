defmodule Sim.Device.Drive do
  @moduledoc """
  The wheels, sonars and bumpers of a robot in a simulated world. Options: `world` (its name),
  `robot`. Until the world is up, and after it has ended, the error is `{:error, :no_world}`.
  """
  @behaviour Hal.Drive
  alias Hal.Twist
  alias Sim.{Lateness, World}

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
  def handle_message({:world, server, {:readings, sent_ms, all}}, %{line: {server, _}} = drive) do
    {late?, least} = Lateness.late?(drive.least, sent_ms, System.monotonic_time(:millisecond))
    {:ok, if(late?, do: [], else: all), %{drive | least: least}}
  end

  def handle_message({:world, server, {:error, reason}}, %{line: {server, _}} = drive),
    do: {:error, reason, drive}

  def handle_message({:DOWN, monitor, _, _, _}, %{line: {_, monitor}} = drive),
    do: {:error, :no_world, drive}

  def handle_message(_other, drive), do: {:ok, [], drive}

  @impl Hal.Drive
  def terminate(drive), do: World.Server.detach(drive.line, drive.robot, :drive)
end
