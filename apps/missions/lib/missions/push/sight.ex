defmodule Missions.Push.Sight do
  @moduledoc "Takes from a picture what it shows of a box on the floor: `t:Missions.Push.Estimate.sighting/0`. Pure."
  alias Hal.Pose
  alias Missions.Push.{Box, Estimate}
  alias Robot.Percept
  alias Robot.Percept.{Ground, Sighting}

  # 95 of 100 errors of a pose are within so many standard deviations.
  @radius 2.45
  @touch 3
  # The foot of what is as near as this is out of the picture.
  @near 0.8

  @doc """
  What is seen of the largest blob of a colour, or, if its foot is out of the picture, about where it is; `nil` where there is none, or the robot does
  not know where it is. An edge that a robot stands before is `nil`, as one at the border of the picture; so is the nearest corner then, which may be
  there. Where the box is `believed` to be tells whether a robot beside it in the picture stands before an edge, or behind it.
  """
  @spec box(Percept.t(), String.t(), {Pose.t(), Box.size()} | nil) ::
          Estimate.sighting() | {:near, Pose.point()} | nil
  def box(%Percept{detections: nil}, _colour, _believed), do: nil
  def box(%Percept{pose: nil}, _colour, _believed), do: nil
  def box(%Percept{uncertainty: %{lost?: true}}, _colour, _believed), do: nil

  def box(%Percept{detections: picture} = percept, colour, believed) do
    with nil <- Percept.astray(percept),
         %{blob: blob, bearing: bearing} <- Sighting.largest(percept, colour) do
      pose = picture.pose || percept.pose

      if blob.bottom < blob.height - 1,
        do: seen(percept, pose, blob, believed),
        else: {:near, Sighting.place(pose, bearing, @near)}
    else
      _astray_or_without -> nil
    end
  end

  defp seen(%{detections: %{blobs: blobs, pan: pan}} = percept, pose, blob, believed) do
    view = Sighting.field_of_view(percept)
    axis = Pose.wrap(pose.heading + pan)
    others = Enum.filter(blobs, &(&1.colour != blob.colour and beside?(&1, blob)))
    {far_left, far_right} = depths(believed, Pose.point(pose), axis)
    before? = fn other, depth -> depth == nil or (foot(other, percept, view) || 0.0) < depth end
    edge = fn column -> Pose.wrap(axis + angle(column, blob.width, view)) end

    left? =
      blob.left > 0 and not Enum.any?(others, &(&1.left <= blob.left and before?.(&1, far_left)))

    right? =
      blob.right < blob.width - 1 and
        not Enum.any?(others, &(&1.right >= blob.right and before?.(&1, far_right)))

    near = foot(blob, percept, view)
    under? = Enum.any?(others, &(&1.bottom >= blob.bottom))

    %{
      at: Pose.point(pose),
      axis: axis,
      left: if(left?, do: edge.(blob.left - 0.5)),
      right: if(right?, do: edge.(blob.right + 0.5)),
      near: if(left? and right? and not under?, do: near),
      sd: spread(percept, :radius) / @radius,
      sd_heading: spread(percept, :heading)
    }
  end

  # How far ahead the corners at the edges are.
  defp depths(nil, _at, _axis), do: {nil, nil}

  defp depths({box, size}, {x, y} = at, axis) do
    {left, right, _near} = Box.edges(box, size, at, axis)
    ahead = fn {cx, cy} -> (cx - x) * :math.cos(axis) + (cy - y) * :math.sin(axis) end
    {ahead.(left), ahead.(right)}
  end

  # How far ahead a blob stands on the floor.
  defp foot(blob, %{profile: profile, detections: %{tilt: tilt}}, view) do
    with {range, _sd} <- Ground.range(blob, profile.camera, view, 0.0, tilt), do: range
  end

  defp beside?(a, b) do
    a.left <= b.right + @touch and b.left <= a.right + @touch and a.top <= b.bottom + @touch and
      b.top <= a.bottom + @touch
  end

  defp angle(column, width, view) do
    focal = width / 2 / :math.tan(view / 2)
    :math.atan(((width - 1) / 2 - column) / focal)
  end

  defp spread(%{uncertainty: %{} = uncertainty}, key), do: Map.fetch!(uncertainty, key)
  defp spread(_percept, _key), do: 0.0
end
