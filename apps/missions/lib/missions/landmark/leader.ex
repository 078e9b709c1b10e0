defmodule Missions.Landmark.Leader do
  @moduledoc false
  # Decides what the leader does besides tracking the landmark: it announces where it is supposed to be
  # (`.Announcement`), maintains the order of the slots when robots leave and join (`.Slots`), and
  # judges whether the shape is formed. Pure.
  alias Hal.Pose
  alias Robot.Localiser.Anchors
  alias Robot.Percept
  alias Swarm.Formation
  alias Swarm.Membership.NameSet
  alias Missions.Landmark
  alias Missions.Landmark.{Claim, LandmarkTrack, Merge, Shape}
  alias Missions.Landmark.Leader.{Announcement, Loss, Slots}

  # A landmark farther off than this is driven after, to `Slots.near/0`.
  @far 1.9
  # How far from its ring around the landmark a leader may stand.
  @ring_slack 0.15
  # A shape is formed when it has been right for this long, and no longer when it was wrong for
  # this long.
  @formed_ms 1_000
  @unformed_ms 500
  # People are told again that a shape is formed if it was not for this long, or if the leader has moved by so much (metres,
  # radians), or the shape or its robots have changed: not of each time that a robot at the edge of its place moves.
  @again_ms 20_000
  @moved 0.3
  # The landmark is lost if it was not seen for this long; `Loss` tells what the leader does about it.
  @lost_ms 3_000
  @unheard_ms 1_500
  # For this long a new leader sends its place to all, not only to its child.
  @fresh_ms 500

  defstruct sequence: 0,
            good_ms: nil,
            bad_ms: nil,
            formed?: false,
            told: nil,
            unformed_ms: 0,
            lost?: false,
            no_room?: false,
            heard_ms: nil,
            loss: %Loss{},
            shape: %Shape{}

  @typedoc """
  `sequence` numbers the anchors; the shape has been right since `good_ms`, or wrong since
  `bad_ms`; it is not formed since `unformed_ms`, and people were `told` of where the leader stood in which shape when it was;
  `heard_ms` is when a robot was last known to hear this leader.
  """
  @type t :: %__MODULE__{
          sequence: non_neg_integer(),
          good_ms: integer() | nil,
          bad_ms: integer() | nil,
          formed?: boolean(),
          told: {Pose.t(), shape :: term()} | nil,
          unformed_ms: integer(),
          lost?: boolean(),
          no_room?: boolean(),
          heard_ms: integer() | nil,
          loss: Loss.t(),
          shape: Shape.t()
        }

  @doc "The state of a robot that does not lead yet."
  @spec new() :: t()
  def new, do: %__MODULE__{}

  @doc "Takes the lead with the order of the round's record."
  @spec begin(Landmark.State.t()) :: Landmark.State.t()
  def begin(mission) do
    %{
      mission
      | leadership: %__MODULE__{sequence: mission.leadership.sequence, heard_ms: mission.now_ms},
        scan: nil,
        anchor: nil
    }
  end

  @doc """
  Takes a new shape that was asked for, which all learn from the anchor; `:cost` assigns the slots again.
  """
  @spec reshape(Landmark.State.t(), Formation.t()) :: Landmark.State.t()
  def reshape(mission, formation) do
    leadership = %{
      mission.leadership
      | formed?: false,
        told: nil,
        good_ms: nil,
        bad_ms: nil,
        shape: Shape.new()
    }

    asked_no = mission.asked_no + 1
    %{mission | formation: formation, asked_no: asked_no, leadership: leadership}
  end

  @doc """
  Whether a leader stops leading: it gives way to a later one, or no robot has heard it for 1.5 s
  though it is not alone. Under the policy `:majority` more than half of the fleet must hear it.
  """
  @spec deposed?(Landmark.State.t()) :: boolean()
  def deposed?(mission) do
    Merge.yields?(mission) or
      ((mission.order != [] or mission.of > 0) and
         mission.now_ms - mission.leadership.heard_ms >= @unheard_ms)
  end

  @doc "One tick of leading."
  @spec act(Landmark.State.t()) :: {Landmark.State.t(), [tuple()]}
  def act(mission) do
    mission = hear(mission)
    if mission.percept.pose, do: lead(mission), else: blind(mission)
  end

  # A leader that does not know where it is cannot tell others where to stand; they soon stop. Nor does it know that
  # they stand where they should.
  defp blind(mission) do
    leadership = %{mission.leadership | formed?: false, good_ms: nil, bad_ms: nil}
    mission = %{mission | anchor: nil, leadership: leadership}
    {mission, [{:goal, :stand, {Robot.Behaviour.Stop, []}}, {:look, 0.0}]}
  end

  defp lead(mission) do
    mission = mission |> Loss.update() |> Slots.update() |> Announcement.update()
    {mission, formed} = judge(mission)
    {mission, lost} = miss(mission)
    {mission, no_room} = room(mission)
    told = told(mission)

    place =
      if told == [],
        do: [],
        else: [{:claim, told, %{anchor: mission.anchor}}]

    orders = [goal(mission), {:look, 0.0}, {:anchors, %Anchors{walls?: false}}]
    {mission, formed ++ lost ++ no_room ++ place ++ orders}
  end

  # When enough followers for a majority last reported that they hear this leader.
  defp hear(%{of: of} = mission) when of > 0 do
    told =
      for {_id, %{at_ms: at_ms, beat: %{leader: leader, heard: heard}}} <- mission.percept.peers,
          leader == mission.me and NameSet.member?(heard, mission.me),
          do: at_ms

    heard_ms =
      case div(of, 2) do
        0 -> mission.now_ms
        others -> told |> Enum.sort(:desc) |> Enum.at(others - 1, mission.leadership.heard_ms)
      end

    put_in(mission.leadership.heard_ms, max(heard_ms, mission.leadership.heard_ms))
  end

  # If it is alone, no robot can hear it, and a robot that comes needs time to hear it.
  defp hear(mission) do
    heard? =
      mission
      |> Landmark.State.beats()
      |> Enum.any?(fn {_id, beat} -> NameSet.member?(beat.heard, mission.me) end)

    if heard? or mission.order == [],
      do: put_in(mission.leadership.heard_ms, mission.now_ms),
      else: mission
  end

  # The child passes it on; but at first all robots stand and wait for it.
  defp told(mission) do
    if mission.now_ms - mission.since_ms < @fresh_ms,
      do: mission.order,
      else: Enum.take(mission.order, 1)
  end

  # All followers are in place, and the leader is still in front of the landmark, for a second.
  defp judge(mission) do
    good? =
      Landmark.State.sees?(mission) and Landmark.State.slow?(mission.percept, 0.05) and
        Percept.astray(mission.percept) == nil and mission.leadership.shape.rung != nil and
        Enum.all?(mission.order, &in_place?(mission, &1))

    now = mission.now_ms
    leadership = mission.leadership

    leadership =
      if good?,
        do: %{leadership | good_ms: leadership.good_ms || now, bad_ms: nil},
        else: %{leadership | bad_ms: leadership.bad_ms || now, good_ms: nil}

    cond do
      not leadership.formed? and good? and now - leadership.good_ms >= @formed_ms ->
        tell(%{mission | leadership: %{leadership | formed?: true}})

      leadership.formed? and not good? and now - leadership.bad_ms >= @unformed_ms ->
        {%{mission | leadership: %{leadership | formed?: false, unformed_ms: now}}, []}

      true ->
        {%{mission | leadership: leadership}, []}
    end
  end

  defp tell(%{leadership: leadership, percept: %{pose: pose}} = mission) do
    shape = {mission.order, mission.asked_no, leadership.shape.formation, leadership.shape.spots}

    if news?(leadership, pose, shape, mission.now_ms),
      do: {put_in(mission.leadership.told, {pose, shape}), [{:stage, :formed, formed(mission)}]},
      else: {mission, []}
  end

  defp news?(%{told: {then, shape}} = leadership, pose, shape, now) do
    turned = abs(Pose.wrap(pose.heading - then.heading))

    now - leadership.unformed_ms >= @again_ms or Pose.distance(then, pose) > @moved or
      turned > @moved
  end

  defp news?(_other, _pose, _shape, _now), do: true

  # Of how many followers it is said; if there was no room for the shape that was asked for, which one it is instead.
  defp formed(%{leadership: %{shape: %{rung: rung}}} = mission) do
    facts = %{
      epoch: mission.epoch,
      size_ppm: mission.sight.size_ppm,
      followers: length(mission.order)
    }

    if rung == :asked, do: facts, else: Map.merge(facts, %{as: rung, asked: asked(mission)})
  end

  defp asked(%{formation: {kind, spacing}}), do: "#{kind} #{spacing}"

  # There is no shape in which all followers have room where the leader stands; said once, until there is one.
  defp room(%{leadership: %{shape: %{rung: nil}, no_room?: false}} = mission) do
    facts = %{epoch: mission.epoch, asked: asked(mission), followers: length(mission.order)}
    {put_in(mission.leadership.no_room?, true), [{:stage, :cannot_form, facts}]}
  end

  defp room(mission),
    do: {put_in(mission.leadership.no_room?, mission.leadership.shape.rung == nil), []}

  defp in_place?(mission, id) do
    case mission.percept.peers do
      %{^id => %{beat: beat, at_ms: at_ms}} ->
        claim = Claim.of(beat)
        claim.in_place and claim.epoch == mission.epoch and mission.now_ms - at_ms < 1_000

      _unknown ->
        false
    end
  end

  defp miss(mission) do
    seen_ms = (mission.sight && mission.sight.at_ms) || mission.since_ms
    lost? = mission.now_ms - max(seen_ms, mission.since_ms) >= @lost_ms

    stage =
      if lost? and not mission.leadership.lost?,
        do: [{:stage, :lost, %{epoch: mission.epoch}}],
        else: []

    told = if lost?, do: nil, else: mission.leadership.told
    {%{mission | leadership: %{mission.leadership | lost?: lost?, told: told}}, stage}
  end

  # A new leader may have seen the landmark with its camera turned aside, and look ahead now: it turns to where the landmark
  # was.
  defp goal(mission), do: Loss.goal(mission) || track(mission)

  defp track(mission) do
    {near, far} = range(mission)
    place = LandmarkTrack.where(mission.sight)
    options = [colour: mission.colour, near: near, far: far, place: place]
    {:goal, {:track, mission.epoch}, {Robot.Behaviour.TrackBlob, options}}
  end

  defp range(%{formation: {:circle, _d} = formation, order: order}) do
    ring = Formation.ring(formation, length(order) + 1)
    {ring - @ring_slack, ring + @ring_slack}
  end

  defp range(_mission), do: {Slots.near(), @far}
end
