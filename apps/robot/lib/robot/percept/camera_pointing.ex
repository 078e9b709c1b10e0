defmodule Robot.Percept.CameraPointing do
  @moduledoc """
  Where to turn the camera so that it looks at something while the body turns under it. Pure.

  A command is for the tick that follows; by its end a body that turns by 0.4 rad/s has taken the
  camera along by more than 2 degrees. So the turn is fed forward: the camera is told to look where
  the thing will be then.
  """
  alias Hal.Odometry
  alias Robot.Percept

  # One tick, in seconds.
  @ahead_s 0.1

  @doc """
  The pan (radians, left positive) for a thing that now is in direction `bearing` from the body,
  within what the camera can.

      iex> percept = %Robot.Percept{robot: :mag1, at_ms: 0, profile: Hal.Profile.magellan(),
      ...>   odometry: %Hal.Odometry{pose: Hal.Pose.new(0, 0), twist: Hal.Twist.new(0.0, 0.5)}}
      iex> Robot.Percept.CameraPointing.pan(0.25, percept)
      0.2
      iex> Robot.Percept.CameraPointing.pan(3.0, percept) == Hal.Profile.magellan().camera.max_pan
      true
  """
  @spec pan(bearing :: float(), Percept.t()) :: float()
  def pan(bearing, %Percept{profile: profile} = percept) do
    limit = profile.camera.max_pan
    (bearing - @ahead_s * turn(percept)) |> max(-limit) |> min(limit)
  end

  @doc "Whether the camera can look in this direction from the body."
  @spec within?(bearing :: float(), Percept.t()) :: boolean()
  def within?(bearing, %Percept{profile: profile}), do: abs(bearing) <= profile.camera.max_pan

  defp turn(%Percept{odometry: %Odometry{twist: twist}}), do: twist.turn
  defp turn(_percept), do: 0.0
end
