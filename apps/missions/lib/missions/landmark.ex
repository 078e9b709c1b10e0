defmodule Missions.Landmark do
  @moduledoc """
  The landmark mission (R58 to R60): search for the landmark, agree on who sees it largest, and
  follow that robot in formation while a person moves the landmark. Pure: events in, effects out.
  `Missions.Landmark.Transitions` is the table of its phases; its parts are modules of their own:

  | part | decides |
  |---|---|
  | `LandmarkTrack` | where the landmark is, by the robot's own eyes |
  | `Rounds` | when a round is opened, what is reported in it, what comes of it |
  | `Leader` | what the leader tells: the anchor, the order, whether the shape is formed |
  | `Shape` | a shape that there is room for |
  | `Follower` | what a follower does: its slot, its gaze, its child |
  | `Marks` | what it finds its pose by, and whether it is sure of its place |
  | `Blocker` | what keeps it from its slot |
  | `Merge` | what becomes of two leaders that meet |
  | `ReferenceInbox` | whose anchor it believes, and when it joins a leader who names it |
  | `Policy` | who may lead, and what a robot does that has lost everybody |

  Time is `percept.at_ms`, compared with whole numbers; there are no timers.
  """
  alias Robot.Behaviour
  alias Robot.Localiser.Anchors
  alias Swarm.{Formation, Message}
  alias Swarm.Agreement.Round
  alias Swarm.Comms.Forwarder
  alias Swarm.Formation.Trail
  alias Missions.Landmark.{Blocker, Follower, Leader, Marks, ReferenceInbox, Rounds}
  alias Missions.Landmark
  alias Missions.Landmark.{LandmarkTrack, Policy, Transitions}

  @behaviour Robot.Mission

  @roam_ms 6_000
  @tries 3
  # Without reports of where things are, a robot must not correct its pose by where they were.
  @unled [anchors: %Anchors{}]
  # A leader without a sign of life for this long is lost.
  @led_ms 2_000

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
      leader_change?: Keyword.get(options, :leader_change, true),
      colour: Keyword.get(options, :colour, Landmark.State.colour()),
      round: Round.new(robot),
      lead: Leader.new(),
      attend: Follower.new(),
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
  def handle({:command, :start}, mission), do: still(%{mission | started?: true})

  def handle({:command, {:formation, kind, spacing}}, mission) do
    case Formation.new(kind, spacing: spacing) do
      {:ok, formation} ->
        still(Leader.reshape(%{mission | formation: formation, asked_no: mission.asked_no + 1}))

      {:error, _line} ->
        still(mission)
    end
  end

  def handle({:command, _other}, mission), do: still(mission)

  def handle({:outcome, {:search, _since}, result}, %{phase: :search} = mission),
    do: still(%{mission | scan: if(result == 1, do: :found, else: :nothing)})

  def handle({:outcome, _tag, _result}, mission), do: still(mission)

  def handle({:message, %Message{kind: :round, from: from, body: letter} = message}, mission) do
    {mission, relays} = relay_letter(mission, message)
    {mission.phase, Rounds.hear(mission, from, letter), relays}
  end

  def handle({:message, %Message{kind: :place, body: anchor}}, mission),
    do: still(ReferenceInbox.anchor(mission, anchor))

  def handle({:message, _other}, mission), do: still(mission)

  def handle({:tick, percept}, mission) do
    mission = %{
      mission
      | percept: percept,
        now_ms: percept.at_ms,
        sight: LandmarkTrack.update(mission.sight, percept, mission.colour),
        trail: if(percept.pose, do: Trail.note(mission.trail, percept.pose), else: mission.trail)
    }

    {mission, letters} = mission |> Policy.update() |> ReferenceInbox.beats() |> Rounds.tick()
    {mission, stages} = step(mission)
    {mission, effects} = act(Transitions.activity(mission.phase), mission)
    effects = if :lists.keymember(:anchors, 1, effects), do: effects, else: effects ++ @unled
    {mission, beats} = relay_beats(mission)
    effects = letters ++ beats ++ stages ++ effects
    {mission.phase, mission, effects ++ [{:claim, claim(mission)}]}
  end

  @impl Robot.Mission
  # The formation, and the numbers of the group's last round and epoch.
  def halted(mission), do: %{enter(mission, :idle) | started?: false}

  # Only robots that take part in the mission handle this.
  defp relay_beats(%{phase: :idle} = mission), do: {mission, []}

  defp relay_beats(%{percept: percept} = mission) do
    {relay, beats} = Forwarder.beats(mission.relay, mission.me, percept.peers, mission.now_ms)
    {%{mission | relay: relay}, beats}
  end

  defp relay_letter(%{percept: percept, phase: phase} = mission, _message)
       when percept == nil or phase == :idle,
       do: {mission, []}

  defp relay_letter(%{percept: percept} = mission, message) do
    {relay, letters} =
      Forwarder.letter(mission.relay, mission.me, percept.peers, message, mission.now_ms)

    {%{mission | relay: relay}, letters}
  end

  defp still(mission), do: {mission.phase, mission, []}

  # Goes from phase to phase along the table; if the next phase ends at once, it goes on at once.
  defp step(mission, stages \\ []) do
    case Transitions.next(mission.phase, &holds?(&1, mission)) do
      phase when phase == mission.phase -> {mission, stages}
      phase -> mission |> enter(phase) |> step(stages ++ stage(phase, mission))
    end
  end

  defp holds?(:started, m), do: m.started?
  defp holds?(:elected, m), do: m.verdict == {:leader, m.me}

  defp holds?(:led, m),
    do: match?({:leader, other} when other != m.me, m.verdict) or ReferenceInbox.joined?(m)

  defp holds?(:nobody, m), do: m.verdict == :nobody
  defp holds?(:nobody_again, m), do: m.verdict == :nobody and m.tries + 1 >= @tries
  defp holds?(:scanned, m), do: m.scan != nil
  defp holds?(:scan_wanted, m), do: m.scan == nil and Rounds.search?(m)
  defp holds?(:sighted, m), do: Landmark.State.sees?(m) or Rounds.search?(m)
  defp holds?(:roamed, m), do: m.now_ms - m.since_ms >= @roam_ms
  defp holds?(:deposed, m), do: Leader.deposed?(m)

  defp holds?(:superseded, m),
    do: m.anchor != nil and m.anchor.epoch > m.epoch and ReferenceInbox.joined?(m)

  defp holds?(:round_open, m), do: Round.open?(m.round)
  defp holds?(:lost_stop, m), do: Policy.lost?(m) and Policy.lost_link(m) == :stop
  defp holds?(:lost_hold, m), do: Policy.lost?(m) and Policy.lost_link(m) == :hold
  defp holds?(:company, m), do: Policy.company?(m)

  # A robot that has a leader leaves the decision to the leader.
  defp holds?(:short, %{phase: :follow} = m) when m.now_ms - m.since_ms < @led_ms, do: false

  defp holds?(:short, %{phase: :follow, anchor_ms: at_ms, now_ms: now})
       when now - at_ms < @led_ms,
       do: false

  defp holds?(:short, m), do: not Round.open?(m.round) and Policy.short?(m, together(m))
  defp holds?(:enough, m), do: Policy.enough?(m, together(m))

  defp together(m), do: length(Rounds.view(m))

  defp enter(mission, phase) do
    mission = %{
      mission
      | since_ms: mission.now_ms,
        role: role(phase) || mission.role,
        led: if(phase == :agree, do: mission.led, else: 0)
    }

    case phase do
      :idle ->
        %{
          mission
          | phase: :idle,
            scan: nil,
            tries: 0,
            verdict: nil,
            leader: nil,
            anchor: nil,
            place: nil,
            round: Round.new(mission.me) |> Map.put(:highest, mission.round.highest)
        }

      :search ->
        %{mission | phase: :search, scan: nil, verdict: nil, rescan?: false}

      :wander ->
        %{mission | phase: :wander, verdict: nil, scan: nil, tries: mission.tries + 1}

      :rest ->
        %{mission | phase: :rest, verdict: nil, scan: :nothing, tries: 0}

      :agree ->
        forget(%{mission | phase: :agree, leader: nil})

      phase when phase in [:wait, :halt, :hold] ->
        %{
          mission
          | phase: phase,
            leader: nil,
            anchor: nil,
            verdict: nil,
            scan: nil,
            round: Round.leave(mission.round)
        }

      :lead ->
        Leader.begin(%{mission | phase: :lead, verdict: nil, tries: 0, leader: mission.me})

      :follow ->
        follow(%{mission | phase: :follow, tries: 0})
    end
  end

  defp role(:lead), do: :leader
  defp role(:follow), do: :follower
  defp role(phase) when phase in [:idle, :search, :wander, :rest], do: :searcher
  defp role(_between), do: nil

  # A robot cannot join by the anchor that it published itself as a leader.
  defp forget(%{anchor: %{leader: me}, me: me} = mission), do: %{mission | anchor: nil}
  defp forget(mission), do: mission

  defp follow(%{verdict: {:leader, leader}} = mission),
    do: Follower.begin(%{mission | verdict: nil, leader: leader})

  defp follow(mission),
    do:
      Follower.begin(%{
        mission
        | leader: mission.anchor.leader,
          epoch: mission.anchor.epoch,
          verdict: nil
      })

  defp stage(:search, _mission), do: [{:stage, :search, %{}}]

  defp stage(:lead, mission),
    do: [{:stage, :elected, %{epoch: mission.epoch, size_ppm: mission.size_ppm}}]

  defp stage(_phase, _mission), do: []

  defp act(:stand, mission), do: {mission, [{:goal, :stand, {Behaviour.Stop, []}}, {:look, 0.0}]}

  defp act(:scan, mission) do
    options = [colour: mission.colour]
    {mission, [{:goal, {:search, mission.since_ms}, {Behaviour.FindBlob, options}}, {:look, 0.0}]}
  end

  defp act(:roam, mission),
    do: {mission, [{:goal, :roam, {Behaviour.Wander, []}}, {:look, 0.0}]}

  defp act(:hold, %{place: nil} = mission), do: act(:stand, mission)

  defp act(:hold, mission) do
    goal = {Behaviour.Follow, target: mission.place, velocity: {0.0, 0.0}}
    {mission, [{:goal, {:hold, mission.since_ms}, goal}, {:look, 0.0}]}
  end

  defp act(:lead, mission), do: Leader.act(mission)
  defp act(:follow, mission), do: Follower.act(mission)

  # What the heartbeat reports about the mission.
  defp claim(mission) do
    leading? = mission.phase == :lead

    %{
      phase: mission.phase,
      epoch: mission.epoch,
      leader: mission.leader,
      sight:
        if(Landmark.State.sees?(mission),
          do: %{
            size_ppm: mission.sight.size_ppm,
            distance: mission.sight.distance && round(mission.sight.distance * 1000)
          }
        ),
      standing: standing?(mission),
      sd: Marks.told(mission),
      uncertainty: uncertainty(mission.percept),
      in_place: mission.phase == :follow and mission.attend.in_place?,
      unsure: mission.phase == :follow and mission.attend.unsure?,
      blocked: mission.phase == :follow and mission.attend.blocked?,
      blocked_by: if(mission.phase == :follow, do: Blocker.words(mission.attend.blocker)),
      formed: leading? and mission.lead.formed?,
      anchor: if(leading?, do: mission.anchor)
    }
  end

  defp uncertainty(%{uncertainty: %{radius: radius}}), do: radius
  defp uncertainty(_no_pose), do: nil

  defp standing?(%{phase: :lead, percept: percept}), do: Landmark.State.slow?(percept, 0.05)
  defp standing?(%{phase: :follow} = mission), do: mission.attend.holding?
  defp standing?(%{phase: :hold, percept: percept}), do: Landmark.State.slow?(percept, 0.05)
  defp standing?(%{phase: phase}), do: phase in [:idle, :search, :agree, :rest, :wait, :halt]
end
