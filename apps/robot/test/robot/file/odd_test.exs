defmodule Robot.File.OddTest do
  use ExUnit.Case, async: true
  alias Robot.File.Odd

  doctest Odd

  defp warnings(serial) do
    robot = %Robot.File{
      id: :mag1,
      profile: Hal.Profile.magellan(),
      start: Hal.Pose.new(0, 0),
      drive: {Some.Drive, [port: "/dev/ttyS0", serial: serial]}
    }

    Odd.lines(robot, fn _device -> true end)
  end

  test "a line without last words is told" do
    assert ["drive.serial.module: Hal.Serial.Circuits says no last words" <> rest] =
             warnings(module: Hal.Serial.Circuits)

    assert rest =~ "the wheels go on; Hal.Serial.Native is usual"
  end

  test "the usual line is not, and a driver's own options may be anything" do
    for serial <- [[], [module: Hal.Serial.Native], [:raw], "8N1", nil, %{module: 1}],
        do: assert(warnings(serial) == [])
  end
end
