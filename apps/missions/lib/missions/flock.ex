defmodule Missions.Flock do
  @moduledoc """
  Flocks: robots keep together at a spacing, and go along a course, without a leader and without places (Olfati-Saber
  2006). Pure; written with the interface of `Robot.Mission` alone.

  Each tick a robot takes its acceleration from its neighbours, from the echoes of its sonars that no robot explains, and
  from the present point of the course (`Missions.Flock.Field`), makes its velocity of it (`.Motion`), and drives with that
  (`Robot.Behaviour.Velocity`). Where a wall that it knows stands between it and the point, it goes there by its own way
  (`Robot.Behaviour.Goto`), until it sees the point.

  How far the flock has come is a number, its leg: 0 until all members that a robot hears hang together
  (`Missions.Flock.Members`), then k on the way to point k. One that sees a leg done counts on and tells the others, which
  take the greatest that they hear; each tells its leg once a second.

  Its phases are `:gather`, `:flock` and, at the last point, `:arrived`. It claims `formed` when it has arrived and the flock
  hangs together. Options: `Missions.Flock.Options`.
  """
  alias Hal.Pose
  alias Missions.Flock.{Apart, Field, Members, Motion, Options, Sight}

  @behaviour Robot.Mission

  @tell_ms 1_000
  # The share of its speed with which it is drawn to the middle of the flock from its rim.
  @cohere 0.25
  # The flock is at a point when its middle is so near (metres), and hangs together or not is asked so often.
  @there 0.5
  @look_ms 500
  # Metres from a point at which it slows down.
  @slow 1.0
  # The flock slows down when it does not hang together within this many spacings, and waits when not within its reach.
  @close 1.2
  # A leg is done when it has been for so long; the robots that come later in the order of names wait for the first.
  @done_ms 2_000
  @later_ms 2_000
  # A robot that has just begun has not heard all members yet.
  @first_ms 5_000
  # What keeps it from coming together or to the point is looked for so often.
  @why_ms 5_000

  @kept [:me, :spacing, :speed, :course, :plan]
  @enforce_keys @kept
  defstruct @kept ++
              [
                now_ms: nil,
                since_ms: nil,
                leg: 0,
                done_ms: nil,
                heard: %{},
                looked_ms: nil,
                together?: false,
                pace: 0.0,
                told_ms: nil,
                told: nil,
                middle: nil,
                near: 0,
                stood: %{},
                why: nil,
                why_ms: nil,
                to: nil,
                go: 0,
                velocity: nil,
                started?: false
              ]

  @typedoc """
  `plan` is the course in 28 bits, so that only robots with the same one are a flock; `leg` is how far it has come, `done_ms` since
  when this leg seems done; `pace` is the share of the speed with which the flock goes on, `middle` that of the members, `near` the
  number of the robot's neighbours, `velocity` what it drives with. `stood` is where members stand, `why` what keeps the flock from
  coming together or to its point, `to` where its own way for that leads (`nil`: nowhere), both of `why_ms`; `go` numbers its goals.
  """
  @type t :: %__MODULE__{
          me: atom(),
          spacing: float(),
          speed: float(),
          course: %{pos_integer() => Pose.point()},
          plan: non_neg_integer(),
          now_ms: integer() | nil,
          since_ms: integer() | nil,
          leg: non_neg_integer(),
          done_ms: integer() | nil,
          heard: Members.t(),
          looked_ms: integer() | nil,
          together?: boolean(),
          pace: float(),
          told_ms: integer() | nil,
          told: non_neg_integer() | nil,
          middle: Pose.point() | nil,
          near: non_neg_integer(),
          stood: Apart.stood(),
          why: String.t() | nil,
          why_ms: integer() | nil,
          to: Pose.point() | nil,
          go: non_neg_integer(),
          velocity: Field.vector() | nil,
          started?: boolean()
        }

  @impl Robot.Mission
  def phases, do: [:gather, :flock, :arrived]

  @impl Robot.Mission
  defdelegate option_table, to: Options, as: :table

  @impl Robot.Mission
  def commands, do: [:leg]

  @impl Robot.Mission
  def messages do
    {1,
     member: [
       plan: [{:integer, 0, 0xFFFFFFF}, required: true],
       leg: [{:integer, 0, Options.most() + 1}, required: true]
     ],
     leg: [leg: [{:integer, 1, Options.most() + 1}, required: true]]}
  end

  @impl Robot.Mission
  def init(robot, options) do
    course = options[:course]

    mission = %__MODULE__{
      me: robot,
      spacing: options[:spacing] * 1.0,
      speed: options[:speed] * 1.0,
      course: course |> Enum.with_index(1) |> Map.new(fn {point, leg} -> {leg, point} end),
      plan: :erlang.phash2({course, options[:spacing]}, 0x10000000)
    }

    {:idle, mission, []}
  end

  @impl Robot.Mission
  def halted(mission), do: struct!(__MODULE__, mission |> Map.take(@kept) |> Map.to_list())

  @impl Robot.Mission
  def layer(mission) do
    course = for {leg, {x, y}} <- Enum.sort(mission.course), do: {leg, {x, y}}
    points = for {leg, {x, y}} <- course, do: {x, y, "#{leg}#{if leg < mission.leg, do: " done"}"}

    [
      {:polyline, "course", Enum.map(course, &elem(&1, 1))},
      {:points, "points of the course", points}
    ]
  end

  @impl Robot.Mission
  def handle({:command, :start}, mission), do: result(%{mission | started?: true}, [])

  def handle({:message, %{kind: :member, from: from, body: body}}, %{now_ms: now_ms} = mission)
      when now_ms != nil,
      do: result(hear(mission, from, Map.new(body)), [])

  # A person has it go on; the others hear it by the next `member`.
  def handle({:command, {:message, :leg, [leg: leg]}}, mission),
    do: result(go_on(mission, leg), [])

  # What stood in its way may be gone; it tries again.
  def handle({:outcome, {:way, go}, _outcome}, %{go: go} = mission),
    do: result(%{mission | go: go + 1}, [])

  def handle({:tick, %{pose: nil}}, mission), do: result(mission, [])

  def handle({:tick, percept}, %{started?: true} = mission) do
    now_ms = percept.at_ms

    mission = %{
      mission
      | now_ms: now_ms,
        since_ms: mission.since_ms || now_ms,
        heard: Members.present(mission.heard, now_ms)
    }

    agents = Members.agents(mission.heard, percept)
    {mission, stages} = mission |> look(agents, percept) |> count_on()
    {mission, told} = tell(mission)
    {goal, mission} = drive(mission, agents, percept)
    result(mission, stages ++ told ++ [goal, {:look, 0.0}, {:claim, claim(mission)}])
  end

  def handle(_event, mission), do: result(mission, [])

  defp result(%{started?: false} = mission, effects), do: {:idle, mission, effects}
  defp result(mission, effects), do: {phase(mission), mission, effects}

  defp phase(%{leg: 0}), do: :gather
  defp phase(%{leg: leg, course: course}) when leg > map_size(course), do: :arrived
  defp phase(_mission), do: :flock

  # Another course is another flock.
  defp hear(%{plan: plan} = mission, from, %{plan: plan, leg: leg}) do
    go_on(%{mission | heard: Members.hear(mission.heard, from, mission.now_ms)}, leg)
  end

  defp hear(mission, _from, _of_others), do: mission

  # No leg comes twice.
  defp go_on(mission, leg),
    do: if(leg > mission.leg and leg <= last(mission), do: on_leg(mission, leg), else: mission)

  defp last(mission), do: map_size(mission.course) + 1
  defp there?(mission), do: mission.leg == last(mission) and mission.together?

  defp on_leg(%{stood: stood} = mission, leg),
    do: %{mission | leg: leg, done_ms: nil, to: nil, why_ms: nil, stood: Map.delete(stood, nil)}

  defp point(%{course: course}) when course == %{}, do: nil
  defp point(mission), do: mission.course[mission.leg |> max(1) |> min(map_size(mission.course))]

  # Twice a second: whether the members hang together, where their middle is, and whether this ends the leg.
  defp look(%{looked_ms: looked_ms, now_ms: now_ms} = mission, _agents, _percept)
       when looked_ms != nil and now_ms - looked_ms < @look_ms,
       do: mission

  defp look(%{together?: before, now_ms: now_ms} = mission, agents, %{grid: grid} = percept) do
    members = [{mission.me, Pose.point(percept.pose)} | Enum.map(agents, &{&1.id, &1.at})]
    middle = Members.middle(members)
    groups = Members.groups(members, Field.reach(mission.spacing))
    together? = length(groups) == 1
    close? = together? and length(Members.groups(members, @close * mission.spacing)) == 1

    mission = %{
      mission
      | looked_ms: now_ms,
        together?: together?,
        middle: middle,
        stood: Apart.stood(mission.stood, [{nil, middle} | members], mission.speed, now_ms)
    }

    waits? = not together? and waits?(mission, groups, percept)
    mission = why(%{mission | pace: pace(together?, close?, waits?)}, before, groups, percept)
    %{mission | done_ms: if(done?(mission, grid), do: mission.done_ms || now_ms)}
  end

  # The group with the member that is nearest to the point waits for the others that it sees, which go on. Those behind walls come
  # by other ways, and wait at the point.
  defp waits?(mission, groups, percept) do
    point = point(mission) || mission.middle
    first = groups |> Enum.concat() |> Enum.min_by(fn {_id, at} -> Pose.distance(at, point) end)
    {[own], others} = Enum.split_with(groups, &(first in &1))
    List.keymember?(own, mission.me, 0) and Sight.any?(percept.grid, own, Enum.concat(others))
  end

  defp pace(_together?, _close?, true), do: 0.0
  defp pace(true, false, false), do: 0.5
  defp pace(_together?, _close?, false), do: 1.0

  defp why(%{why_ms: at_ms, now_ms: now_ms, together?: same?} = mission, same?, _groups, _percept)
       when at_ms != nil and now_ms - at_ms < @why_ms,
       do: mission

  defp why(%{now_ms: now_ms} = mission, _before, groups, percept) do
    words = if not there?(mission), do: Apart.words(groups, mission.stood, now_ms, percept)

    case Sight.place(percept, point(mission)) do
      {:ok, place} -> %{mission | why: words, why_ms: now_ms, to: place}
      {:error, no_way} -> %{mission | why: no_way, why_ms: now_ms, to: nil}
    end
  end

  defp done?(%{leg: 0} = mission, _grid),
    do: mission.together? and mission.now_ms - mission.since_ms >= @first_ms

  defp done?(mission, grid),
    do: mission.leg < last(mission) and near?(mission, point(mission), grid)

  defp near?(_mission, nil, _grid), do: true

  defp near?(%{together?: together?, middle: middle, stood: stood} = mission, point, grid) do
    flock = %{spacing: mission.spacing, radius: radius(mission)}

    Pose.distance(middle, point) < @there or
      (together? and Apart.rest?(stood, point, flock, grid, mission.now_ms))
  end

  defp count_on(%{done_ms: nil} = mission), do: {mission, []}

  defp count_on(mission) do
    first? = Enum.all?(mission.heard, fn {id, _at_ms} -> mission.me < id end)
    wait_ms = if first?, do: @done_ms, else: @done_ms + @later_ms

    if mission.now_ms - mission.done_ms >= wait_ms,
      do: {on_leg(mission, mission.leg + 1), stages(mission)},
      else: {mission, []}
  end

  defp stages(%{leg: 0} = mission),
    do: [{:stage, :gathered, %{says: "says that #{many(mission)} #{keep(mission)} together"}}]

  defp stages(mission) do
    count = map_size(mission.course)
    [{:stage, :at_point, %{says: "says that the flock is at point #{mission.leg} of #{count}"}}]
  end

  defp keep(%{heard: heard}), do: if(heard == %{}, do: "keeps", else: "keep")

  defp many(%{heard: heard}) when heard == %{}, do: "1 robot"
  defp many(%{heard: heard}), do: "#{map_size(heard) + 1} robots"

  defp tell(%{leg: leg} = mission) do
    if mission.told_ms == nil or leg != mission.told or
         mission.now_ms - mission.told_ms >= @tell_ms,
       do:
         {%{mission | told_ms: mission.now_ms, told: leg},
          [{:tell, :all, :member, plan: mission.plan, leg: leg}]},
       else: {mission, []}
  end

  # By the rules of the flock where these lead it to the point; else by its own way, if one leads there.
  defp drive(mission, agents, percept) do
    waits? = there?(mission) or (mission.leg > 0 and mission.pace == 0.0)

    if mission.to == nil or waits? or Sight.straight?(percept, point(mission), mission.spacing) do
      {velocity, mission} = velocity(mission, agents, percept)
      {{:goal, :flock, {Robot.Behaviour.Velocity, velocity: velocity}}, mission}
    else
      {x, y} = mission.to
      pace = if mission.leg == 0, do: 1.0, else: mission.pace
      way = [x: x, y: y, tolerance: @there, speed: pace * mission.speed]
      {{:goal, {:way, mission.go}, {Robot.Behaviour.Goto, way}}, %{mission | velocity: nil}}
    end
  end

  defp velocity(mission, agents, percept) do
    at = Pose.point(percept.pose)
    reach = Field.reach(mission.spacing)
    near = Enum.filter(agents, &(Pose.distance(at, &1.at) < reach))
    rules = %{spacing: mission.spacing, top: mission.speed, guide: guide(mission, at, percept)}
    velocity = Motion.velocity(mission.velocity, percept, near, rules)
    {velocity, %{mission | near: length(near), velocity: velocity}}
  end

  # Each by itself to the first point; then all about the middle of the flock, which goes to the next. Behind a wall the middle
  # counts for nothing.
  defp guide(%{leg: 0} = mission, at, _percept),
    do: {point(mission) || at, {0.0, 0.0}, mission.speed, radius(mission)}

  defp guide(%{middle: middle} = mission, at, percept) do
    point = point(mission) || middle
    from = if mission.together? and Sight.sees?(percept, middle, point), do: middle, else: at
    centre = if Sight.sees?(percept, at, middle), do: middle, else: at
    velocity = Field.toward(from, point, mission.pace * mission.speed, @slow)
    {centre, velocity, @cohere * mission.speed, radius(mission)}
  end

  # About that of the flock, in metres.
  defp radius(mission), do: 0.6 * mission.spacing * :math.sqrt(map_size(mission.heard) + 1)

  defp claim(mission) do
    %{
      phase: phase(mission),
      standing: false,
      formed: there?(mission),
      says: says(mission)
    }
  end

  # A status has room for 80 characters: why it does not get on comes first.
  defp says(%{why: nil, together?: together?} = mission) do
    way = if phase(mission) == :flock, do: "on the way #{way(mission)}", else: way(mission)

    "#{way}, #{many(mission)}#{if together?, do: " together", else: ", not together"}#{off(mission)}"
  end

  defp says(mission), do: "#{mission.why}; #{way(mission)}"

  # Where walls leave no room for it round its last point.
  defp off(%{together?: true, middle: middle} = mission) do
    point = point(mission)
    far = if there?(mission) and point != nil, do: Pose.distance(middle, point), else: 0.0
    if far >= @there, do: ", its middle #{Float.round(far, 1)} m from the point"
  end

  defp off(_mission), do: nil

  defp way(%{leg: 0}), do: "gathers"
  defp way(%{leg: leg, course: all}) when leg > map_size(all), do: "arrived"
  defp way(%{leg: leg, course: all}), do: "to point #{leg} of #{map_size(all)}"
end
