defmodule Robot.Percept.Sighting do
  @moduledoc """
  Computes a direction and a place from a blob in a picture: pinhole camera, upright landmarks.
  Pure.

  By the time a picture is evaluated, the robot may have turned. So `of/3` first converts the
  direction to the map frame with the pose at exposure, and then to the body frame with the
  present pose.

  How far an object is, is three questions:

  | answer | for |
  |---|---|
  | the `distance` of `of/3`: rough, but there, also if a border clips the blob or something hides a part of it | driving to it and turning to it |
  | `distance/2`: right, or `nil` | a measurement that corrects a pose |
  | `distance/4`: the same, and by its width where only foot or top are out of the picture | the place of an object whose width is known |
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

  @typedoc "The largest blob of a colour, and its direction seen from the body when the picture was taken."
  @type object :: %{blob: Blob.t(), bearing: float()}
  @type objects :: %{(colour :: String.t()) => object()}

  # Boxes up to this many pixels apart count as touching, because the border between two colours
  # belongs to neither.
  @touch 3
  # A blob with less than this share of the width that it should have is not whole.
  @narrow 0.8
  # A clipped blob that covers more of the picture than this is too near to be measured.
  @too_near_share 0.2

  @doc "The sighting of the largest blob of a colour (`nil`: of any), or `nil`; see `largest/3`."
  @spec of(Percept.t(), String.t() | nil, float()) :: t() | nil
  def of(percept, colour, min_share \\ 0.0) do
    with %{blob: blob, bearing: seen} <- largest(percept, colour, min_share) do
      picture = percept.detections
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

  @doc """
  The same of an upright object of this radius (metres), in a picture with this field of view: the width of a pole stays
  right if its foot or top is out of the picture.
  """
  @spec distance(Blob.t(), [Blob.t()], radius :: float(), field_of_view :: float()) ::
          float() | nil
  def distance(
        %Blob{clipped?: true, left: left, right: right, width: width} = blob,
        blobs,
        radius,
        view
      )
      when left > 0 and right < width - 1,
      do: unless(hidden?(blob, blobs), do: distance_by_width(blob, radius, view))

  def distance(blob, blobs, _radius, _view), do: distance(blob, blobs)

  @doc """
  Whether something without a colour, such as a wall, hides a part of an upright object of this radius (metres), in a picture with
  this field of view: its blob is narrower by a fifth, and a pixel, than such a one is at the distance that its area says.

      iex> whole = %Vision.Blob{colour: "Y", area: 1280, share: 0.017, x: 159.5, y: 120.0, left: 142, right: 176, top: 60,
      ...>   bottom: 208, width: 320, height: 240, distance: 2.4}
      iex> half = %{whole | left: 160, distance: 3.4}
      iex> for blob <- [whole, half], do: Robot.Percept.Sighting.narrow?(blob, 0.15, :math.pi() / 3)
      [false, true]
  """
  @spec narrow?(Blob.t(), radius :: float(), field_of_view :: float()) :: boolean()
  def narrow?(%Blob{distance: nil}, _radius, _field_of_view), do: false

  def narrow?(%Blob{} = blob, radius, field_of_view) do
    whole = width(radius, blob.distance, blob.width, field_of_view)
    whole != nil and blob.right - blob.left + 2 < @narrow * whole
  end

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
  The percept with the largest blob of each colour, which localiser, behaviours and mission all ask for.
  """
  @spec note(Percept.t()) :: Percept.t()
  def note(%Percept{} = percept), do: %{percept | objects: objects(%{percept | objects: nil})}

  defp objects(%Percept{detections: nil}), do: %{}
  defp objects(%Percept{objects: %{} = objects}), do: objects

  defp objects(%Percept{detections: %{blobs: blobs, pan: pan}} = percept) do
    view = field_of_view(percept)

    for {colour, blob} <- Enum.reduce(blobs, %{}, &larger/2),
        into: %{},
        do: {colour, %{blob: blob, bearing: bearing(blob, pan, view)}}
  end

  defp larger(%{colour: colour} = blob, largest) do
    case largest do
      %{^colour => other} ->
        if size(blob) > size(other), do: %{largest | colour => blob}, else: largest

      _none_yet ->
        Map.put(largest, colour, blob)
    end
  end

  defp size(%{area: area, top: top, left: left}), do: {area, -top, -left}

  @doc """
  The largest blob of a colour (`nil`: of any) with at least this share of the picture, with its direction; `nil`
  without one, or without a fresh picture. Among equally large blobs the topmost counts, then the
  leftmost.
  """
  @spec largest(Percept.t(), String.t() | nil, float()) :: object() | nil
  def largest(percept, colour, min_share \\ 0.0)

  def largest(percept, nil, min_share) do
    percept
    |> objects()
    |> Map.values()
    |> Enum.max_by(&size(&1.blob), fn -> nil end)
    |> at_least(min_share)
  end

  def largest(percept, colour, min_share), do: at_least(objects(percept)[colour], min_share)

  defp at_least(%{blob: %{share: share}} = object, min_share) when share >= min_share, do: object
  defp at_least(_small_or_none, _min_share), do: nil
end
