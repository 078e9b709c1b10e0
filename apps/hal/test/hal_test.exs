defmodule HalTest do
  use ExUnit.Case, async: true
  doctest Hal.Pose
  doctest Hal.Twist
  doctest Hal.Wheels
  doctest Hal.Frame
  doctest Hal.Profile
  doctest Hal.Suggest
  doctest Hal.Build
end
