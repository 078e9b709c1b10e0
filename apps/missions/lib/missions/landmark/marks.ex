defmodule Missions.Landmark.Marks do
  @moduledoc false
  # Decides what a follower corrects its pose by: the leader's frame, the landmark at the place that the
  # leader reports, and the robots ahead of it in the order at their reported places, each with its
  # reported uncertainty. Also decides when the pose is sure enough to claim a slot. Pure.
  #
  # Only robots ahead in the order count, so that corrections run one way, from the leader down. Others
  # may be seen, too, and must not be mistaken for one of these. In a fleet of more than twenty-one only the leader and the
  # nearest are looked for: twenty of all, and twenty of those ahead.
  alias Hal.Pose
  alias Robot.Localiser.Anchors
  alias Missions.Landmark
  alias Missions.Landmark.{Claim, LandmarkTrack, SlotPoses}

  @robot_colour "RedRobot"
  # How far a robot may have moved since it was heard, and the uncertainty of the place of a robot
  # in another frame, in metres.
  @moved_sd 0.15
  @strange_sd 1.0
  # The leader's uncertainty of its own place in its own frame, and of the landmark's place there:
  # along the distance (in metres, and per metre), and across.
  @leader_sd 0.01
  @landmark_along {0.02, 0.1}
  @landmark_across {0.005, 0.005}
  # A robot slower than this stands still, in m/s and rad/s.
  @slow 0.05
  # What was said so long ago (ms) may not hold any more.
  @fresh_ms 500
  # Of so many of the nearest robots, and so many of the nearest ahead, the picture is asked.
  @nearest 20
  # A robot in place is at most this far from its slot in 95 of 100 cases, in metres.
  @tolerance 0.5

  @doc "The marks of a follower that has a pose and an anchor of its leader."
  @spec anchors(Landmark.State.t()) :: Anchors.t()
  def anchors(%{anchor: anchor, percept: percept} = mission) do
    {leader, _twist} = SlotPoses.leader(anchor, mission.now_ms - mission.anchor_ms)
    ahead = [anchor.leader | Enum.take_while(anchor.order, &(&1 != mission.me))]

    # In an order that does not depend on the VM, because each correction changes the next.
    robots =
      for {id, peer} <- Enum.sort(neighbours(percept, ahead)) do
        at = Pose.point(if id == anchor.leader, do: leader, else: peer.pose)
        spread = spread(id, peer, anchor)

        %{
          key: {:robot, id},
          kind: :robot,
          colour: @robot_colour,
          at: at,
          sd: spread,
          common: Anchors.common(spread, at, Pose.point(leader)),
          reference?: standing?(peer) and told?(id, peer, anchor) and id in ahead,
          radius: peer.radius
        }
      end

    marks = landmark(mission) ++ robots
    %Anchors{frame: frame(mission, leader), marks: marks, told: seen(mission, ahead)}
  end

  # Where one of those ahead, which knows its own place, sees this robot stand; only one that has no pictures itself needs that.
  defp seen(%{percept: percept, me: me, anchor: anchor} = mission, ahead) do
    with true <- LandmarkTrack.blind?(mission.pictured_ms, mission.now_ms),
         true <- Landmark.State.slow?(percept, @slow) do
      Enum.find_value(ahead, fn id ->
        with %{at_ms: at_ms} = peer when mission.now_ms - at_ms < @fresh_ms <- percept.peers[id],
             true <- told?(id, peer, anchor),
             %{sees: {^me, {x, y}, sd}} <- Claim.of(peer.beat),
             do: %{at: {x / 1_000, y / 1_000}, sd: sd / 1_000},
             else: (_nothing -> nil)
      end)
    else
      _needs_none -> nil
    end
  end

  defp neighbours(%{peers: peers}, _ahead) when map_size(peers) <= @nearest, do: peers

  defp neighbours(%{peers: peers, pose: pose}, [leader | _] = ahead) do
    far = for {id, peer} <- Map.to_list(peers), do: {Pose.distance(pose, peer.pose), id}
    nearest = for {_distance, id} <- :lists.sort(far), do: id
    ahead = Map.from_keys(ahead, [])
    led = nearest |> Stream.filter(&is_map_key(ahead, &1)) |> Enum.take(@nearest)
    Map.take(peers, [leader | Enum.take(nearest, @nearest)] ++ led)
  end

  # A moving landmark is somewhere else by now.
  defp landmark(%{anchor: %{still: true, landmark: place} = anchor} = mission)
       when place != nil do
    [
      %{
        key: :landmark,
        kind: :landmark,
        colour: mission.colour,
        at: SlotPoses.landmark(anchor),
        sd: landmark_spread(anchor),
        common: {0.0, 0.0},
        reference?: true,
        radius: LandmarkTrack.radius()
      }
    ]
  end

  defp landmark(_mission), do: []

  defp landmark_spread(%{pose: {x, y, _heading}, landmark: {lx, ly}}) do
    {dx, dy} = {(lx - x) / 1000, (ly - y) / 1000}
    distance = :math.sqrt(dx * dx + dy * dy)
    grown = fn {sd, per_metre} -> sd + per_metre * distance end
    {grown.(@landmark_along), grown.(@landmark_across), :math.atan2(dy, dx)}
  end

  # A moving robot reported where it was, and it is unknown where a dead one came to rest.
  defp standing?(%{mode: :dead}), do: false

  defp standing?(%{mode: :moving, twist: twist}),
    do: abs(twist.linear) < @slow and abs(twist.turn) < @slow

  defp standing?(_holding), do: true

  # A robot that is not in the leader's frame yet cannot say where it is there.
  defp told?(leader, _peer, %{leader: leader}), do: true

  defp told?(_id, %{beat: %{leader: leader} = beat}, %{leader: leader, epoch: epoch}),
    do: match?(%{sd: {_, _, _}, epoch: ^epoch}, Claim.of(beat))

  defp told?(_id, _peer, _anchor), do: false

  defp spread(leader, _peer, %{leader: leader}), do: {@leader_sd, @leader_sd, 0.0}

  defp spread(id, peer, anchor) do
    if told?(id, peer, anchor) do
      {worst, least, mrad} = Claim.of(peer.beat).sd
      since = if standing?(peer), do: 0.0, else: @moved_sd
      {worst / 1000 + since, least / 1000 + since, mrad / 1000}
    else
      {@strange_sd, @strange_sd, 0.0}
    end
  end

  defp frame(%{anchor: %{drift: {way, turn, turned}} = anchor} = mission, leader) do
    {position, heading} = variances(anchor.sd)

    %{
      key: key(mission),
      base: anchor.base,
      at: Pose.point(leader),
      position: position,
      heading: heading,
      start: variances(anchor.start_sd),
      drift: {way / 1.0e6, turn / 1.0e6, turned / 1000},
      slip: anchor.slip / 1000
    }
  end

  defp variances({mm, mrad}), do: {mm * mm / 1.0e6, mrad * mrad / 1.0e6}

  # A leader that was started again numbers its frames from the beginning.
  defp key(%{anchor: %{leader: leader, frame: number}, percept: percept}) do
    case percept.peers do
      %{^leader => %{beat: %{boot: boot}}} -> {leader, boot, number}
      _nothing_heard -> {leader, nil, number}
    end
  end

  @doc """
  How well a robot knows its place in its leader's frame, as heartbeats report it: the standard
  deviation of its position along the worst direction and across it (mm), and that direction
  (mrad); `nil` if it is not in that frame yet, or has none.
  """
  @spec told(Landmark.State.t()) :: Claim.spread() | nil
  def told(%{anchor: %{}, percept: %{uncertainty: %{frame: frame, spread: spread}}} = mission) do
    {worst, least, direction} = spread

    if frame == key(mission),
      do: {millimetres(worst), millimetres(least), round(direction * 1000)}
  end

  def told(_mission), do: nil

  defp millimetres(metres), do: min(round(metres * 1000), 100_000)

  @doc """
  Whether a follower that believes it is this far from its slot (metres) is within half a metre of it in 95 of 100 cases.

      iex> peers = %{mag2: %{beat: %{boot: 7}}}
      iex> percept = %{uncertainty: %{radius: 0.3, frame: {:mag2, 7, 3}}, peers: peers}
      iex> mission = %{anchor: %{leader: :mag2, frame: 3}, percept: percept}
      iex> Enum.map([0.1, 0.25], &Missions.Landmark.Marks.sure?(mission, &1))
      [true, false]
  """
  @spec sure?(Landmark.State.t() | map(), error :: float()) :: boolean()
  def sure?(%{percept: %{uncertainty: %{frame: frame, radius: radius}}} = mission, error),
    do: frame == key(mission) and error + radius <= @tolerance

  def sure?(_mission, _error), do: false
end
