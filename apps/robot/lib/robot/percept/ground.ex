defmodule Robot.Percept.Ground do
  @moduledoc """
  Computes how far what stands on the floor is, from the lowest row of its blob. Pure.

  The camera is a pinhole at height `h` (`mount_height`) that is tilted by `t`, upwards positive. A ray through the row `v` looks down by
  `a = atan((v - c) / f) - t`, with the middle row `c` and the focal length `f`, both in pixels. It meets the floor
  `h / tan(a)` ahead; beside the middle column, at the angle `b`, that is `h / tan(a) / cos(b)` away (Hartley and Zisserman,
  Multiple View Geometry, 2004, chapter 6, for a level floor).
  """
  alias Vision.Blob

  # What the lowest row of a blob is uncertain by, in pixels.
  @row_sd 0.7
  # The horizon is no floor.
  @least_angle 0.01

  @doc """
  The distance in metres from below the camera to the foot of what a blob shows, and its standard deviation; `nil` where the foot is out of the picture, or
  too near to the horizon. `bearing` is that of the blob in the picture, `tilt` that of the camera, in radians.

      iex> blob = %Vision.Blob{colour: "OrangeBall", area: 800, share: 0.01, x: 159.5, y: 190.0, left: 145, top: 170, right: 174,
      ...>   bottom: 202, width: 320, height: 240}
      iex> {range, sd} = Robot.Percept.Ground.range(blob, Hal.Profile.magellan().camera, :math.pi() / 3)
      iex> {Float.round(range, 2), Float.round(sd, 3)}
      {2.0, 0.017}
      iex> Robot.Percept.Ground.range(%{blob | bottom: 239}, Hal.Profile.magellan().camera, :math.pi() / 3)
      nil
  """
  @spec range(Blob.t(), map(), field_of_view :: float(), bearing :: float(), tilt :: float()) ::
          {metres :: float(), sd :: float()} | nil
  def range(%Blob{} = blob, %{mount_height: height}, field_of_view, bearing \\ 0.0, tilt \\ 0.0) do
    focal = blob.width / 2 / :math.tan(field_of_view / 2)
    # The border of the lowest pixel.
    row = blob.bottom + 0.5 - (blob.height - 1) / 2
    down = :math.atan(row / focal) - tilt

    if blob.bottom < blob.height - 1 and down > @least_angle do
      metres = height / :math.tan(down) / :math.cos(bearing)
      {metres, @row_sd * metres * metres / (height * focal)}
    end
  end
end
