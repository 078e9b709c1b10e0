defmodule Robot.File.WarningsTest do
  use ExUnit.Case, async: true
  alias Robot.File.Warnings

  doctest Warnings

  defp warnings(serial) do
    robot = %Robot.File{
      id: :mag1,
      profile: Hal.Profile.magellan(),
      start: Hal.Pose.new(0, 0),
      drive: {Some.Drive, [port: "/dev/ttyS0", serial: serial]}
    }

    Warnings.lines(robot, fn _device -> true end)
  end

  test "a line without last words is told" do
    assert ["drive.serial.module: Hal.Serial.Circuits says no last words" <> rest] =
             warnings(module: Hal.Serial.Circuits)

    assert rest =~ "the wheels go on; Hal.Serial.Native is usual"
  end

  test "what is no serial line, or has no base behind it, is told" do
    robot = %Robot.File{
      id: :mag1,
      profile: Hal.Profile.magellan(),
      start: Hal.Pose.new(0, 0),
      drive: {Some.Drive, [port: "ttyS7"]}
    }

    told = fn kind ->
      Warnings.lines(robot, &(&1 == "/dev/ttyS7"), fn "/dev/ttyS7" -> kind end)
    end

    assert ["ttyS7 has no hardware behind it here" <> _] = told.(:no_hardware)
    assert ["ttyS7 is a console of this machine" <> _] = told.(:console)
    assert ["ttyS7 is a plain file here" <> _] = told.(:regular)
    assert told.(:device) == [] and told.(:other) == []

    # The ports of this machine, where it has any.
    for folder <- Path.wildcard("/sys/class/tty/ttyS*"),
        port = Path.join("/dev", Path.basename(folder)),
        File.exists?(port) do
      dead? = File.read(folder <> "/type") == {:ok, "0\n"}
      console? = File.read(folder <> "/console") == {:ok, "Y\n"}
      report = Robot.File.Summary.report("f", %{robot | drive: {Some.Drive, [port: port]}})
      assert Enum.any?(report, &(&1 =~ "WARNING")) == (dead? or console?)
    end
  end

  test "the usual line is not, and a driver's own options may be anything" do
    for serial <- [[], [module: Hal.Serial.Native], [:raw], "8N1", nil, %{module: 1}],
        do: assert(warnings(serial) == [])
  end
end
