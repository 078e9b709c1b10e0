defmodule Missions.Landmark.Follower.Guide do
  @moduledoc false
  # Tells a robot without pictures where it stands. Pure.
  #
  # Of the robots ahead of it the one whose slot is nearest to its own, and which is sure of its place, turns so that it has it
  # in its camera's range, measures where it stands, and says so in its claim (`sees`). Robots look alike, so it says so only
  # if the blob can be no other: all others know where they are, and are elsewhere, and one alone does not.
  alias Hal.Pose
  alias Missions.Landmark
  alias Missions.Landmark.{Claim, SlotPoses}
  alias Robot.Percept.{CameraPointing, Sighting}

  @robot_colour "RedRobot"
  # A robot that is told of stands this near to its slot (metres), and others this far from it.
  @near 1.5
  @apart 0.6
  # So many pictures in a row show it within so many metres of where the first did.
  @pictures 8
  @same 0.15
  # It may stand beside its slot, and be cut off by the border of the picture: one time robot and camera point to the slot,
  # then so many radians beside it, for so many ms each.
  @asides {0.0, 0.3, -0.3}
  @aside_ms 6_000
  # Standard deviations of the place of a blob: along the line of sight (metres, and per metre), and of its direction (radians).
  @range_sd {0.05, 0.05}
  @bearing_sd 0.02

  defstruct ward: nil, at: nil, count: 0, picture_ms: nil

  @typedoc "The robot it guides, and where it has seen it since how many pictures, the last of which is of `picture_ms`."
  @type t :: %__MODULE__{
          ward: atom() | nil,
          at: Pose.point() | nil,
          count: non_neg_integer(),
          picture_ms: integer() | nil
        }

  @doc "One tick of a follower in its place; `there?` says that it is sure of that."
  @spec note(t(), Landmark.State.t(), there? :: boolean()) :: t()
  def note(_guide, _mission, false), do: %__MODULE__{}

  def note(guide, mission, true) do
    case ward(mission) do
      nil -> %__MODULE__{}
      ward when ward == guide.ward -> look(guide, mission)
      ward -> look(%__MODULE__{ward: ward}, mission)
    end
  end

  # The one robot that does not know its place, if it has no pictures, stands, and this is the robot to look at it.
  defp ward(%{anchor: %{order: order}, me: me} = mission) do
    claims = for {id, beat} <- Landmark.State.beats(mission), into: %{}, do: {id, Claim.of(beat)}
    lost = for id <- order, id != me, not sure?(claims[id]), do: id

    with [ward] <- lost,
         %{blind: true, unsure: true} <- claims[ward],
         ^me <- nearest(mission, ward, claims),
         do: ward,
         else: (_none_or_several -> nil)
  end

  defp sure?(%{in_place: in_place}), do: in_place
  defp sure?(nil), do: false

  defp nearest(%{anchor: anchor} = mission, ward, claims) do
    slot = slot(anchor, ward)

    anchor.order
    |> Enum.take_while(&(&1 != ward))
    |> Enum.reject(&match?(%{blind: true}, claims[&1]))
    |> Enum.filter(&(&1 == mission.me or sure?(claims[&1])))
    |> Enum.min_by(&{Pose.distance(slot(anchor, &1), slot), &1}, fn -> nil end)
  end

  defp slot(anchor, id), do: anchor |> SlotPoses.slot(id, 0) |> elem(0)

  defp look(%{picture_ms: ms} = guide, %{percept: %{detections: %{at_ms: ms}}}), do: guide
  defp look(guide, %{percept: %{detections: nil}}), do: guide
  defp look(guide, %{percept: %{detections: %{pose: nil}}}), do: guide

  defp look(%{ward: ward} = guide, %{percept: percept} = mission) do
    guide = %{guide | picture_ms: percept.detections.at_ms}
    slot = slot(mission.anchor, ward)

    places =
      for blob <- percept.detections.blobs,
          # Its width is right if its foot is out of the picture.
          blob.colour == @robot_colour and blob.left > 0 and blob.right < blob.width - 1,
          not Sighting.hidden?(blob, percept.detections.blobs),
          at = place(blob, percept, percept.peers[ward]),
          Pose.distance(at, slot) <= @near,
          do: at

    case {places, guide.at} do
      {[at], last} when last != nil ->
        if alone?(at, mission, ward) and Pose.distance(at, last) <= @same,
          do: %{guide | count: min(guide.count + 1, @pictures)},
          else: %{guide | at: at, count: 0}

      {[at], nil} ->
        %{guide | at: at, count: 0}

      # Aside, while it looks at what it finds its own place by.
      {_none_or_several, _last} ->
        guide
    end
  end

  defp place(_blob, _percept, nil), do: nil

  defp place(blob, percept, %{radius: radius}) do
    view = Sighting.field_of_view(percept)
    bearing = Sighting.bearing(blob, percept.detections.pan, view)
    distance = Sighting.distance_by_width(blob, radius, view)
    Sighting.place(percept.detections.pose, bearing, distance)
  end

  defp alone?(at, mission, ward) do
    others = for {id, peer} <- mission.percept.peers, id != ward, do: Pose.point(peer.pose)
    Enum.all?(others, &(Pose.distance(&1, at) > @apart))
  end

  @doc "Where the robot stands that it guides, once it knows: in mm, in its leader's frame, with a standard deviation in mm."
  @spec sees(Landmark.State.t()) :: Claim.seen() | nil
  def sees(%{phase: :follow, follower: %{guide: %{count: @pictures} = guide}, percept: percept}) do
    %{at: {x, y}, ward: ward} = guide
    distance = Pose.distance(percept.pose, guide.at)
    %{position: position, heading: heading} = percept.uncertainty
    {least, share} = @range_sd
    along = least + share * distance
    across = (@bearing_sd + heading) * distance
    sd = :math.sqrt(position * position + max(along, across) ** 2)
    {ward, {round(1_000 * x), round(1_000 * y)}, min(round(1_000 * sd), 100_000)}
  end

  def sees(_mission), do: nil

  @doc """
  The slot of a follower with the heading from which it can see the robot that it guides, and what it finds its own place by;
  `ahead` is where that is. As it is where it guides none, or its camera can be panned so far.
  """
  @spec turned(t(), Landmark.State.t(), slot :: Pose.t(), ahead :: Pose.point()) :: Pose.t()
  def turned(%{ward: nil}, _mission, slot, _ahead), do: slot

  def turned(%{ward: ward}, %{percept: percept} = mission, slot, ahead) do
    {dx, dy} = Pose.point(slot(mission.anchor, ward))
    back = :math.atan2(dy - slot.y, dx - slot.x)
    fore = :math.atan2(elem(ahead, 1) - slot.y, elem(ahead, 0) - slot.x)
    half = Pose.wrap(fore - back) / 2
    pan = CameraPointing.reach(percept.profile)

    cond do
      abs(Pose.wrap(back - slot.heading)) <= pan -> slot
      abs(half) <= pan -> %{slot | heading: Pose.wrap(back + half + aside(mission))}
      true -> %{slot | heading: Pose.wrap(back + aside(mission))}
    end
  end

  defp aside(%{now_ms: now}), do: elem(@asides, rem(div(now, @aside_ms), tuple_size(@asides)))

  @doc "Where to look for the robot that it guides, if it is within the camera's range: a bearing."
  @spec bearing(t(), Landmark.State.t()) :: float() | nil
  def bearing(%{ward: nil}, _mission), do: nil

  def bearing(%{ward: ward}, %{percept: percept} = mission) do
    slot = Pose.point(slot(mission.anchor, ward))
    bearing = Pose.bearing(percept.pose, slot) + aside(mission)
    if CameraPointing.within?(bearing, percept), do: bearing
  end
end
