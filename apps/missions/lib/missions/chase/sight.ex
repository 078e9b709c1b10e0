defmodule Missions.Chase.Sight do
  @moduledoc """
  Computes where a ball on the floor is, from a picture: by the lowest row of its blob (`Robot.Percept.Ground`), or by its width where that row is
  out of the picture. Pure; metres in the map frame.
  """
  alias Hal.Pose
  alias Robot.Percept
  alias Robot.Percept.{Ground, Sighting}

  # What a width is uncertain by, in pixels, a bearing, in radians, and any place, in metres.
  @width_sd 1.5
  @bearing_sd 0.02
  @floor_sd 0.03
  # A blob that is whole has between these shares of the width that it should have.
  @least 0.8
  @most 1.25
  # 95 of 100 errors of a pose are within so many standard deviations.
  @radius 2.45

  @doc """
  The middle of the largest ball of a colour and radius in a picture, and the variance of that along each axis (m2); `nil` where the picture
  shows none whole, or the robot does not know where it is.
  """
  @spec ball(Percept.t(), String.t(), float()) :: {Pose.point(), var :: float()} | nil
  def ball(%Percept{detections: nil}, _colour, _radius), do: nil
  def ball(%Percept{pose: nil}, _colour, _radius), do: nil
  def ball(%Percept{uncertainty: %{lost?: true}}, _colour, _radius), do: nil

  def ball(
        %Percept{detections: %{blobs: blobs, pan: pan, tilt: tilt} = picture} = percept,
        colour,
        radius
      ) do
    view = Sighting.field_of_view(percept)

    with %{blob: blob, bearing: bearing} <- Sighting.largest(percept, colour),
         true <-
           blob.left > 0 and blob.right < blob.width - 1,
         far = foot(blob, percept.profile.camera, view, Pose.wrap(bearing - pan), tilt, radius),
         false <- hidden?(blob, blobs, far, radius, view) do
      {_by, range, sd} = far
      place = Sighting.place(picture.pose || percept.pose, bearing, range)

      {place,
       sd * sd + square(range * @bearing_sd) + square(@floor_sd) + square(pose_sd(percept))}
    else
      _none -> nil
    end
  end

  defp foot(blob, camera, view, bearing, tilt, radius) do
    case Ground.range(blob, camera, view, bearing, tilt) do
      {range, sd} ->
        {:foot, range + radius, sd}

      nil ->
        range = Sighting.distance_by_width(blob, radius, view)
        {:width, range, @width_sd * range / (blob.right - blob.left + 1)}
    end
  end

  # What is in front of it hides a part of its width, or its foot, which then seems farther away than its width. Where the
  # foot is out of the picture, its width alone must do; then nothing that is as near may touch it.
  defp hidden?(blob, _blobs, {:foot, range, _sd}, radius, view) do
    whole = Sighting.width(radius, range, blob.width, view)
    wide = blob.right - blob.left + 1
    whole == nil or wide + 1 < @least * whole or wide - 1 > @most * whole
  end

  defp hidden?(blob, blobs, {:width, _range, _sd}, _radius, _view),
    do: Enum.any?(blobs, &(&1.bottom >= blob.bottom and Sighting.hidden?(blob, [&1])))

  defp pose_sd(%{uncertainty: %{radius: radius}}), do: radius / @radius
  defp pose_sd(_percept), do: 0.0

  defp square(x), do: x * x
end
