defmodule Missions.Landmark do
  @moduledoc """
  Carries out the landmark mission: searches for the landmark, agrees on the robot that sees it largest, and follows
  that robot in formation while a person moves the landmark. Pure: events in, effects out.
  `Missions.Landmark.Transitions` is the table of its phases, with its `.Conditions` and what a phase begins with
  (`.Entry`); the parts of the mission are modules of their own:

  | part | decides |
  |---|---|
  | `LandmarkTrack` | where the landmark is, by the robot's own camera |
  | `Lookout`, `Coverage` | where it looks next, and what has been looked at |
  | `Rounds` | when a round is opened, what is reported in it, what comes of it |
  | `Leader` | what the leader tells: the anchor, the order, whether the shape is formed; `.Loss` what it does without the landmark |
  | `Shape` | a shape that there is room for |
  | `SelfReport`, `Claim` | what it claims of itself: to people, and to the others |
  | `Follower` | what a follower does: its slot, its child; `.Gaze` where it looks; `.Guide` tells one without pictures where it stands |
  | `Marks` | what it finds its pose by, and whether it is sure of its place |
  | `Blocker` | what keeps it from its slot |
  | `Signs` | which formation the mark that it sees asks for |
  | `Merge` | what becomes of two leaders that meet |
  | `EpochFilter` | which robot is left out, because it claims an epoch that none can have reached |
  | `ReferenceInbox` | whose anchor it believes, and when it joins a leader that names it |
  | `Policy` | which robot may lead, and what one does that has lost all others |

  Time is `percept.at_ms`, compared with whole numbers; there are no timers.
  """
  alias Robot.Localiser.Anchors
  alias Swarm.{Formation, Message}
  alias Swarm.Agreement.Round
  alias Swarm.Formation.Trail
  alias Missions.Landmark
  alias Missions.Landmark.{EpochFilter, Follower, LandmarkTrack, Leader, Lookout, Policy}
  alias Missions.Landmark.{ReferenceInbox, Rounds, SelfReport, Signs, Transitions}
  alias Missions.Landmark.Leader.Loss
  alias Missions.Landmark.Transitions.{Conditions, Entry}

  @behaviour Robot.Mission

  @doc """
  A robot's mission, with options that `options/2` has checked (`Missions.Landmark.Options`).
  """
  @impl Robot.Mission
  def init(robot, options \\ []) do
    {of, lost_link} = Policy.of(options)

    mission = %Landmark.State{
      me: robot,
      formation: Keyword.get(options, :formation, {:column, 1.0}),
      assign: Keyword.get(options, :assign, :chain),
      signs: Signs.new(Keyword.get(options, :formations, [])),
      leader_change?: Keyword.get(options, :leader_change, true),
      colour: Keyword.get(options, :colour, Landmark.State.colour()),
      round: Round.new(robot),
      leadership: Leader.new(),
      follower: Follower.new(),
      of: of,
      lost_link: lost_link
    }

    {mission.phase, mission, []}
  end

  @impl Robot.Mission
  defdelegate options(options, robots), to: Landmark.Options, as: :check

  @impl Robot.Mission
  defdelegate option_table, to: Landmark.Options, as: :table

  @impl Robot.Mission
  def messages, do: {1, round: :shared, claim: :shared, looked: Lookout.message()}

  @impl Robot.Mission
  def claims, do: {3, Landmark.Claim}

  @impl Robot.Mission
  defdelegate stale(claim), to: Landmark.Claim

  @impl Robot.Mission
  def commands, do: [:formation]

  @impl Robot.Mission
  def roles,
    do: %{lead: :leads, follow: :follows, search: :searches, rest: :rests, elected: :elects}

  @impl Robot.Mission
  defdelegate account(claim), to: Landmark.Claim

  @impl Robot.Mission
  defdelegate shape(claim, pose, ahead_m), to: Landmark.SlotPoses

  @impl Robot.Mission
  defdelegate place(mission, at_ms), to: Landmark.SlotPoses

  @impl Robot.Mission
  defdelegate phases, to: Transitions

  @impl Robot.Mission
  defdelegate explain(mission), to: Landmark.Explanation, as: :lines

  @impl Robot.Mission
  def handle({:command, :start}, mission), do: still(%{mission | started?: true})

  def handle({:command, {:formation, kind, spacing}}, mission) do
    case Formation.new(kind, spacing: spacing) do
      {:ok, formation} ->
        still(Leader.reshape(mission, formation))

      {:error, _line} ->
        still(mission)
    end
  end

  def handle({:command, _other}, mission), do: still(mission)

  def handle({:outcome, {:search, _since}, result}, %{phase: :search} = mission),
    do: still(searched(mission, result))

  def handle({:outcome, {:roam, leg}, result}, %{phase: :wander} = mission),
    do: still(Lookout.ended(mission, leg, result))

  def handle({:outcome, tag, result}, %{phase: :lead} = mission),
    do: still(Loss.ended(mission, tag, result))

  def handle({:outcome, _tag, _result}, mission), do: still(mission)

  def handle({:message, %{kind: :looked, from: from, body: body}}, mission) when is_list(body),
    do: still(Lookout.hear(mission, from, body))

  # The receiver has checked it, but on its way to here any process on this node may have put in another.
  def handle({:message, message}, %{round: %{view: view}} = mission),
    do: message |> Message.check(view) |> hear(mission)

  def handle({:tick, percept}, mission) do
    awake = Rounds.wake(mission, percept.at_ms)

    mission = %{
      awake
      | percept: percept,
        now_ms: percept.at_ms,
        pictured_ms: pictured_ms(mission, percept),
        sight: LandmarkTrack.update(mission.sight, percept, mission.colour),
        trail: if(percept.pose, do: Trail.note(mission.trail, percept.pose), else: mission.trail)
    }

    mission = Landmark.State.note_company(mission)
    mission = EpochFilter.update(mission, Landmark.State.company(mission).epochs)
    # Of others, if it has left some out.
    mission =
      mission |> Landmark.State.note_company() |> Policy.update() |> ReferenceInbox.beats()

    {mission, letters} = Rounds.tick(mission)
    {mission, stages} = step(mission)
    {mission, signs} = Signs.read(mission)
    {mission, effects} = mission.phase |> Transitions.activity() |> act(mission)

    effects =
      if :lists.keymember(:anchors, 1, effects),
        do: effects,
        else: effects ++ [anchors: unled(mission)]

    {mission, refused} = EpochFilter.tell(mission)
    effects = letters ++ stages ++ signs ++ refused ++ effects
    {mission.phase, mission, effects ++ [{:claim, SelfReport.claim(mission)}]}
  end

  defp pictured_ms(%{pictured_ms: ms}, %{detections: nil, at_ms: at_ms}), do: ms || at_ms
  defp pictured_ms(_mission, %{at_ms: at_ms}), do: at_ms

  # Without reports of where things are, a robot must not correct its pose by where they were. Until
  # it leads for the first time, no robot has taken its places from it.
  #
  # On a long search the walls of its plan correct it.
  defp unled(%{lookout: lookout, phase: phase})
       when lookout != nil and phase in [:search, :agree, :wander, :rest],
       do: %Anchors{}

  defp unled(%{phase: phase, leadership: %{sequence: 0}, colour: colour})
       when phase in [:search, :agree],
       do: %Anchors{standing: colour, walls?: false}

  defp unled(_mission), do: %Anchors{walls?: false}

  defp hear({:ok, %Message{kind: :round, from: from, body: letter}}, mission),
    do: still(Rounds.hear(mission, from, letter))

  defp hear({:ok, %Message{kind: :claim, body: claim}}, mission) do
    case Landmark.Claim.of(%{claim: claim}) do
      %{anchor: nil} -> still(mission)
      %{anchor: anchor} -> still(ReferenceInbox.anchor(mission, anchor))
    end
  end

  defp hear(_other, mission), do: still(mission)

  @impl Robot.Mission
  # The formation, and the numbers of the group's last round and epoch.
  def halted(mission), do: %{Entry.enter(mission, :idle) | started?: false}

  defp searched(mission, 1), do: %{mission | scan: :found}

  defp searched(mission, _nothing) do
    mission = %{mission | scan: :nothing}
    if Lookout.alone?(mission), do: Lookout.turned(mission), else: mission
  end

  defp still(mission), do: {mission.phase, mission, []}

  # Goes from phase to phase along the table; if the next phase ends at once, it goes on at once.
  defp step(mission, stages \\ []) do
    case Transitions.next(mission.phase, &Conditions.holds?(&1, mission)) do
      phase when phase == mission.phase -> {mission, stages}
      phase -> mission |> Entry.enter(phase) |> step(stages ++ stage(phase, mission))
    end
  end

  # Of all: one that searches from room to room looks around again and again.
  defp stage(:search, %{lookout: nil}), do: [{:stage, :search, %{}}]

  defp stage(:lead, mission),
    do: [{:stage, :elected, %{epoch: mission.epoch, size_ppm: mission.size_ppm}}]

  defp stage(_phase, _mission), do: []

  defp act(:stand, %{phase: :rest, lookout: %{told?: false}} = mission), do: Lookout.act(mission)

  defp act(:stand, mission),
    do: {mission, [{:goal, :stand, {Robot.Behaviour.Stop, []}}, {:look, 0.0}]}

  defp act(:scan, mission) do
    options = [colour: mission.colour]

    {mission,
     [{:goal, {:search, mission.since_ms}, {Robot.Behaviour.FindBlob, options}}, {:look, 0.0}]}
  end

  defp act(:roam, %{lookout: %{}} = mission), do: Lookout.act(mission)

  defp act(:roam, mission),
    do: {mission, [{:goal, :roam, {Robot.Behaviour.Wander, []}}, {:look, 0.0}]}

  defp act(:hold, %{place: nil} = mission), do: act(:stand, mission)

  defp act(:hold, mission) do
    goal = {Robot.Behaviour.Follow, target: mission.place, velocity: {0.0, 0.0}}
    {mission, [{:goal, {:hold, mission.since_ms}, goal}, {:look, 0.0}]}
  end

  defp act(:lead, mission), do: Leader.act(mission)
  defp act(:follow, mission), do: Follower.act(mission)
end
