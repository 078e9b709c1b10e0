defmodule Missions.Landmark.Follower.Progress do
  @moduledoc false
  # Decides whether a follower that is short of its slot gets on, or is blocked, and by what. Pure.
  #
  # A slot is blocked if something unknown has stood in it for 2 s, or if no way has led nearer for 8 s. Wherever it is, a
  # robot that has come no nearer to one slot for 15 s makes no progress, whatever shape the slot belongs to, nor does one
  # whose wheels have stood for so long, whatever its pose is corrected by.
  alias Hal.Pose
  alias Missions.Landmark
  alias Missions.Landmark.{Blocker, SlotPoses}
  alias Robot.Behaviour.Avoid.Neighbours
  alias Robot.Behaviour.Patience
  alias Nav.Grid

  @obstacle_ms 2_000
  @stuck_ms 8_000
  @gain 0.1
  @reach 2.0
  @clear 0.1
  # A slot that moved by less (metres) is the same one.
  @same 0.2
  # To have come nearer, it must have gained more than it may be mistaken by, or a metre.
  @late_ms 15_000
  @most_gain 1.0
  # A slot that has moved farther than this is another one. A judge from outside takes a metre, from any place where
  # the slot was, and this robot sees it move by what its pose is corrected by, too.
  @elsewhere 1.2
  @here 0.1
  # Wheels that have not taken it this far (metres) have stood.
  @moved 0.2

  defstruct blocked?: false,
            blocker: nil,
            late: [],
            stopped: nil,
            slot: nil,
            best: nil,
            best_ms: 0,
            obstacle_ms: nil,
            stood?: false

  @typedoc """
  `blocker` is what blocks a blocked robot. `best` is the least distance to `slot` so far, and `best_ms` when it was
  reached; something unknown has stood in the slot since `obstacle_ms`. `late` is the same, ignoring small moves of the
  slot: from each place where it was, how the robot has come nearer since. By its wheels it has been where it `stopped`,
  since when. A robot that has `stood?` in its slot may be pushed off it, but knows that there is room.
  """
  @type t :: %__MODULE__{
          blocked?: boolean(),
          blocker: Blocker.t() | nil,
          late: [{Pose.t(), Patience.t()}],
          stopped: {frame :: reference() | nil, Pose.t(), since_ms :: integer()} | nil,
          slot: Pose.t() | nil,
          best: float() | nil,
          best_ms: integer(),
          obstacle_ms: integer() | nil,
          stood?: boolean()
        }

  @doc "A robot that hears nothing of its leader: it is blocked once that has lasted for as long as one makes no progress."
  @spec wait(t(), silent_ms :: integer()) :: t()
  def wait(progress, silent_ms) do
    blocked? = silent_ms >= @late_ms
    %{progress | blocked?: blocked?, blocker: if(blocked?, do: :no_anchor)}
  end

  @doc "One tick of a follower this far (metres) from its slot; `there?` says that it stands in it, as far as it knows."
  @spec note(t(), Landmark.State.t(), Pose.t(), error :: float(), there? :: boolean()) :: t()
  def note(progress, %{now_ms: now}, slot, error, true) do
    fresh = fresh(progress, slot, error, now)
    %{fresh | stood?: true, late: [], stopped: nil, blocker: nil}
  end

  def note(progress, mission, slot, error, false),
    do: progress |> near(mission, slot, error) |> late(mission, slot, error)

  defp near(progress, %{now_ms: now} = mission, slot, error) do
    cond do
      progress.slot == nil or Pose.distance(progress.slot, slot) > @same ->
        fresh(progress, slot, error, now)

      error < progress.best - @gain ->
        %{watch(progress, mission, slot, error) | best: error, best_ms: now}

      true ->
        progress = watch(progress, mission, slot, error)
        since_ms = if progress.stood?, do: nil, else: progress.obstacle_ms
        obstacle? = since_ms != nil and now - since_ms >= @obstacle_ms
        stuck? = error < @reach and now - progress.best_ms >= @stuck_ms
        %{progress | blocked?: obstacle? or stuck?}
    end
  end

  defp fresh(progress, slot, error, now) do
    %{
      progress
      | slot: slot,
        best: error,
        best_ms: now,
        obstacle_ms: nil,
        blocked?: false,
        stood?: false
    }
  end

  # Farther away, or if the slot trembles, only time shows that a robot makes no progress.
  defp late(progress, %{now_ms: now} = mission, slot, error) do
    late = patience(progress.late, mission.percept.pose, slot, error, now)
    gain = gain(mission.percept)
    stale? = fn {_place, patience} -> Patience.stale?(patience, gain, @late_ms) end
    {_frame, _pose, since_ms} = stopped = stopped(progress.stopped, mission.percept.odometry, now)
    blocked? = progress.blocked? or now - since_ms >= @late_ms or Enum.any?(late, stale?)

    %{
      progress
      | late: late,
        stopped: stopped,
        blocked?: blocked?,
        blocker: blocker(progress, mission, slot, blocked?)
    }
  end

  defp stopped({frame, pose, _since_ms} = stopped, %{frame: frame, pose: now_at}, now) do
    if Pose.distance(pose, now_at) <= @moved, do: stopped, else: {frame, now_at, now}
  end

  defp stopped(_none, odometry, now), do: {odometry.frame, odometry.pose, now}

  # A slot that swings past a robot brings neither nearer: the robot comes nearer to where the slot was, too.
  defp patience(late, pose, slot, error, now) do
    late =
      for {place, patience} <- late, Pose.distance(place, slot) <= @elsewhere do
        left = max(error, Pose.distance(pose, place))
        {place, Patience.note(patience, left, now, :straight)}
      end

    if Enum.any?(late, fn {place, _} -> Pose.distance(place, slot) <= @here end),
      do: late,
      else: [{slot, Patience.note(nil, error, now, :straight)} | late]
  end

  # While its pose is corrected, a robot seems to come nearer that stands still.
  defp gain(%{uncertainty: %{radius: radius}}), do: radius |> max(@gain) |> min(@most_gain)
  defp gain(_percept), do: @gain

  # The blocker is determined once, when the robot gives up: what passes by while it waits is not
  # the cause.
  defp blocker(_progress, _mission, _slot, false), do: nil

  defp blocker(%{blocker: nil}, mission, slot, true),
    do: Blocker.find(mission.percept, slot, SlotPoses.landmark(mission.anchor))

  defp blocker(progress, _mission, _slot, true), do: progress.blocker

  defp watch(progress, mission, slot, error) do
    if walled?(mission.percept, slot) or (error < @reach and obstacle?(mission, slot)),
      do: %{progress | obstacle_ms: progress.obstacle_ms || mission.now_ms},
      else: %{progress | obstacle_ms: nil}
  end

  # The leader has seen less of the walls there.
  defp walled?(%{grid: %{closed?: false} = grid, profile: profile}, slot),
    do: not Grid.free?(grid, Pose.point(slot), profile.radius)

  defp walled?(_percept, _slot), do: false

  # Something that the sonars see where this robot should stand, and that no robot has reported.
  defp obstacle?(%{percept: percept, anchor: anchor}, slot) do
    robots = for {_id, peer} <- percept.peers, do: {peer.pose.x, peer.pose.y, peer.radius}

    percept
    |> Neighbours.unknown(robots ++ SlotPoses.discs(anchor))
    |> Enum.any?(&(Pose.distance(slot, &1.at) < percept.profile.radius + @clear))
  end
end
