defmodule Missions.Landmark.SlotPoses do
  @moduledoc """
  Computes one robot's slot from the leader's reference: its pose in the map frame, and its
  velocity. Pure.

  A robot follows where the leader is supposed to be: the anchor's pose, extrapolated by its
  speed for as long as it has been under way, half a second at most.
  """
  alias Hal.{Pose, Twist}
  alias Swarm.Formation
  alias Missions.Landmark.{LandmarkTrack, Reference}

  @ahead_ms 500
  @default_distance 1.2
  # An anchor is good for so long (docs/times.md).
  @fresh_ms 1_000

  @doc "The leader's pose and speed from an anchor that is `age_ms` old."
  @spec leader(Reference.t(), non_neg_integer()) :: {Pose.t(), Twist.t()}
  def leader(%Reference{pose: {x, y, heading}, twist: {linear, turn}}, age_ms) do
    pose = Pose.new(x / 1000, y / 1000, heading / 1000)
    twist = Twist.new(linear / 1000, turn / 1000)
    dt = min(age_ms, @ahead_ms) / 1000
    middle = pose.heading + twist.turn * dt / 2

    {Pose.new(
       pose.x + twist.linear * dt * :math.cos(middle),
       pose.y + twist.linear * dt * :math.sin(middle),
       pose.heading + twist.turn * dt
     ), twist}
  end

  # How far ahead of the leader the landmark stands, in metres.
  defp landmark_distance(%Reference{landmark: nil}), do: @default_distance

  defp landmark_distance(%Reference{landmark: {lx, ly}, pose: {x, y, _heading}}),
    do: Pose.distance({x / 1000, y / 1000}, {lx / 1000, ly / 1000})

  @doc "The place of the landmark in an anchor, in metres, or `nil`."
  @spec landmark(Reference.t()) :: Pose.point() | nil
  def landmark(%Reference{landmark: nil}), do: nil
  def landmark(%Reference{landmark: {x, y}}), do: {x / 1000, y / 1000}

  @doc "The landmark of an anchor as a disc that no robot drives through, if there is one (metres)."
  @spec discs(Reference.t()) :: [{x :: float(), y :: float(), radius :: float()}]
  def discs(anchor), do: for({x, y} <- [landmark(anchor)], do: {x, y, LandmarkTrack.radius()})

  @doc "All used slots, as the leader of the claim intends them (`c:Robot.Mission.shape/3`)."
  @spec shape(map(), Pose.t(), ahead_m :: float()) :: Robot.Mission.shape() | nil
  def shape(%{anchor: %Reference{} = anchor}, pose, ahead_m) do
    slots = anchor.order |> Enum.zip(intended(anchor, pose, ahead_m)) |> Map.new()
    %{formation: anchor.formation, slots: slots}
  end

  def shape(_no_leader, _pose, _ahead_m), do: nil

  @doc "The slot of a follower with a fresh anchor, and what is wrong with that of a leader (`c:Robot.Mission.place/2`)."
  @spec place(map(), integer()) :: {:slot, tuple()} | {:fault, String.t()} | nil
  def place(%{phase: :follow, anchor: %Reference{} = anchor} = mission, at_ms)
      when at_ms - mission.anchor_ms <= @fresh_ms do
    with index when index != nil <- Enum.find_index(anchor.order, &(&1 == mission.me)) do
      place = Enum.at(anchor.places, index)
      group = {anchor.leader, anchor.epoch, anchor.formation, anchor.size, anchor.trail != nil}
      {:slot, {group, place}}
    end
  end

  def place(%{phase: :lead, anchor: %Reference{order: order, places: places} = anchor}, _at_ms) do
    unless Reference.valid?(anchor),
      do: {:fault, "order #{inspect(order)}, places #{inspect(places)} of #{anchor.size}"}
  end

  def place(_other, _at_ms), do: nil

  # In the order of the robots.
  defp intended(%Reference{trail: nil} = anchor, pose, distance) do
    slots = anchor.formation |> Formation.slots(anchor.size, distance) |> List.to_tuple()
    for place <- anchor.places, do: {place, Pose.compose(pose, elem(slots, place - 1))}
  end

  defp intended(%Reference{trail: trail, pose: {x, y, heading}}, pose, _distance) do
    believed = Pose.new(x / 1000, y / 1000, heading / 1000)

    for {{sx, sy, sh}, place} <- Enum.with_index(trail, 1) do
      slot = Pose.relative(believed, Pose.new(sx / 1000, sy / 1000, sh / 1000))
      {place, Pose.compose(pose, slot)}
    end
  end

  @doc "The slot of a robot and its velocity; `nil` if the anchor does not name the robot."
  @spec slot(Reference.t(), atom(), non_neg_integer()) :: {Pose.t(), {float(), float()}} | nil
  def slot(%Reference{order: order} = anchor, robot, age_ms) do
    case Enum.find_index(order, &(&1 == robot)) do
      nil -> nil
      index -> slot_at(anchor, index, age_ms)
    end
  end

  # A trail does not move, whatever the leader does on it.
  defp slot_at(%Reference{trail: [_ | _] = trail}, index, _age_ms) do
    {x, y, heading} = Enum.at(trail, index)
    {Pose.new(x / 1000, y / 1000, heading / 1000), {0.0, 0.0}}
  end

  defp slot_at(anchor, index, age_ms) do
    rank = Enum.at(anchor.places, index)
    slot = Formation.slot_of(anchor.formation, rank, anchor.size, landmark_distance(anchor))

    {pose, twist} = leader(anchor, age_ms)
    place = Pose.compose(pose, slot)
    {place, velocity(pose, twist, place)}
  end

  # A point of a turning body: v_L + w x r.
  defp velocity(pose, twist, place) do
    {twist.linear * :math.cos(pose.heading) - twist.turn * (place.y - pose.y),
     twist.linear * :math.sin(pose.heading) + twist.turn * (place.x - pose.x)}
  end
end
