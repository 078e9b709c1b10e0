defmodule Missions.Landmark.Follower do
  @moduledoc false
  # Decides what a follower does: it drives to its slot, watches what it can correct its pose by, and passes
  # the reference on to its child. Pure.
  #
  # Without a fresh anchor it stands still: that is the leader's lease (1 s since it was heard).
  # Meanwhile it looks at the landmark, because a round may ask next how large it sees it.
  #
  # A follower that stands in its slot by its own estimate, but does not know its place well enough
  # to say so (`Missions.Landmark.Marks.sure?/2`), is `unsure?`: neither in place nor blocked. So is one on its way
  # that knows its place less well than to a metre: it cannot tell whether it comes nearer.
  alias Hal.Pose
  alias Missions.Landmark
  alias Missions.Landmark.Follower.{Facing, Gaze, Guide, Progress}
  alias Missions.Landmark.{Marks, SlotPoses}
  alias Swarm.Formation.Chain

  @lease_ms 1_000
  @in_place 0.25
  @near 0.15
  @sure 1.0
  @slow 0.05

  defstruct in_place?: false,
            unsure?: false,
            holding?: false,
            told: {0, 0},
            landmark: nil,
            progress: %Progress{},
            facing: %Facing{},
            gaze: %Gaze{},
            guide: %Guide{}

  @typedoc """
  `told` is the epoch and sequence number of the anchor that was last passed on, `landmark` is
  where the landmark stood when this robot was last in place.
  """
  @type t :: %__MODULE__{
          in_place?: boolean(),
          unsure?: boolean(),
          holding?: boolean(),
          told: {non_neg_integer(), non_neg_integer()},
          landmark: {integer(), integer()} | nil,
          progress: Progress.t(),
          facing: Facing.t(),
          gaze: Gaze.t(),
          guide: Guide.t()
        }

  @doc "The state of a robot that follows none yet."
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
       [{:goal, :stand, {Robot.Behaviour.Stop, []}}, {:look, Gaze.waiting(mission)}]}
    else
      follow(mission, place, age_ms)
    end
  end

  # If a leader is silent, its followers stay where they are.
  defp wait(follower, age_ms) do
    %{
      follower
      | in_place?: false,
        unsure?: false,
        holding?: true,
        progress: Progress.wait(follower.progress, age_ms)
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
    follower = mission.follower
    progress = Progress.note(follower.progress, mission, slot, error, there?)
    gaze = Gaze.note(follower.gaze, mission, there?)
    vague? = not progress.blocked? and vague?(mission.percept)

    follower = %{
      follower
      | in_place?: there? and sure?,
        unsure?: if(there?, do: not sure?, else: vague?),
        holding?: resting? and error <= @near,
        told: told,
        # Remembers where the landmark stood when this robot was last in place, or began to
        # follow.
        landmark: landmark(mission, there?),
        progress: progress,
        gaze: gaze,
        guide: Guide.note(follower.guide, mission, there? and sure?),
        facing: Facing.note(follower.facing, mission, slot, where(error, there?, sure?), leader)
    }

    options = [
      target: target(follower, mission, slot, leader),
      velocity: velocity,
      discs: SlotPoses.discs(mission.anchor)
    ]

    goal = {:goal, {:slot, mission.epoch}, {Robot.Behaviour.Follow, options}}
    mission = %{mission | place: slot, follower: follower}

    {mission,
     place ++ [goal, {:look, Gaze.pan(mission, leader)}, {:anchors, Marks.anchors(mission)}]}
  end

  defp vague?(%{uncertainty: %{radius: radius}}), do: radius > @sure
  defp vague?(_percept), do: false

  defp target(%{facing: facing, guide: guide, gaze: gaze}, mission, slot, leader) do
    ahead = SlotPoses.landmark(mission.anchor) || Pose.point(leader)
    slot = Guide.turned(guide, mission, Facing.turned(facing, slot), ahead)
    Gaze.turned(gaze, mission, slot)
  end

  defp where(_error, true, sure?), do: if(sure?, do: :in_place, else: :unsure)
  defp where(error, false, _sure?), do: if(error > @in_place, do: :away, else: :turning)

  defp landmark(%{anchor: anchor, follower: follower}, in_place?),
    do: if(in_place? or follower.landmark == nil, do: anchor.landmark, else: follower.landmark)

  # From parent to child: n - 1 messages for the whole group.
  defp pass_on(%{anchor: anchor, follower: follower} = mission) do
    news = {anchor.epoch, anchor.sequence}
    child = Chain.child([anchor.leader | anchor.order], mission.me)

    if news != follower.told and child != nil,
      do: {news, [{:claim, [child], %{anchor: anchor}}]},
      else: {follower.told, []}
  end
end
