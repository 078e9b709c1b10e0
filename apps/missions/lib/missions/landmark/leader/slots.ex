defmodule Missions.Landmark.Leader.Slots do
  @moduledoc false
  # Chooses the order of a leader's followers, and the shape in whose slots they stand. Pure.
  alias Missions.Landmark
  alias Missions.Landmark.{Claim, LandmarkTrack, Merge, Rounds, Shape}
  alias Missions.Landmark.Leader.Loss
  alias Swarm.Formation.{Assignment, Chain}

  # Metres: nearer than 1.4 m the landmark's foot leaves the picture, and then its size is unknown.
  @near 1.5
  # By then all that took part in the round have reported that they follow; later ones are new.
  @settled_ms 1_000

  @doc "How near to the landmark a leader drives, in metres."
  @spec near() :: float()
  def near, do: @near

  @doc "One tick: which robots have left or come, and a shape that there is room for."
  @spec update(Landmark.State.t()) :: Landmark.State.t()
  def update(mission) do
    case Loss.kept(mission, Rounds.view(mission)) do
      nil -> mission |> muster() |> shape() |> sighted_first()
      kept -> %{mission | order: Enum.map(kept, &elem(&1, 0))}
    end
  end

  # Robots that are gone leave their slots and those behind move up; new ones
  # join the tail.
  defp muster(mission) do
    view = List.delete(Rounds.view(mission), mission.me)
    kept = Chain.heal(mission.order, view)

    came =
      if mission.now_ms - mission.since_ms >= @settled_ms,
        do: (view -- kept) -- Merge.theirs(view, mission),
        else: []

    %{mission | order: kept ++ came}
  end

  # Those behind find their places by those ahead, so a robot without pictures, which may not know its own, goes to the end. It
  # stays there when its pictures come back, so that no robot moves for nothing.
  defp sighted_first(%{order: order} = mission) do
    beats = Landmark.State.beats(mission)
    {blind, sighted} = Enum.split_with(order, &match?(%{blind: true}, claim(beats[&1])))
    %{mission | order: sighted ++ blind}
  end

  defp claim(nil), do: nil
  defp claim(beat), do: Claim.of(beat)

  # If the shape has changed, `:cost` assigns its slots again.
  defp shape(%{leadership: leadership} = mission) do
    shape = Shape.update(leadership.shape, mission, landmark_distance(mission))
    new? = told(shape) != told(leadership.shape) and not most?(shape, leadership.shape)
    mission = %{mission | leadership: %{leadership | shape: shape}}

    dealt? =
      leadership.shape.room == nil and mission.now_ms == mission.since_ms and all_free?(mission)

    if new? and not dealt? and mission.assign == :cost, do: deal(mission), else: mission
  end

  defp told(shape), do: {shape.formation, shape.room, shape.spots}

  # If most places are where they were, a robot that has lost one takes its new one, and no other moves.
  defp most?(%{spots: [_ | _] = new}, %{spots: [_ | _] = old}) when length(new) == length(old),
    do: 2 * Enum.count(Enum.zip(new, old), fn {a, b} -> a == b end) >= length(new)

  defp most?(_shape, _old), do: false

  # Then the round's record has assigned them; it does not know where there is no room.
  defp all_free?(%{order: order, leadership: %{shape: %{room: {size, places}}}}) do
    count = length(order)
    size == count + 1 and Enum.sort(places) == Enum.to_list(1..count//1)
  end

  defp landmark_distance(%{sight: sight, percept: percept}) do
    place = LandmarkTrack.where(sight)
    if place, do: Hal.Pose.distance(percept.pose, place), else: @near
  end

  defp used(_mission, %{spots: [_ | _] = spots}) do
    for spot <- spots, {x, y, _heading} = Landmark.State.millimetres(spot), do: {x, y}
  end

  defp used(mission, %{formation: formation, room: {size, places}}) do
    slots = Rounds.slots(formation, mission.percept.pose, size, landmark_distance(mission))
    for place <- places, do: Enum.at(slots, place - 1)
  end

  # Assigns the slots by squared distance from where the robots say they are.
  defp deal(mission) do
    beats = Landmark.State.beats(mission)
    followers = for id <- mission.order, {x, y, _heading} = beats[id].pose, do: {id, {x, y}}
    {x, y, _heading} = Landmark.State.millimetres(mission.percept.pose)
    used = used(mission, mission.leadership.shape)
    %{mission | order: Assignment.order(:cost, followers, {x, y}, used)}
  end
end
