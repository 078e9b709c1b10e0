defmodule Lab.VirtualRobot.Hardware do
  @moduledoc """
  Gives robots of a simulated fleet whose bodies have an rFLEX controller (`rflex` of `Hal.Profile`) the drivers of real
  ones: each has a base and a camera, emulated on pseudo-terminals whose links are in the run's folder (`mag1.base`, `mag1.camera`), with the robot's body in the world behind them.

      supervisor (one_for_one: a device that crashes was, in effect, switched off and on)
      `-- Sim.Emulator   two for each such robot
  """
  alias Sim.{Device, Emulator}
  alias Sim.Emulator.{RFlexController, ViscaCamera}

  # Only our own bugs crash a device; the others go on.
  @restarts 100

  @typedoc "What matters of a robot (`t:Lab.Trial.Setup.robot/0`)."
  @type robot :: %{
          :id => atom(),
          :profile => Hal.Profile.t(),
          :hardware? => boolean(),
          optional(atom()) => term()
        }

  @doc """
  The part of a fleet's supervision tree for the robots with real drivers; none if there are none.
  """
  @spec parts([robot()], world :: term(), Path.t()) :: [Supervisor.child_spec()]
  def parts(robots, world, folder) do
    case for(
           %{hardware?: true} = robot <- robots,
           device <- devices(robot, world, folder),
           do: device
         ) do
      [] ->
        []

      devices ->
        options = [strategy: :one_for_one, max_restarts: @restarts]
        start = {Supervisor, :start_link, [devices, options]}
        [%{id: __MODULE__, type: :supervisor, start: start}]
    end
  end

  defp devices(%{id: id, profile: profile} = robot, world, folder) do
    body = [world: world, robot: id]
    base = [kind: profile.rflex, sonar_max: profile.sonar_max, ir_max: profile.ir_max]

    [
      emulator(
        {id, :base},
        {RFlexController, base},
        base_link(folder, robot),
        {Device.Drive, body}
      ),
      emulator(
        {id, :camera},
        {ViscaCamera, lens: lens(profile)},
        camera_link(folder, robot),
        {Device.Ptz, body}
      )
    ]
  end

  defp emulator(id, core, link, body) do
    %{id: id, start: {Emulator, :start_link, [[core: core, link: link, body: body]]}}
  end

  @doc """
  The devices of such a robot in place of simulated ones, drive and camera head; and, because its wheels count from
  zero when its driver starts again, the file by which it knows that it has left its start pose (`Robot.Departure`).
  """
  @spec drivers(robot(), Path.t()) :: keyword()
  def drivers(%{profile: profile} = robot, folder) do
    [
      drive:
        {Hal.RFlex.Driver,
         [port: base_link(folder, robot), profile: profile] ++ base(profile.rflex)},
      ptz: {Hal.Visca.Driver, port: camera_link(folder, robot), lens: lens(profile)},
      departure_file: Path.join(folder, "#{robot.id}.departed")
    ]
  end

  @doc "Where their serial lines are, for people, one line per robot."
  @spec lines([robot()], Path.t()) :: [String.t()]
  def lines(robots, folder) do
    for %{hardware?: true} = robot <- robots do
      "#{robot.id} has real drivers: its base on #{base_link(folder, robot)}, its camera's head on " <>
        camera_link(folder, robot)
    end
  end

  # From the fact sheet, as in the file of such a robot.
  defp base(:magellan),
    do: [
      conversions: [distance: 31_387.0, angle: 4654.2, range: 1474.0, ir_a: 4000.0, ir_b: -2.0]
    ]

  defp base(:atrv_mini) do
    [
      conversions: [distance: 190_000.0, angle: 60_000.0, range: 1476.0],
      bumpers: [count: 0],
      power_offset: 1.2
    ]
  end

  # The field of view of the pictures is that of the profile as long as the camera does not zoom.
  defp lens(%{camera: %{field_of_view: wide}}), do: {wide / 11, wide}

  defp base_link(folder, %{id: id}), do: Path.join(folder, "#{id}.base")
  defp camera_link(folder, %{id: id}), do: Path.join(folder, "#{id}.camera")
end
