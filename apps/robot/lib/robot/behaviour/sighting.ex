defmodule Robot.Behaviour.Sighting do
  @moduledoc """
  What the camera says about one coloured thing: its direction seen from the body, and its
  distance. Pure.

  A picture is old when it is looked at: the robot has turned meanwhile. So the direction is
  first taken to the map by the pose at exposure, and then seen from the present pose.
  """
  alias Hal.Pose
  alias Robot.Percept

  @type t :: %{
          bearing: float(),
          direction: float() | nil,
          distance: float() | nil,
          share: float(),
          at_ms: integer() | nil
        }

  @doc """
  The largest blob of a colour with at least this share of the picture; `nil` without one, or
  without a fresh picture. `bearing` is relative to the body now, left positive; `direction` is
  in the map frame, `nil` without a pose.
  """
  @spec largest(Percept.t(), String.t() | nil, float()) :: t() | nil
  def largest(%Percept{blobs: nil}, _colour, _min_share), do: nil

  def largest(%Percept{blobs: blobs} = percept, colour, min_share) do
    blobs
    |> Enum.filter(&(&1.share >= min_share and (colour == nil or &1.colour == colour)))
    |> Enum.max_by(& &1.share, fn -> nil end)
    |> sighting(percept)
  end

  defp sighting(nil, _percept), do: nil

  defp sighting(blob, percept) do
    seen = percept.blobs_pan + angle(blob.x, percept)
    then_pose = percept.blobs_pose || percept.pose
    direction = then_pose && Pose.wrap(then_pose.heading + seen)

    bearing = if direction && percept.pose, do: direction - percept.pose.heading, else: seen

    %{
      bearing: Pose.wrap(bearing),
      direction: direction,
      distance: if(blob.clipped? and blob.share > 0.2, do: nil, else: blob.distance),
      share: blob.share,
      at_ms: percept.blobs_at_ms
    }
  end

  # Pixel centres are whole numbers, so the optical axis runs through (width - 1) / 2.
  defp angle(x, %Percept{profile: profile, ptz: ptz}) do
    %{width: width, field_of_view: nominal} = profile.camera
    field_of_view = if ptz, do: ptz.field_of_view, else: nominal
    focal = width / 2 / :math.tan(field_of_view / 2)
    :math.atan(((width - 1) / 2 - x) / focal)
  end
end
