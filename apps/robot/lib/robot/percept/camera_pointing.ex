defmodule Robot.Percept.CameraPointing do
  @moduledoc """
  Computes where to point the camera so that it looks at an object while the body turns. Pure.

  A command takes effect during the next tick; in that time a body that turns at 0.4 rad/s moves
  the camera by more than 2 degrees. So the turn is fed forward: the camera points to where the
  object will be, relative to the body, at the end of the tick.
  """
  alias Hal.Odometry
  alias Robot.Percept

  # One tick, in seconds.
  @ahead_s 0.1

  @doc """
  The pan (radians, left positive) for an object that is now in direction `bearing` from the body,
  limited to the camera's pan range; 0 of a body without a camera.

      iex> percept = %Robot.Percept{robot: :mag1, at_ms: 0, profile: Hal.Profile.magellan(),
      ...>   odometry: %Hal.Odometry{pose: Hal.Pose.new(0, 0), twist: Hal.Twist.new(0.0, 0.5)}}
      iex> Robot.Percept.CameraPointing.pan(0.25, percept)
      0.2
      iex> Robot.Percept.CameraPointing.pan(3.0, percept) == Hal.Profile.magellan().camera.max_pan
      true
  """
  @spec pan(bearing :: float(), Percept.t()) :: float()
  def pan(bearing, %Percept{profile: profile} = percept) do
    limit = reach(profile)
    (bearing - @ahead_s * turn(percept)) |> max(-limit) |> min(limit)
  end

  @doc "Whether this direction from the body is within the camera's pan range."
  @spec within?(bearing :: float(), Percept.t()) :: boolean()
  def within?(bearing, %Percept{profile: profile}), do: abs(bearing) <= reach(profile)

  @doc "How far the camera can be panned to either side (radians); 0 of a body without one."
  @spec reach(Hal.Profile.t()) :: float()
  def reach(%{camera: nil}), do: 0.0
  def reach(%{camera: camera}), do: camera.max_pan

  defp turn(%Percept{odometry: %Odometry{twist: twist}}), do: twist.turn
  defp turn(_percept), do: 0.0
end
