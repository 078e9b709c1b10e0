defmodule HalTest do
  use ExUnit.Case, async: true
  doctest Hal
  doctest Hal.Pose
  doctest Hal.RobotName
  doctest Hal.Twist
  doctest Hal.Drive.Wheels
  doctest Hal.Frame
  doctest Hal.Profile
  doctest Hal.Options.Suggest
  doctest Hal.Options.ModuleLookup
end
