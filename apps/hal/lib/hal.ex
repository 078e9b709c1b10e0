defmodule Hal do
  @moduledoc """
  Speaks with the devices of a robot: wheels with their sonars, bumpers and battery, a pan-tilt unit, a camera.

  A driver is a module with one of three behaviours (`Hal.Drive`, `Hal.Ptz`, `Hal.Camera`); the process round any driver is
  `Hal.Device`, which opens it, retries with back-off, watches over it, and hands its readings to its sinks. Units are metres,
  radians and seconds; x is ahead, y to the left, and angles turn to the left.

  Where a robot is after a metre ahead and a metre to the left of where it stood:

      iex> Hal.Pose.compose(Hal.Pose.new(2, 0, 0), Hal.Pose.new(1, 1, 0)) |> Hal.Pose.point()
      {3.0, 1.0}

  The body of a robot is a profile:

      iex> profile = Hal.Profile.magellan()
      iex> {profile.name, profile.radius > 0.18, length(profile.sonars)}
      {:magellan, true, 16}

  The processes of one robot's devices, each with its line:

      Robot.Devices (one_for_one)
      |-- Hal.Device :drive     Hal.RFlex.Driver      -- Hal.Serial -- /dev/ttyS0
      |-- Hal.Device :ptz       Hal.Visca.Driver      -- Hal.Serial -- /dev/ttyS1
      `-- Hal.Device :camera    Hal.Camera.FFmpeg     -- ffmpeg     -- /dev/video0

  Go on with `Hal.Device`, then with `docs/extending.md`, which adds a driver. `Hal.Options` is the one checker of options,
  `Hal.Profile` the bodies of the robots.
  """
end
