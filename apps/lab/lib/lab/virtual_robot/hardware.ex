defmodule Lab.VirtualRobot.Hardware do
  @moduledoc """
  Gives robots of a simulated fleet whose bodies name a controller (`rflex` or `board` of `Hal.Profile`) the drivers of real
  ones: each has a base, a head if its camera turns, and its lidar, emulated on pseudo-terminals whose links are in the run's folder
  (`mag1.base`, `mag1.camera`, `burger1.scan`), with the robot's body in the world behind them.

      supervisor (one_for_one: a device that crashes was, in effect, switched off and on)
      `-- Sim.Emulator   one to three for each such robot
  """
  alias Sim.{Device, Emulator}
  alias Sim.Emulator.{Lds, RFlexController, RPLidar, ViscaCamera}

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
    base = emulator({id, :base}, base(profile), link(folder, robot, "base"), {Device.Drive, body})

    head =
      if head?(profile),
        do: [
          emulator(
            {id, :camera},
            {ViscaCamera, lens: lens(profile)},
            link(folder, robot, "camera"),
            {Device.Ptz, body}
          )
        ],
        else: []

    [base | head] ++ lidars(robot, body, folder)
  end

  defp lidars(%{id: id, profile: %{scan: %{model: model}}} = robot, body, folder)
       when model != nil do
    core = if model == :rplidar, do: {RPLidar, []}, else: {Lds, model: model}
    [emulator({id, :scan}, core, link(folder, robot, "scan"), {Device.Scan, body})]
  end

  defp lidars(_robot, _body, _folder), do: []

  # Its emulator.
  defp base(%{rflex: rflex} = profile) when rflex != nil,
    do: {RFlexController, kind: rflex, sonar_max: profile.sonar_max, ir_max: profile.ir_max}

  defp base(%{board: :kobuki}), do: {Emulator.Kobuki, []}
  defp base(%{board: :create}), do: {Emulator.Create, []}
  defp base(%{board: :turtlebot3_burger}), do: {Emulator.TurtleBot3, model: :burger}
  defp base(%{board: :turtlebot3_waffle}), do: {Emulator.TurtleBot3, model: :waffle}
  defp base(%{board: :arduino}), do: {Emulator.Arduino, []}

  # A camera that turns.
  defp head?(%{camera: nil}), do: false
  defp head?(%{camera: camera}), do: camera.max_pan > 0 or camera.max_tilt > 0

  defp emulator(id, core, link, body) do
    %{id: id, start: {Emulator, :start_link, [[core: core, link: link, body: body]]}}
  end

  @doc """
  The devices of such a robot in place of simulated ones, drive and camera head; and, because its wheels count from
  zero when its driver starts again, the file by which it knows that it has left its start pose (`Robot.Departure`).
  """
  @spec drivers(robot(), Path.t()) :: keyword()
  def drivers(%{profile: profile} = robot, folder) do
    {driver, options} = driver(profile)
    port = link(folder, robot, "base")

    head =
      if head?(profile),
        do: [ptz: {Hal.Visca.Driver, port: link(folder, robot, "camera"), lens: lens(profile)}],
        else: []

    [
      drive: {driver, [port: port, profile: profile] ++ options},
      departure_file: Path.join(folder, "#{robot.id}.departed")
    ] ++ head
  end

  defp driver(%{rflex: rflex}) when rflex != nil, do: {Hal.RFlex.Driver, conversions(rflex)}
  defp driver(%{board: :kobuki}), do: {Hal.Kobuki.Driver, []}
  defp driver(%{board: :create}), do: {Hal.Create.Driver, []}
  defp driver(%{board: :turtlebot3_burger}), do: {Hal.TurtleBot3.Driver, model: :burger}
  defp driver(%{board: :turtlebot3_waffle}), do: {Hal.TurtleBot3.Driver, model: :waffle}
  defp driver(%{board: :arduino}), do: {Hal.Arduino.Driver, []}

  @doc "The driver of such a robot's lidar."
  @spec scan(robot(), Path.t()) :: keyword()
  def scan(%{profile: %{scan: %{model: model}}} = robot, folder) do
    port = [port: link(folder, robot, "scan")]

    if model == :rplidar,
      do: [scan: {Hal.RPLidar.Driver, port}],
      else: [scan: {Hal.Lds.Driver, port ++ [model: model]}]
  end

  @doc "Where their serial lines are, for people, one line per robot."
  @spec lines([robot()], Path.t()) :: [String.t()]
  def lines(robots, folder) do
    words = %{"base" => "its base", "camera" => "its camera's head", "scan" => "its lidar"}

    for %{hardware?: true} = robot <- robots do
      lines = for {what, link} <- links(robot, folder), do: "#{words[what]} on #{link}"
      "#{robot.id} has real drivers: #{Enum.join(lines, ", ")}"
    end
  end

  @doc "The links to the lines of such a robot: `base`, and `camera` and `scan` where it has them."
  @spec links(robot(), Path.t()) :: [{what :: String.t(), Path.t()}]
  def links(%{profile: profile} = robot, folder) do
    lidar? = match?(%{model: model} when model != nil, profile.scan)

    for {what, true} <- [{"base", true}, {"camera", head?(profile)}, {"scan", lidar?}],
        do: {what, link(folder, robot, what)}
  end

  # From the fact sheet, as in the file of such a robot.
  defp conversions(:magellan),
    do: [
      conversions: [distance: 31_387.0, angle: 4654.2, range: 1474.0, ir_a: 4000.0, ir_b: -2.0]
    ]

  defp conversions(:atrv_mini) do
    [
      conversions: [distance: 190_000.0, angle: 60_000.0, range: 1476.0],
      bumpers: [count: 0],
      power_offset: 1.2
    ]
  end

  # The field of view of the pictures is that of the profile as long as the camera does not zoom.
  defp lens(%{camera: %{field_of_view: wide}}), do: {wide / 11, wide}

  defp link(folder, %{id: id}, what), do: Path.join(folder, "#{id}.#{what}")
end
