defmodule Robot.Percept.Sighting do
  @moduledoc """
  Computes a direction and a place from a blob in a picture: pinhole camera, upright landmarks.
  Pure.

  By the time a picture is evaluated, the robot may have turned. So `of/3` first converts the
  direction to the map frame with the pose at exposure, and then to the body frame with the
  present pose.
  """
  alias Hal.Pose
  alias Robot.Percept
  alias Vision.Blob

  @typedoc """
  What the camera shows of one coloured object. `bearing` is relative to the body now, left
  positive; `direction` is in the map frame, `nil` without a pose. Both are in radians; `distance`
  is in metres, `nil` if it is unknown.
  """
  @type t :: %{
          bearing: float(),
          direction: float() | nil,
          distance: float() | nil,
          share: float(),
          at_ms: integer()
        }

  # Boxes up to this many pixels apart count as touching, because the border between two colours
  # belongs to neither.
  @touch 3
  # A clipped blob that covers more of the picture than this is too near to be measured.
  @too_near_share 0.2

  @doc "The sighting of the largest blob of a colour (`nil`: of any), or `nil`; see `largest/3`."
  @spec of(Percept.t(), String.t() | nil, float()) :: t() | nil
  def of(percept, colour, min_share \\ 0.0) do
    with %Blob{} = blob <- largest(percept, colour, min_share) do
      picture = percept.detections
      seen = bearing(blob, picture.pan, field_of_view(percept))
      exposed = picture.pose || percept.pose
      direction = exposed && Pose.wrap(exposed.heading + seen)

      %{
        bearing:
          if(direction && percept.pose,
            do: Pose.wrap(direction - percept.pose.heading),
            else: seen
          ),
        direction: direction,
        distance:
          if(blob.clipped? and blob.share > @too_near_share, do: nil, else: blob.distance),
        share: blob.share,
        at_ms: picture.at_ms
      }
    end
  end

  @doc """
  The direction of a blob's centre seen from the robot's body, in radians, left positive: the sum
  of the camera's pan and the angle within the picture.

      iex> blob = %Vision.Blob{colour: "Y", area: 100, share: 0.01, x: 159.5, y: 1.0, left: 0, top: 0,
      ...>   right: 1, bottom: 1, width: 320, height: 240}
      iex> Robot.Percept.Sighting.bearing(blob, 0.25, 1.0)
      0.25
  """
  @spec bearing(Blob.t(), pan :: float(), field_of_view :: float()) :: float()
  def bearing(%Blob{x: x, width: width}, pan, field_of_view) do
    focal = width / 2 / :math.tan(field_of_view / 2)
    Pose.wrap(pan + :math.atan(((width - 1) / 2 - x) / focal))
  end

  @doc """
  The place of a blob at `distance` (metres) in direction `bearing`, seen from `pose`.

      iex> {x, y} = Robot.Percept.Sighting.place(Hal.Pose.new(1, 0, 0), 0.0, 2.0)
      iex> {x, y}
      {3.0, 0.0}
  """
  @spec place(Pose.t(), float(), float()) :: Pose.point()
  def place(%Pose{} = pose, bearing, distance),
    do:
      Pose.place(pose, {
        distance * :math.cos(bearing),
        distance * :math.sin(bearing)
      })

  @doc """
  The distance of a blob, or `nil` if it cannot be estimated: the colour has no constant, the
  picture's border clips the blob, or something of another colour may hide a part of it (boxes
  that touch).
  """
  @spec distance(Blob.t(), [Blob.t()]) :: float() | nil
  def distance(%Blob{clipped?: true}, _blobs), do: nil

  def distance(%Blob{} = blob, blobs), do: if(hidden?(blob, blobs), do: nil, else: blob.distance)

  @doc "Whether something of another colour may hide a part of the blob: their boxes touch."
  @spec hidden?(Blob.t(), [Blob.t()]) :: boolean()
  def hidden?(%Blob{} = blob, blobs),
    do: Enum.any?(blobs, &(&1.colour != blob.colour and touch?(&1, blob)))

  defp touch?(a, b) do
    a.left <= b.right + @touch and b.left <= a.right + @touch and a.top <= b.bottom + @touch and
      b.top <= a.bottom + @touch
  end

  @doc """
  The width (in pixels) of an upright cylinder of this radius, whose axis is at this distance
  (metres), in a picture of this width and field of view (radians); `nil` from inside the
  cylinder.

      iex> round(Robot.Percept.Sighting.width(0.2, 1.0, 320, :math.pi() / 3))
      113
  """
  @spec width(radius :: float(), distance :: float(), pos_integer(), float()) :: float() | nil
  def width(radius, distance, picture, field_of_view) when distance > radius do
    focal = picture / 2 / :math.tan(field_of_view / 2)
    2 * focal * :math.tan(:math.asin(radius / distance))
  end

  def width(_radius, _distance, _picture, _field_of_view), do: nil

  @doc "The distance of an upright cylinder of this radius (metres) with the width of this blob."
  @spec distance_by_width(Blob.t(), radius :: float(), field_of_view :: float()) :: float()
  def distance_by_width(%Blob{} = blob, radius, field_of_view) do
    focal = blob.width / 2 / :math.tan(field_of_view / 2)
    radius / :math.sin(:math.atan((blob.right - blob.left + 1) / 2 / focal))
  end

  @doc """
  The horizontal field of view of the percept's picture: as recorded with the picture, else as the
  pan-tilt unit reports it, else as in the profile.
  """
  @spec field_of_view(Percept.t()) :: float()
  def field_of_view(%Percept{detections: %{field_of_view: angle}}) when angle != nil, do: angle
  def field_of_view(%Percept{ptz: %{field_of_view: angle}}), do: angle
  def field_of_view(%Percept{profile: profile}), do: profile.camera.field_of_view

  @doc """
  The largest blob of a colour (`nil`: of any) with at least this share of the picture; `nil`
  without one, or without a fresh picture. Among equally large blobs the topmost counts, then the
  leftmost.
  """
  @spec largest(Percept.t(), String.t() | nil, float()) :: Blob.t() | nil
  def largest(percept, colour, min_share \\ 0.0)
  def largest(%Percept{detections: nil}, _colour, _min_share), do: nil

  def largest(%Percept{detections: %{blobs: blobs}}, colour, min_share) do
    blobs
    |> Enum.filter(&(&1.share >= min_share and colour in [nil, &1.colour]))
    |> Enum.max_by(&{&1.area, -&1.top, -&1.left}, fn -> nil end)
  end
end
