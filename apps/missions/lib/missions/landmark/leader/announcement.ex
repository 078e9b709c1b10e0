defmodule Missions.Landmark.Leader.Announcement do
  @moduledoc false
  # Decides what a leader announces each tick (`Missions.Landmark.Reference`, the anchor): where it is
  # supposed to be and how sure of that it is, the shape and the robot of each slot. Pure; millimetres and
  # milliradians.
  alias Missions.Landmark
  alias Missions.Landmark.{LandmarkTrack, Shape}
  alias Missions.Landmark.Leader.Loss
  alias Missions.Landmark.Reference

  # A landmark that was measured at most this long ago is where it was reported.
  @still_ms 400
  # No robot is farther away than this, in any unit.
  @lost 999_999_999

  @doc "The anchor of this tick, in `anchor`."
  @spec update(Landmark.State.t()) :: Landmark.State.t()
  def update(%{percept: percept, leadership: leadership} = mission) do
    sequence = leadership.sequence + 1
    place = LandmarkTrack.where(mission.sight)
    {size, places} = leadership.shape.room
    kept = Loss.kept(mission, mission.order)

    anchor = %Reference{
      leader: mission.me,
      epoch: mission.epoch,
      sequence: sequence,
      pose: Landmark.State.millimetres(percept.pose),
      twist: twist(percept),
      sd: sd(percept.uncertainty),
      start_sd: start_sd(percept.uncertainty),
      drift: drift(percept.uncertainty),
      slip: min(ceil(percept.uncertainty.slip * 1000), @lost),
      frame: percept.uncertainty.frame_no,
      base: percept.uncertainty.frame,
      formation: leadership.shape.formation,
      asked: mission.formation,
      asked_no: mission.asked_no,
      order: mission.order,
      size: size,
      places: Enum.take(places, length(mission.order)),
      trail:
        if(kept, do: Enum.map(kept, &elem(&1, 1)), else: Shape.trail(leadership.shape, mission)),
      of: mission.of,
      landmark: place && point(place),
      still: LandmarkTrack.still?(mission.sight, mission.now_ms, @still_ms)
    }

    %{mission | anchor: anchor, leadership: %{leadership | sequence: sequence}}
  end

  defp sd(%{position: position, heading: heading}),
    do: {min(round(position * 1000), @lost), min(round(heading * 1000), @lost)}

  defp start_sd(%{start: {position, heading}}),
    do: sd(%{position: :math.sqrt(position), heading: :math.sqrt(heading)})

  defp drift(%{drift: {way, turn, turned}}),
    do: {millionths(way), millionths(turn), min(round(turned * 1000), @lost)}

  defp millionths(variance), do: min(round(variance * 1.0e6), @lost)

  # A crawl is reported as standing still, so that no slot trembles.
  defp twist(%{odometry: %{twist: %{linear: linear, turn: turn}}}) do
    if abs(linear) < 0.02 and abs(turn) < 0.02,
      do: {0, 0},
      else: {round(linear * 1000), round(turn * 1000)}
  end

  defp point({x, y}), do: {round(x * 1000), round(y * 1000)}
end
