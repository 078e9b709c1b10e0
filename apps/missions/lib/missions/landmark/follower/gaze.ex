defmodule Missions.Landmark.Follower.Gaze do
  @moduledoc false
  # Decides where a follower looks: at the landmark and at the robot ahead in turn, by which it corrects its pose. Pure.
  #
  # A landmark that it sees somewhere else than its leader says stays in its picture until a round has asked for its size
  # (`Missions.Landmark.Rounds.Challenge`). If its leader does not see the landmark any more, a follower that stands in its
  # slot looks all around for it: first to one side, the next in the order to the other, so that two see all around in
  # 3 s. The camera can be panned by less than half a turn, so the body turns, too, once; then it is turned back to the
  # slot's heading, and the camera goes on.
  alias Hal.Pose
  alias Missions.Landmark
  alias Missions.Landmark.{Claim, LandmarkTrack, SlotPoses}
  alias Missions.Landmark.Follower.Guide
  alias Robot.Percept.CameraPointing

  @turn_ms 1_500
  # Until when it looks to the first side, and to the other, and how far the body turns there (radians).
  @first_ms 2_500
  @second_ms 6_000
  @far 1.4
  @less 0.7

  defstruct lost_ms: nil, side: 1

  @typedoc "It looks around since `lost_ms`, first to this side: 1 is left, -1 right."
  @type t :: %__MODULE__{lost_ms: integer() | nil, side: 1 | -1}

  @doc "One tick; `there?`: it stands in its slot."
  @spec note(t(), Landmark.State.t(), there? :: boolean()) :: t()
  def note(gaze, mission, there?) do
    if there? and missed?(mission),
      do: %__MODULE__{lost_ms: gaze.lost_ms || mission.now_ms, side: side(mission)},
      else: %__MODULE__{}
  end

  # Its leader says that it does not see the landmark.
  defp missed?(%{leader: leader} = mission) do
    case Landmark.State.beats(mission) do
      %{^leader => %{phase: :lead} = beat} -> Claim.of(beat).sight == nil
      _unheard -> false
    end
  end

  defp side(%{anchor: %{order: order}, me: me}) do
    if order |> Enum.find_index(&(&1 == me)) |> rem(2) == 0, do: 1, else: -1
  end

  @doc "The slot with the heading in which the robot shall stand there."
  @spec turned(t(), Landmark.State.t(), Pose.t()) :: Pose.t()
  def turned(%{lost_ms: nil}, _mission, slot), do: slot

  def turned(%{lost_ms: since_ms, side: side}, mission, slot) do
    past = mission.now_ms - since_ms

    cond do
      found?(mission) -> %{slot | heading: mission.percept.pose.heading}
      past < @first_ms -> %{slot | heading: Pose.wrap(slot.heading + side * @far)}
      past < @second_ms -> %{slot | heading: Pose.wrap(slot.heading - side * @less)}
      true -> slot
    end
  end

  @doc "How far to pan the camera (radians, left positive); `leader` is the leader's pose."
  @spec pan(Landmark.State.t(), leader :: Pose.t()) :: float()
  def pan(%{follower: %{gaze: gaze}, percept: percept} = mission, leader) do
    cond do
      found?(mission) -> CameraPointing.pan(mission.sight.bearing, percept)
      gaze.lost_ms != nil -> CameraPointing.pan(around(gaze, mission.now_ms), percept)
      true -> in_turn(mission, leader)
    end
  end

  # It sees the landmark elsewhere than its leader says, or is about to ask for another leader.
  defp found?(%{sight: sight, anchor: anchor, percept: percept} = mission) do
    Landmark.State.sees?(mission) and
      (mission.challenge != nil or
         LandmarkTrack.elsewhere?(sight, percept.pose, SlotPoses.landmark(anchor)))
  end

  defp around(%{lost_ms: since_ms, side: side}, now) do
    past = now - since_ms
    first? = past < @first_ms or rem(div(past - @first_ms, @second_ms - @first_ms), 2) == 1
    if first?, do: side * :math.pi(), else: -side * :math.pi()
  end

  # Towards the landmark and the robot ahead, as far as they can be seen.
  defp in_turn(%{anchor: anchor, percept: percept} = mission, leader) do
    targets = [SlotPoses.landmark(anchor) || Pose.point(leader), ahead(mission, leader)]
    turn = div(mission.now_ms, @turn_ms)
    {first, [second]} = List.pop_at(targets, rem(turn, 2))
    aside = rem(turn, 4) > 1 && aside(mission, List.last(targets), turn)

    if aside do
      CameraPointing.pan(aside, percept)
    else
      Enum.find_value([first, second], 0.0, fn place ->
        bearing = Pose.bearing(percept.pose, place)
        if CameraPointing.within?(bearing, percept), do: CameraPointing.pan(bearing, percept)
      end)
    end
  end

  # The robots ahead may fill the picture up to its border. Beyond it an unsure robot sees where the nearest of them ends.
  defp aside(%{percept: %{profile: %{camera: nil}}}, _ahead, _turn), do: nil

  defp aside(
         %{follower: %{guide: guide, unsure?: unsure?}, percept: percept} = mission,
         ahead,
         turn
       ) do
    half = percept.profile.camera.field_of_view / 2
    bearing = Pose.bearing(percept.pose, ahead) + if(rem(turn, 2) == 0, do: half, else: -half)

    Guide.bearing(guide, mission) ||
      (unsure? and CameraPointing.within?(bearing, percept) and bearing)
  end

  defp ahead(%{anchor: anchor, percept: percept} = mission, leader) do
    case anchor.order |> Enum.take_while(&(&1 != mission.me)) |> List.last() do
      nil -> Pose.point(leader)
      id -> if peer = percept.peers[id], do: Pose.point(peer.pose), else: Pose.point(leader)
    end
  end

  @doc "The same for one that waits for its leader: to the last known place of the landmark."
  @spec waiting(Landmark.State.t()) :: float()
  def waiting(%{percept: %{pose: nil}}), do: 0.0

  def waiting(%{anchor: anchor, sight: sight, percept: percept}) do
    place = (anchor && SlotPoses.landmark(anchor)) || LandmarkTrack.where(sight)
    bearing = if place, do: Pose.bearing(percept.pose, place), else: 0.0

    if CameraPointing.within?(bearing, percept),
      do: CameraPointing.pan(bearing, percept),
      else: 0.0
  end
end
