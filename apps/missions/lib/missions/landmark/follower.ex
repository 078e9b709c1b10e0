defmodule Missions.Landmark.Follower do
  @moduledoc """
  Decides what a follower does: it drives to its slot, watches what it can correct its pose by, and passes
  the reference on to its child. Pure.

  Without a fresh anchor it stands still: that is the leader's lease (1 s since it was heard).
  Meanwhile it looks at the landmark, because a round may ask next how large it sees it.

  A follower that stands in its slot by its own estimate, but does not know its place well enough
  to say so (`Missions.Landmark.Marks.sure?/2`), is `unsure?`: neither in place nor blocked.
  """
  alias Hal.Pose
  alias Robot.Percept.CameraPointing
  alias Robot.Behaviour.Avoid.Neighbours
  alias Robot.Behaviour.Patience
  alias Robot.Navigation.Grid
  alias Swarm.Formation.Chain
  alias Missions.Landmark
  alias Missions.Landmark.{Blocker, LandmarkTrack, Marks, SlotPoses}

  @lease_ms 1_000
  @in_place 0.25
  @near 0.15
  @slow 0.05
  # A robot that is unsure for this long turns; a slot that moved by less (metres) is the same one.
  @unsure_ms 4_000
  # A line of sight is a disc of this radius (metres), less than the clearance of any free cell.
  @ray 0.01
  @same_slot 0.2
  # The camera looks at the landmark and at the robot ahead in turn.
  @gaze_ms 1_500

  # A slot is blocked if something unknown has stood in it for this long, or if no way leads
  # nearer.
  @obstacle_ms 2_000
  @stuck_ms 8_000
  @progress 0.1
  @reach 2.0
  @clear 0.1
  # Wherever it is, a robot that has come no nearer to one slot for this long makes no progress, whatever shape the slot
  # belongs to. To have come nearer, it must have gained more than it may be mistaken by, or a metre.
  @late_ms 15_000
  @most_gain 1.0
  # A slot that has moved farther than this is another one. Whoever judges from outside takes a metre, from any place where
  # the slot was, and this robot sees it move by what its pose is corrected by, too.
  @elsewhere 1.2
  @here 0.1
  # Nor does one whose wheels have not taken it this far (metres), whatever its pose is corrected by.
  @moved 0.2

  defstruct in_place?: false,
            unsure?: false,
            holding?: false,
            blocked?: false,
            blocker: nil,
            late: [],
            told: {0, 0},
            landmark: nil,
            unsure_ms: nil,
            facing: nil,
            slot: nil,
            best: nil,
            best_ms: 0,
            obstacle_ms: nil,
            stopped: nil,
            stood?: false

  @typedoc """
  `told` is the epoch and sequence number of the anchor that was last passed on, `landmark` is
  where the landmark stood when this robot was last in place. `best` is the least distance to
  `slot` so far, and `best_ms` when it was reached; something unknown has stood in the slot since
  `obstacle_ms`. `late` is the same, ignoring small moves of the slot: from each place where it was, how the robot has come nearer since.
  By its wheels it has been where it `stopped`, since when.
  A robot that has `stood?` in its slot may be pushed off it, but knows that there is room.
  `blocker` is what blocks a blocked robot. `facing` is the heading in which it stands in a slot to make sure of its place, and it
  has been unsure since `unsure_ms`.
  """
  @type t :: %__MODULE__{
          in_place?: boolean(),
          unsure?: boolean(),
          holding?: boolean(),
          blocked?: boolean(),
          blocker: Blocker.t() | nil,
          late: [{Pose.t(), Patience.t()}],
          told: {non_neg_integer(), non_neg_integer()},
          landmark: {integer(), integer()} | nil,
          unsure_ms: integer() | nil,
          facing: {Pose.t(), heading :: float()} | nil,
          slot: Pose.t() | nil,
          best: float() | nil,
          best_ms: integer(),
          obstacle_ms: integer() | nil,
          stopped: {frame :: reference() | nil, Pose.t(), since_ms :: integer()} | nil,
          stood?: boolean()
        }

  @doc "The state of a robot that does not follow anybody yet."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc "The state at the beginning of following."
  @spec begin(Landmark.State.t()) :: Landmark.State.t()
  def begin(mission), do: %{mission | follower: new(), scan: nil}

  @doc "One tick of following."
  @spec act(Landmark.State.t()) :: {Landmark.State.t(), [tuple()]}
  def act(mission) do
    age_ms = mission.now_ms - (mission.anchor_ms || mission.now_ms)
    place = mission.anchor && SlotPoses.slot(mission.anchor, mission.me, age_ms)

    if place == nil or age_ms > @lease_ms or mission.percept.pose == nil do
      {%{mission | follower: wait(mission.follower, age_ms)},
       [{:goal, :stand, {Robot.Behaviour.Stop, []}}, {:look, look_out(mission)}]}
    else
      follow(mission, place, age_ms)
    end
  end

  # If a leader is silent for longer than a lease, its followers stay where they are.
  defp wait(follower, age_ms) do
    silent? = age_ms >= @late_ms
    blocker = if silent?, do: :no_anchor

    %{
      follower
      | in_place?: false,
        unsure?: false,
        holding?: true,
        blocked?: silent?,
        blocker: blocker
    }
  end

  defp follow(mission, {slot, velocity}, age_ms) do
    error = Pose.distance(mission.percept.pose, slot)
    slow? = Landmark.State.slow?(mission.percept, @slow)
    {vx, vy} = velocity
    resting? = slow? and vx * vx + vy * vy < @slow * @slow
    there? = slow? and error <= @in_place
    sure? = Marks.sure?(mission, error)

    {told, place} = pass_on(mission)
    {leader, _twist} = SlotPoses.leader(mission.anchor, age_ms)

    mission = %{
      mission
      | place: slot,
        follower: %{
          mission.follower
          | in_place?: there? and sure?,
            unsure?: there? and not sure?,
            holding?: resting? and error <= @near,
            told: told,
            # Remembers where the landmark stood when this robot was last in place, or began to
            # follow.
            landmark: landmark(mission, there?)
        }
    }

    mission = %{mission | follower: mission |> block(slot, error) |> late(mission, slot, error)}
    mission = %{mission | follower: turn(mission.follower, mission, slot, error, leader)}

    options = [
      target: faced(slot, mission.follower),
      velocity: velocity,
      discs: discs(mission.anchor)
    ]

    goal = {:goal, {:slot, mission.epoch}, {Robot.Behaviour.Follow, options}}

    {mission, place ++ [goal, {:look, look(mission, age_ms)}, {:anchors, Marks.anchors(mission)}]}
  end

  # A robot that has been unsure of its place for a while turns to what it can make sure by, one after the other, and
  # stays turned, because it would not be in place while it turned back.
  defp turn(follower, %{now_ms: now} = mission, slot, error, leader) do
    since_ms = unsure_ms(follower, error, now)
    facing = follower.facing
    facing = if facing && Pose.distance(elem(facing, 0), slot) < @same_slot, do: facing
    follower = %{follower | unsure_ms: since_ms, facing: facing}

    with true <- follower.unsure? and now - since_ms >= @unsure_ms,
         [_ | _] = marks <- visible(mission, leader) do
      mark = Enum.at(marks, rem(div(now - since_ms, @unsure_ms) - 1, length(marks)))
      {x, y} = {mission.percept.pose.x, mission.percept.pose.y}
      heading = :math.atan2(elem(mark, 1) - y, elem(mark, 0) - x)
      %{follower | facing: {slot, heading}}
    else
      _sure -> follower
    end
  end

  defp unsure_ms(%{in_place?: true}, _error, _now), do: nil
  defp unsure_ms(_follower, error, _now) when error > @in_place, do: nil
  defp unsure_ms(%{unsure?: true, unsure_ms: nil}, _error, now), do: now
  defp unsure_ms(follower, _error, _now), do: follower.unsure_ms

  # What no wall hides of the leader, the landmark, and the robots ahead. Who does not know walls takes one robot for another.
  defp visible(%{anchor: anchor, percept: %{grid: grid} = percept} = mission, leader) do
    ahead = for id <- Enum.take_while(anchor.order, &(&1 != mission.me)), do: percept.peers[id]
    robots = for %{pose: pose} <- ahead, do: Pose.point(pose)
    from = Pose.point(percept.pose)

    for at <- [Pose.point(leader), SlotPoses.landmark(anchor) | robots],
        at != nil and grid != nil and Grid.free_line?(grid, from, at, @ray),
        do: at
  end

  defp faced(slot, %{facing: nil}), do: slot
  defp faced(slot, %{facing: {_slot, heading}}), do: %{slot | heading: heading}

  # A robot that stands where it should, as far as it knows, is not blocked.
  defp block(
         %{follower: %{in_place?: in_place?, unsure?: unsure?} = follower} = mission,
         slot,
         error
       )
       when in_place? or unsure?,
       do: %{fresh(follower, slot, error, mission.now_ms) | stood?: true}

  defp block(%{follower: follower, now_ms: now} = mission, slot, error) do
    cond do
      follower.slot == nil or Pose.distance(follower.slot, slot) > 0.2 ->
        fresh(follower, slot, error, now)

      error < follower.best - @progress ->
        %{watch(follower, mission, slot, error) | best: error, best_ms: now}

      true ->
        follower = watch(follower, mission, slot, error)
        since_ms = if follower.stood?, do: nil, else: follower.obstacle_ms
        obstacle? = since_ms != nil and now - since_ms >= @obstacle_ms
        stuck? = error < @reach and now - follower.best_ms >= @stuck_ms
        %{follower | blocked?: obstacle? or stuck?}
    end
  end

  # Farther away, or if the slot trembles, only time shows that a robot makes no progress.
  defp late(%{in_place?: in_place?, unsure?: unsure?} = follower, _mission, _slot, _error)
       when in_place? or unsure?,
       do: %{follower | late: [], stopped: nil, blocker: nil}

  defp late(follower, %{now_ms: now} = mission, slot, error) do
    late = patience(follower.late, slot, error, now)
    gain = gain(mission.percept)
    stale? = fn {_place, patience} -> Patience.stale?(patience, gain, @late_ms) end
    {_frame, _pose, since_ms} = stopped = stopped(follower.stopped, mission.percept.odometry, now)
    blocked? = follower.blocked? or now - since_ms >= @late_ms or Enum.any?(late, stale?)

    %{
      follower
      | late: late,
        stopped: stopped,
        blocked?: blocked?,
        blocker: blocker(follower, mission, slot, blocked?)
    }
  end

  defp stopped({frame, pose, _since_ms} = stopped, %{frame: frame, pose: now_at}, now) do
    if Pose.distance(pose, now_at) <= @moved, do: stopped, else: {frame, now_at, now}
  end

  defp stopped(_none, odometry, now), do: {odometry.frame, odometry.pose, now}

  defp patience(late, slot, error, now) do
    late =
      for {place, patience} <- late,
          Pose.distance(place, slot) <= @elsewhere,
          do: {place, Patience.note(patience, error, now, :straight)}

    if Enum.any?(late, fn {place, _} -> Pose.distance(place, slot) <= @here end),
      do: late,
      else: [{slot, Patience.note(nil, error, now, :straight)} | late]
  end

  # While its pose is corrected, a robot seems to come nearer that stands still.
  defp gain(%{uncertainty: %{radius: radius}}), do: radius |> max(@progress) |> min(@most_gain)
  defp gain(_percept), do: @progress

  # The blocker is determined once, when the robot gives up: what passes by while it waits is not
  # the cause.
  defp blocker(_attend, _mission, _slot, false), do: nil

  defp blocker(%{blocker: nil}, mission, slot, true),
    do: Blocker.find(mission.percept, slot, SlotPoses.landmark(mission.anchor))

  defp blocker(follower, _mission, _slot, true), do: follower.blocker

  defp fresh(follower, slot, error, now) do
    %{
      follower
      | slot: slot,
        best: error,
        best_ms: now,
        obstacle_ms: nil,
        blocked?: false,
        stood?: false
    }
  end

  defp watch(follower, mission, slot, error) do
    if walled?(mission.percept, slot) or (error < @reach and obstacle?(mission, slot)),
      do: %{follower | obstacle_ms: follower.obstacle_ms || mission.now_ms},
      else: %{follower | obstacle_ms: nil}
  end

  # The leader has seen less of the walls there.
  defp walled?(%{grid: %{closed?: false} = grid, profile: profile}, slot),
    do: not Grid.free?(grid, Pose.point(slot), profile.radius)

  defp walled?(_percept, _slot), do: false

  # Something that the sonars see where this robot should stand, and that nobody has reported.
  defp obstacle?(%{percept: percept, anchor: anchor}, slot) do
    robots = for {_id, peer} <- percept.peers, do: {peer.pose.x, peer.pose.y, peer.radius}

    percept
    |> Neighbours.unknown(robots ++ discs(anchor))
    |> Enum.any?(&(Pose.distance(slot, &1.at) < percept.profile.radius + @clear))
  end

  defp landmark(%{anchor: anchor, follower: follower}, in_place?),
    do: if(in_place? or follower.landmark == nil, do: anchor.landmark, else: follower.landmark)

  # From parent to child: n - 1 messages for the whole group (R28, R53).
  defp pass_on(%{anchor: anchor, follower: follower} = mission) do
    news = {anchor.epoch, anchor.sequence}
    child = Chain.child([anchor.leader | anchor.order], mission.me)

    if news != follower.told and child != nil,
      do: {news, [{:claim, [child], %{anchor: anchor}}]},
      else: {follower.told, []}
  end

  # Nobody drives through the landmark.
  defp discs(anchor) do
    case SlotPoses.landmark(anchor) do
      nil -> []
      {x, y} -> [{x, y, LandmarkTrack.radius()}]
    end
  end

  # Pans towards the landmark and the robot ahead in turn, as far as they can be seen.
  defp look(%{anchor: anchor, percept: percept} = mission, age_ms) do
    {leader, _twist} = SlotPoses.leader(anchor, age_ms)
    targets = [SlotPoses.landmark(anchor) || Pose.point(leader), ahead(mission, leader)]
    turn = rem(div(mission.now_ms, @gaze_ms), 2)
    {first, [second]} = List.pop_at(targets, turn)

    Enum.find_value([first, second], 0.0, fn place ->
      bearing = Pose.bearing(percept.pose, place)
      if CameraPointing.within?(bearing, percept), do: CameraPointing.pan(bearing, percept)
    end)
  end

  # The last known place of the landmark.
  defp look_out(%{percept: %{pose: nil}}), do: 0.0

  defp look_out(%{anchor: anchor, sight: sight, percept: percept}) do
    place = (anchor && SlotPoses.landmark(anchor)) || (sight && sight.place)
    bearing = if place, do: Pose.bearing(percept.pose, place), else: 0.0

    if CameraPointing.within?(bearing, percept),
      do: CameraPointing.pan(bearing, percept),
      else: 0.0
  end

  defp ahead(%{anchor: anchor, percept: percept} = mission, leader) do
    case anchor.order |> Enum.take_while(&(&1 != mission.me)) |> List.last() do
      nil -> Pose.point(leader)
      id -> if peer = percept.peers[id], do: Pose.point(peer.pose), else: Pose.point(leader)
    end
  end
end
