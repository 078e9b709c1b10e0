defmodule Missions.Landmark.LandmarkTrack do
  @moduledoc false
  # Tracks what a robot knows about the landmark from its own camera: its apparent size, and its place (map
  # frame). Pure.
  alias Hal.Pose
  alias Robot.Percept
  alias Robot.Percept.Sighting

  @enforce_keys [:at_ms, :size_ppm, :bearing]
  defstruct @enforce_keys ++
              [distance: nil, place: nil, place_ms: nil, rough: nil, moving?: false]

  @typedoc """
  `distance` and `place` are measured, in metres. `rough` is where the landmark seems to be if it was seen in another
  direction than that place, and cannot be measured: a robot hides a part of it, or it is too near.
  """
  @type t :: %__MODULE__{
          at_ms: integer(),
          size_ppm: pos_integer(),
          bearing: float(),
          distance: float() | nil,
          place: Pose.point() | nil,
          place_ms: integer() | nil,
          rough: Pose.point() | nil,
          moving?: boolean()
        }

  # The weight of one picture in the estimate of the place (pictures come at 10 Hz), and the
  # deviation at which a new estimate starts.
  @gain 0.2
  @jump 0.6
  @moving 0.1

  # A clipped landmark that covers more of the picture is too near to be measured by its area.
  @too_near_share 0.2
  # Seen so far (radians) off the direction of its last place, it is not there any more.
  @aside 0.5
  # So far from where others say it is (metres, and per metre from which it was seen), it is somewhere else.
  @elsewhere 1.0
  @per_metre 0.25

  # Without a picture for so long a robot counts as one without a camera, however short its pictures stop otherwise.
  @blind_ms 5_000

  # An upright pole, in metres, and how much of that shows its colour: the edges of what is round are dark.
  @radius 0.15
  @shown 0.13

  @doc "The radius of the landmark, in metres."
  @spec radius() :: float()
  def radius, do: @radius

  @doc """
  The sight after one more percept; the old one stays if the landmark is not in the picture.
  """
  @spec update(t() | nil, Percept.t(), String.t()) :: t() | nil
  def update(old, %Percept{detections: nil}, _colour), do: old
  def update(old, %Percept{detections: %{pose: nil}}, _colour), do: old
  def update(%{at_ms: at_ms} = old, %Percept{detections: %{at_ms: at_ms}}, _colour), do: old

  def update(old, %Percept{detections: picture} = percept, colour) do
    case Sighting.largest(percept, colour) do
      nil ->
        old

      %{blob: blob, bearing: bearing} ->
        view = Sighting.field_of_view(percept)
        distance = Sighting.distance(blob, picture.blobs, @shown, view)
        seen = distance && Sighting.place(picture.pose, bearing, distance)
        place = smooth(old && old.place, seen)
        there? = seen != nil or (place != nil and toward?(picture.pose, bearing, place))
        about = if not there?, do: about(blob, view)

        %__MODULE__{
          at_ms: picture.at_ms,
          size_ppm: max(round(blob.share * 1_000_000), 1),
          bearing: Pose.bearing(percept.pose, Sighting.place(picture.pose, bearing, 5.0)),
          distance: distance,
          place: place,
          place_ms: if(seen, do: picture.at_ms, else: old && old.place_ms),
          rough: about && Sighting.place(picture.pose, bearing, about),
          moving?: seen != nil and place != nil and Pose.distance(seen, place) > @moving
        }
    end
  end

  @doc """
  Whether the place is certain: the landmark was seen within the last `ms`, in its full width, and
  stands still. The motion of a landmark that is clipped at the side cannot be seen.
  """
  @spec still?(t() | nil, integer(), pos_integer()) :: boolean()
  def still?(%{place_ms: place_ms, rough: nil, moving?: false}, now_ms, ms)
      when place_ms != nil,
      do: now_ms - place_ms <= ms

  def still?(_sight, _now_ms, _ms), do: false

  @doc "Whether the landmark was seen within the last `ms`."
  @spec fresh?(t() | nil, integer(), pos_integer()) :: boolean()
  def fresh?(nil, _now_ms, _ms), do: false
  def fresh?(%{at_ms: at_ms}, now_ms, ms), do: now_ms - at_ms <= ms

  @doc """
  Where the landmark is, as far as this robot has seen (map frame, metres).

      iex> sight = %Missions.Landmark.LandmarkTrack{at_ms: 0, size_ppm: 9, bearing: 0.0, place: {2.0, 0.0}}
      iex> for sight <- [sight, %{sight | rough: {0.5, 0.5}}, nil], do: Missions.Landmark.LandmarkTrack.where(sight)
      [{2.0, 0.0}, {0.5, 0.5}, nil]
  """
  @spec where(t() | nil) :: Pose.point() | nil
  def where(nil), do: nil
  def where(%{rough: rough, place: place}), do: rough || place

  @doc """
  Whether the landmark was seen from here somewhere else than there (map frame, metres; `nil`: nobody says where it is).

      iex> sight = %Missions.Landmark.LandmarkTrack{at_ms: 0, size_ppm: 9, bearing: 0.0, place: {8.0, 0.0}}
      iex> for there <- [{9.5, 0.0}, {10.5, 0.0}, nil],
      ...>   do: Missions.Landmark.LandmarkTrack.elsewhere?(sight, Hal.Pose.new(0, 0), there)
      [false, true, true]
  """
  @spec elsewhere?(t(), Pose.t(), Pose.point() | nil) :: boolean()
  def elsewhere?(sight, pose, there) do
    case where(sight) do
      nil ->
        false

      _place when there == nil ->
        true

      place ->
        Pose.distance(place, there) > max(@elsewhere, @per_metre * Pose.distance(pose, place))
    end
  end

  @doc "Whether a robot that had its last picture then has had none for so long that no robot should count on its camera."
  @spec blind?(pictured_ms :: integer() | nil, now_ms :: integer()) :: boolean()
  def blind?(nil, _now_ms), do: false
  def blind?(pictured_ms, now_ms), do: now_ms - pictured_ms >= @blind_ms

  defp about(%{clipped?: true, share: share} = blob, view) when share > @too_near_share,
    do: Sighting.distance_by_width(blob, @shown, view)

  defp about(blob, _view), do: blob.distance

  defp toward?(pose, bearing, place),
    do: abs(Pose.wrap(Pose.bearing(pose, place) - bearing)) <= @aside

  defp smooth(nil, seen), do: seen
  defp smooth(place, nil), do: place

  defp smooth({x, y} = place, {sx, sy} = seen) do
    if Pose.distance(place, seen) > @jump,
      do: seen,
      else: {x + @gain * (sx - x), y + @gain * (sy - y)}
  end
end
