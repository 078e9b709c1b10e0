defmodule Robot.File.Warnings do
  @moduledoc """
  Warns of values in a robot file that are allowed but seldom intended. Most warnings name the
  key, and the usual value if there is one. A person should look at them before a robot of up to
  40 kg moves. Pure.
  """
  alias Hal.{Pose, Profile}
  alias Robot.File.Device
  alias Nav.Grid

  # The robots of the thesis reach full speed within 1 s.
  @slow_s 5.0
  @inwards :math.pi() / 2 + 0.1
  # A sensor nearer to the middle of the body than this may look in any direction.
  @middle_m 0.02
  # How far a sensor may be outside the body's radius without a warning.
  @beyond_m 0.005

  @doc """
  All warnings, one line each; `there?` reports whether a device exists on this machine, and `kind` what it is: the type of
  `File.Stat`, `:no_hardware` for a serial port without, `:console` for one that the system itself writes to.

      iex> robot = %Robot.File{id: :mag1, profile: Hal.Profile.magellan(), start: Hal.Pose.new(0, 0),
      ...>   drive: {Some.Drive, [port: "/dev/ttyS9"]}, limits: [max_turn_acceleration: 0.017]}
      iex> Robot.File.Warnings.lines(robot, fn _device -> false end)
      ["limits.max_turn_acceleration: with 0.017 rad/s2 it takes 59 s to turn at full speed; 1.0 is usual",
       "/dev/ttyS9 is not on this machine; it must be on the robot's"]
      iex> robot = %{robot | drive: {Some.Drive, [port: "/run/base"]}, limits: []}
      iex> Robot.File.Warnings.lines(robot, &(&1 == "/dev/base"))
      ["/run/base is not on this machine; it must be on the robot's"]
      iex> Robot.File.Warnings.lines(%{robot | drive: {Some.Drive, [port: "base"]}}, &(&1 == "/dev/base"))
      []
      iex> Robot.File.Warnings.lines(%{robot | drive: {Some.Drive, [port: "/tmp"]}}, fn _ -> true end, fn _ -> :directory end)
      ["/tmp is a directory here; a serial line is a device"]
      iex> Robot.File.Warnings.lines(%{robot | drive: {Some.Drive, [port: "ttyS0"]}}, fn _ -> true end, fn _ -> :no_hardware end)
      ["ttyS0 has no hardware behind it here; a USB adapter is /dev/ttyUSB0 or /dev/ttyACM0"]
  """
  @spec lines(Robot.File.t(), (Path.t() -> boolean()), (Path.t() -> atom())) :: [String.t()]
  def lines(%Robot.File{} = robot, there?, kind \\ fn _path -> :device end) do
    limits(robot) ++
      unseeing(robot) ++
      unscanned(robot) ++
      markless(robot) ++
      narrow(robot) ++
      drive(robot) ++
      words(robot.drive) ++
      poses(robot.profile) ++ devices(robot, there?) ++ strange(robot, there?, kind)
  end

  defp limits(%{profile: kind} = robot) do
    own = struct!(kind, robot.limits)

    Enum.filter(
      [
        gathers(own, kind, :max_acceleration, :max_linear, "m/s2", "drive"),
        gathers(own, kind, :max_turn_acceleration, :max_turn, "rad/s2", "turn")
      ],
      & &1
    )
  end

  defp gathers(own, kind, acceleration, speed, unit, doing) do
    value = Map.fetch!(own, acceleration)
    seconds = Map.fetch!(own, speed) / value

    if seconds > @slow_s,
      do:
        "limits.#{acceleration}: with #{value} #{unit} it takes #{round(seconds)} s to #{doing} " <>
          "at full speed; #{Map.fetch!(kind, acceleration)} is usual"
  end

  defp unseeing(%{profile: body}) do
    with line when line != nil <- blind(body),
         do: ["#{line}; a fence, and limits: [max_linear: 0.2] or less, are usual"],
         else: (nil -> [])
  end

  # The file may be checked on another machine than the robot's.
  defp markless(%{marks: nil}), do: []

  defp markless(%{marks: marks}) do
    case Vision.Marks.available(Keyword.get(marks, :family, :tag36h11)) do
      :ok -> []
      {:error, line} -> ["marks: #{line}; without it this robot sees none"]
    end
  end

  defp unscanned(%{scan: nil, profile: %{scan: scan, name: name}}) when scan != nil do
    [
      "scan: #{name} has a lidar, and no driver reads it: the robot will not drive; body: [scan: nil] is for one without"
    ]
  end

  defp unscanned(_robot), do: []

  @doc """
  What a body without sonars and lidar cannot do, on one line; `nil` for any other. Nothing slows it before what it does not see.

      iex> {:ok, create2} = Robot.File.Bodies.fetch("create2")
      iex> Enum.map([create2, %{create2 | bumpers: 0}, Hal.Profile.magellan()], &Robot.File.Warnings.blind/1)
      ["create2 has no ranges: it stops by its bumpers only, once it touches",
       "create2 has no ranges, and no bumpers: nothing stops it when it touches", nil]
  """
  @spec blind(Profile.t()) :: String.t() | nil
  def blind(%Profile{sonars: [], scan: nil, bumpers: 0, name: name}),
    do: "#{name} has no ranges, and no bumpers: nothing stops it when it touches"

  def blind(%Profile{sonars: [], scan: nil, name: name}),
    do: "#{name} has no ranges: it stops by its bumpers only, once it touches"

  def blind(_ranges), do: nil

  # The grid may say less than the map shows, by a cell.
  defp narrow(%{map: nil}), do: []

  defp narrow(%{map: map, start: start, profile: %{radius: radius}}) do
    room = Grid.clearance(map.grid, Pose.point(start)) + map.grid.cell

    if room < radius,
      do: [
        "start: by the map a wall is within #{metres(room)} m, and the body's radius is #{metres(radius)} m; a " <>
          "place where the body fits is usual"
      ],
      else: []
  end

  defp drive(robot) do
    case Device.judge(robot.drive, robot.profile) do
      nil -> []
      %{odd: odd} -> for line <- odd, do: "drive: " <> line
    end
  end

  # The driver that was named need not be ours, nor its options.
  defp words({_driver, options}) do
    with [_ | _] = serial <- options[:serial],
         true <- Keyword.keyword?(serial),
         Hal.Serial.Circuits <- serial[:module] do
      [
        "drive.serial.module: Hal.Serial.Circuits says no last words when the VM is killed, frozen or has crashed, " <>
          "and the wheels go on; Hal.Serial.Native is usual"
      ]
    else
      _other -> []
    end
  end

  defp poses(%Profile{} = body) do
    for {name, poses} <- [sonars: body.sonars, irs: body.irs],
        line <- [inwards(name, poses), alike(name, poses), beyond(poses, body.radius)],
        line != nil,
        do: "body.#{name}: " <> line
  end

  defp inwards(_name, poses) do
    case for {pose, n} <- Enum.with_index(poses, 1), inwards?(pose), do: n do
      [] -> nil
      numbers -> "#{numbers(numbers)} into the body; sensors usually look away from its middle"
    end
  end

  # Avoidance treats the body as a disc of this radius.
  defp beyond(poses, radius) do
    far_m = poses |> Enum.map(&Pose.distance({0.0, 0.0}, &1)) |> Enum.max(fn -> 0.0 end)

    if far_m > radius + @beyond_m,
      do:
        "the farthest is #{metres(far_m)} m from the middle, and the body's radius is #{metres(radius)} m; " <>
          "a body that holds its sensors is usual"
  end

  defp metres(value), do: :erlang.float_to_binary(value * 1.0, decimals: 3)

  defp inwards?(%Pose{x: x, y: y, heading: heading}) do
    :math.sqrt(x * x + y * y) > @middle_m and
      abs(Pose.wrap(heading - :math.atan2(y, x))) > @inwards
  end

  defp numbers([one]), do: "number #{one} looks"

  defp numbers(several) do
    more = length(several) - 8
    shown = several |> Enum.take(8) |> Enum.join(", ")
    "numbers #{shown}#{if more > 0, do: " and #{more} more"} look"
  end

  defp alike(_name, poses) do
    twice = length(poses) - length(Enum.uniq(poses))
    if twice > 0, do: "#{twice} of the #{length(poses)} poses are given twice; each has its own"
  end

  # A serial line may be anywhere, or a name in /dev; a source may be a file, a stream or a generator.
  defp paths(options) do
    case {options[:port], options[:source]} do
      {port, _source} when is_binary(port) -> [port]
      {_port, "/dev/" <> _ = source} -> [source]
      _neither -> []
    end
  end

  defp strange(robot, there?, kind) do
    for {_module, options} <- [robot.drive, robot.ptz, robot.scan],
        port = options[:port],
        is_binary(port),
        path = Enum.find([port, Path.expand(port, "/dev")], there?),
        why = unfit(kind.(path)),
        uniq: true,
        do: "#{port} #{why}"
  end

  defp unfit(:no_hardware),
    do: "has no hardware behind it here; a USB adapter is /dev/ttyUSB0 or /dev/ttyACM0"

  defp unfit(:console),
    do:
      "is a console of this machine, and the system's words would reach the device; see /proc/cmdline"

  defp unfit(:directory), do: "is a directory here; a serial line is a device"
  defp unfit(:regular), do: "is a plain file here; a serial line is a device"
  defp unfit(_device_or_other), do: nil

  defp devices(robot, there?) do
    named =
      for {_module, options} <- [robot.drive, robot.ptz, robot.camera, robot.scan],
          path <- paths(options),
          not there?.(path) and not there?.(Path.expand(path, "/dev")),
          do: path

    case Enum.uniq(named) do
      [] ->
        []

      [one] ->
        ["#{one} is not on this machine; it must be on the robot's"]

      several ->
        {last, first} = List.pop_at(several, -1)
        all = "#{Enum.join(first, ", ")} and #{last}"
        ["#{all} are not on this machine; they must be on the robot's"]
    end
  end
end
