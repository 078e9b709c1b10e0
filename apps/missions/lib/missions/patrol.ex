defmodule Missions.Patrol do
  @moduledoc """
  Patrols: points are visited for ever by a fleet without a leader, by ALLIANCE's motivations
  (`Missions.Patrol.Motivation`), by auction (`Missions.Patrol.Auction`) or by rules (`Missions.Patrol.Helping`). Pure; written with the interface of
  `Robot.Mission` alone.

  A point is due when no robot has seen it for a quarter of the `period`; a robot within 0.5 m of it sees it. Each robot
  tells the others once a second, and at once when that changes, at which point it is, and how long ago every point was
  seen; so a robot that hears none visits all points by itself, and one that has died is replaced at its point within
  `Missions.Patrol.Motivation.takeover_ms/0`, if another is free.

  Its phases are `:watch`, when it stands until a point wants it, and `:visit`. It claims `formed` while every point was seen
  within the period. Options: `Missions.Patrol.Options`.
  """
  alias Hal.Pose
  alias Missions.Patrol.{Ages, Auction, Helping, Motivation, Options}

  @behaviour Robot.Mission

  # Metres from which a point is seen, and how near a robot drives.
  @seen 0.5
  @tolerance 0.3
  @tell_ms 1_000
  # A point that this robot could not reach is left to others for this long.
  @aside_ms 30_000
  # A robot that was silent for so long is forgotten; so many are remembered.
  @forget_ms 60_000
  @most_peers 256
  @day_ms 86_400_000
  @longest_step_ms 1_000

  @kept [:me, :points, :plan, :period_ms, :by]
  @enforce_keys @kept
  defstruct @kept ++
              [
                now_ms: nil,
                seen: %{},
                aside: %{},
                peers: %{},
                motivation: %Motivation{},
                visits: 0,
                told_ms: nil,
                told: nil,
                why: nil,
                because: nil,
                started?: false
              ]

  @typedoc """
  `points` by number; `plan` is their number in 28 bits, so that only robots with the same points understand each other;
  `seen` and `aside` are times by point: when it was last seen, until when it is left to others; `why` it gave up its last
  point; `because` are the lines of the rules by which it took its point.
  """
  @type t :: %__MODULE__{
          me: atom(),
          points: %{non_neg_integer() => Pose.point()},
          plan: non_neg_integer(),
          period_ms: pos_integer(),
          by: :motivation | :auction | :rules,
          now_ms: integer() | nil,
          seen: %{non_neg_integer() => integer()},
          aside: %{non_neg_integer() => integer()},
          peers: %{atom() => Motivation.peer()},
          motivation: Motivation.t(),
          visits: non_neg_integer(),
          told_ms: integer() | nil,
          told: non_neg_integer() | nil,
          why: String.t() | nil,
          because: [String.t()] | nil,
          started?: boolean()
        }

  @impl Robot.Mission
  def phases, do: [:watch, :visit]

  @impl Robot.Mission
  defdelegate option_table, to: Options, as: :table

  @impl Robot.Mission
  def commands, do: []

  @impl Robot.Mission
  def messages do
    {1,
     doing: [
       plan: [{:integer, 0, 0xFFFFFFF}, required: true],
       point: [{:or, nil, {:integer, 0, Options.most() - 1}}, required: true],
       far_mm: [{:integer, 0, 20_000_000, "mm"}, required: true],
       busy_ms: [{:integer, 0, @day_ms, "ms"}, required: true],
       ages: [{:list, {:or, nil, {:integer, 0, @day_ms, "ms"}}, Options.most()}, required: true]
     ]}
  end

  @impl Robot.Mission
  def init(robot, options) do
    points = Options.points(options)

    mission = %__MODULE__{
      me: robot,
      points: points |> Enum.with_index() |> Map.new(fn {point, number} -> {number, point} end),
      plan: :erlang.phash2(points, 0x10000000),
      period_ms: round(options[:period] * 1_000),
      by: options[:by]
    }

    {:idle, mission, []}
  end

  @impl Robot.Mission
  def halted(mission),
    do: struct!(__MODULE__, mission |> Map.take(@kept) |> Map.to_list())

  @impl Robot.Mission
  def handle({:command, :start}, mission), do: result(%{mission | started?: true}, [])

  # Others count from the last tick, which is at most 100 ms ago.
  def handle({:message, %{kind: :doing, from: from, body: said}}, %{now_ms: now_ms} = mission)
      when now_ms != nil,
      do: result(hear(mission, from, Map.new(said)), [])

  def handle(
        {:outcome, {:visit, n, point}, outcome},
        %{visits: n, motivation: %{active: point}} = mission
      )
      when outcome != 1,
      do: result(give_up(mission, point, outcome), [])

  def handle({:tick, %{pose: nil}}, mission), do: result(mission, [])

  def handle({:tick, percept}, %{started?: true} = mission) do
    step_ms = min(percept.at_ms - (mission.now_ms || percept.at_ms), @longest_step_ms)
    before = mission.motivation.active
    mission = %{mission | now_ms: percept.at_ms} |> look(percept.pose) |> prune()
    tasks = tasks(mission, percept.pose)

    {motivation, because} = choose(mission, tasks, percept, step_ms)
    mission = taken(%{mission | motivation: motivation}, before, because)
    {mission, told} = tell(mission, percept.pose)
    stages = if motivation.active != before, do: taken_over(mission), else: []
    result(mission, stages ++ told ++ [goal(mission), {:look, 0.0}, {:claim, claim(mission)}])
  end

  def handle(_event, mission), do: result(mission, [])

  @impl Robot.Mission
  def explain(mission) do
    ages = for {n, _point} <- mission.points, do: Ages.words(mission.seen, n, mission.now_ms)
    m = for {number, m} <- mission.motivation.m, m > 0, do: "#{number + 1}: #{round(m)}"

    [
      {"at point",
       if(mission.motivation.active, do: "#{mission.motivation.active + 1}", else: "none")},
      {"points, seconds since seen", Enum.join(ages, " ")}
    ] ++
      if mission.by == :rules,
        do: for(line <- mission.because || [], do: {"took it because", String.trim(line)}),
        else: [{"motivations", if(m == [], do: "none", else: Enum.join(m, ", "))}]
  end

  @impl Robot.Mission
  def layer(mission) do
    points =
      for {number, {x, y}} <- Enum.sort(mission.points) do
        age = Ages.words(mission.seen, number, mission.now_ms)
        {x, y, "#{number + 1}: #{if age == "never", do: "not seen yet", else: "#{age} s ago"}"}
      end

    [{:points, "points, and how long ago a robot saw them", points}]
  end

  defp result(%{started?: false} = mission, effects), do: {:idle, mission, effects}
  defp result(mission, effects), do: {phase(mission), mission, effects}

  defp phase(%{motivation: %{active: nil}}), do: :watch
  defp phase(_mission), do: :visit

  # Another set of points says nothing about these.
  defp hear(%{plan: plan, points: points} = mission, from, %{plan: plan, ages: ages} = said)
       when length(ages) == map_size(points) do
    if is_map_key(mission.peers, from) or map_size(mission.peers) < @most_peers do
      peer = %{
        at_ms: mission.now_ms,
        doing: said.point,
        far: said.far_mm / 1_000,
        busy_ms: said.busy_ms
      }

      seen = Ages.hear(mission.seen, ages, mission.now_ms)
      %{mission | peers: Map.put(mission.peers, from, peer), seen: seen}
    else
      mission
    end
  end

  defp hear(mission, _from, _of_others), do: mission

  defp look(mission, pose),
    do: %{mission | seen: Ages.look(mission.seen, mission.points, pose, @seen, mission.now_ms)}

  defp prune(mission) do
    peers =
      for {id, peer} <- mission.peers, mission.now_ms - peer.at_ms < @forget_ms, do: {id, peer}

    %{mission | peers: Map.new(peers)}
  end

  defp tasks(mission, pose) do
    for {number, point} <- Enum.sort(mission.points) do
      due? = age_ms(mission, number) >= div(mission.period_ms, 4)
      free? = mission.now_ms >= Map.get(mission.aside, number, mission.now_ms)
      %{number: number, needed?: due? and free?, far: Pose.distance(pose, point)}
    end
  end

  defp choose(%{by: :motivation, motivation: m} = mission, tasks, %{at_ms: at_ms}, step_ms),
    do: {Motivation.tick(m, mission.me, tasks, mission.peers, at_ms, step_ms), nil}

  defp choose(%{motivation: m} = mission, tasks, %{at_ms: at_ms, peers: places}, _step_ms) do
    bids =
      for {id, _said} <- mission.peers, %{pose: pose} <- [places[id]], into: %{} do
        {id, Map.new(mission.points, fn {n, point} -> {n, Pose.distance(pose, point)} end)}
      end

    if mission.by == :rules,
      do: Helping.tick(m, mission.me, tasks, mission.peers, at_ms, bids),
      else: {Auction.tick(m, mission.me, tasks, mission.peers, at_ms, bids), nil}
  end

  # A point that no robot has ever seen has been due for ever.
  defp age_ms(mission, number), do: Ages.of(mission.seen, number, mission.now_ms)

  defp give_up(mission, point, outcome) do
    why =
      if outcome == 0,
        do: "no way to point #{point + 1}",
        else: "something before point #{point + 1}"

    aside = Map.put(mission.aside, point, (mission.now_ms || 0) + @aside_ms)
    %{mission | aside: aside, why: why, motivation: Motivation.leave(mission.motivation)}
  end

  # Each visit has a tag of its own, so that the outcome of a former one is not taken for its.
  defp taken(%{motivation: %{active: active}} = mission, before, _because)
       when active in [nil, before],
       do: mission

  defp taken(mission, _before, because),
    do: %{mission | visits: mission.visits + 1, why: nil, because: because}

  defp taken_over(%{motivation: %{active: nil}}), do: []

  defp taken_over(%{motivation: %{active: active}} = mission) do
    dead =
      for {id, %{doing: ^active} = peer} <- mission.peers,
          not Motivation.heard?(peer, mission.now_ms),
          do: id

    for from <- Enum.take(Enum.sort(dead), 1),
        do: {:stage, :taken_over, %{says: "takes point #{active + 1} over from #{from}"}}
  end

  defp tell(%{motivation: %{active: active}} = mission, pose) do
    if mission.told_ms == nil or active != mission.told or
         mission.now_ms - mission.told_ms >= @tell_ms,
       do:
         {%{mission | told_ms: mission.now_ms, told: active},
          [{:tell, :all, :doing, said(mission, pose)}]},
       else: {mission, []}
  end

  defp said(%{motivation: %{active: active, since_ms: since_ms}} = mission, pose) do
    [
      plan: mission.plan,
      point: active,
      far_mm:
        if(active,
          do: min(round(Pose.distance(pose, mission.points[active]) * 1_000), 20_000_000),
          else: 0
        ),
      busy_ms: if(active, do: min(mission.now_ms - since_ms, @day_ms), else: 0),
      ages: Ages.told(mission.seen, mission.points, mission.now_ms)
    ]
  end

  defp goal(%{motivation: %{active: nil}}), do: {:goal, :stand, {Robot.Behaviour.Stop, []}}

  defp goal(%{motivation: %{active: active}} = mission) do
    {x, y} = mission.points[active]

    {:goal, {:visit, mission.visits, active},
     {Robot.Behaviour.Goto, x: x, y: y, tolerance: @tolerance}}
  end

  defp claim(%{motivation: %{active: active}} = mission) do
    count = map_size(mission.points)

    %{
      phase: phase(mission),
      standing: active == nil,
      formed: Enum.all?(Map.keys(mission.points), &(age_ms(mission, &1) <= mission.period_ms)),
      blocked: mission.why != nil,
      blocked_by: mission.why,
      says: if(active, do: "point #{active + 1} of #{count}")
    }
  end
end
