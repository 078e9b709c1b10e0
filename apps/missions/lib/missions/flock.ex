defmodule Missions.Flock do
  @moduledoc """
  Flocks: robots keep together at a spacing, and go along a course, without a leader and without places (Olfati-Saber
  2006). Pure; written with the interface of `Robot.Mission` alone.

  Each tick a robot takes its acceleration from its neighbours, from the echoes of its sonars that no robot explains, and
  from the present point of the course (`Missions.Flock.Field`), makes its velocity of it (`.Motion`), and drives with that
  (`Robot.Behaviour.Velocity`).

  How far the flock has come is a number, its leg: 0 until all members that a robot hears hang together
  (`Missions.Flock.Members`), then k on the way to point k. One that sees a leg done counts on and tells the others, which
  take the greatest that they hear; each tells its leg once a second.

  Its phases are `:gather`, `:flock` and, at the last point, `:arrived`. It claims `formed` when it has arrived and the flock
  hangs together. Options: `Missions.Flock.Options`.
  """
  alias Hal.Pose
  alias Missions.Flock.{Field, Members, Motion, Options}

  @behaviour Robot.Mission

  @tell_ms 1_000
  # The share of its speed with which it is drawn to the middle of the flock from its rim.
  @cohere 0.25
  # The flock is at a point when its middle is so near (metres), and hangs together or not is asked so often.
  @there 0.5
  @look_ms 500
  # Metres before the point at which it slows down.
  @slow 1.0
  # The flock slows down when it does not hang together within this many spacings, and waits when not within its reach.
  @close 1.2
  # A leg is done when it has been for so long; the robots that come later in the order of names wait for the first.
  @done_ms 2_000
  @later_ms 2_000
  # A robot that has just begun has not heard all members yet.
  @first_ms 5_000

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
                velocity: nil,
                started?: false
              ]

  @typedoc """
  `plan` is the course in 28 bits, so that only robots with the same one are a flock; `leg` is how far it has come,
  `done_ms` since when this leg seems done; `pace` is the share of the speed with which the flock goes on, `middle` that of
  the members, `near` the number of the robot's neighbours, `velocity` what it drives with.
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
          velocity: Field.vector() | nil,
          started?: boolean()
        }

  @impl Robot.Mission
  def phases, do: [:gather, :flock, :arrived]

  @impl Robot.Mission
  defdelegate option_table, to: Options, as: :table

  @impl Robot.Mission
  def commands, do: []

  @impl Robot.Mission
  def messages do
    {1,
     member: [
       plan: [{:integer, 0, 0xFFFFFFF}, required: true],
       leg: [{:integer, 0, Options.most() + 1}, required: true]
     ]}
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
  def halted(mission),
    do: struct!(__MODULE__, mission |> Map.take(@kept) |> Map.to_list())

  @impl Robot.Mission
  def handle({:command, :start}, mission), do: result(%{mission | started?: true}, [])

  def handle({:message, %{kind: :member, from: from, body: body}}, %{now_ms: now_ms} = mission)
      when now_ms != nil,
      do: result(hear(mission, from, Map.new(body)), [])

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
    {velocity, mission} = velocity(mission, agents, percept)
    goal = {:goal, :flock, {Robot.Behaviour.Velocity, velocity: velocity}}
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
    mission = %{mission | heard: Members.hear(mission.heard, from, mission.now_ms)}
    if leg > mission.leg and leg <= last(mission), do: on_leg(mission, leg), else: mission
  end

  defp hear(mission, _from, _of_others), do: mission

  defp last(mission), do: map_size(mission.course) + 1

  defp on_leg(mission, leg), do: %{mission | leg: leg, done_ms: nil}

  defp point(%{course: course}) when course == %{}, do: nil
  defp point(mission), do: mission.course[mission.leg |> max(1) |> min(map_size(mission.course))]

  # Twice a second: whether the members hang together, where their middle is, and whether this ends the leg.
  defp look(%{looked_ms: looked_ms, now_ms: now_ms} = mission, _agents, _percept)
       when looked_ms != nil and now_ms - looked_ms < @look_ms,
       do: mission

  defp look(mission, agents, percept) do
    points = [Pose.point(percept.pose) | Enum.map(agents, & &1.at)]
    together? = Members.together?(points, Field.reach(mission.spacing))
    close? = together? and Members.together?(points, @close * mission.spacing)

    mission = %{
      mission
      | looked_ms: mission.now_ms,
        together?: together?,
        pace: pace(together?, close?),
        middle: middle(points)
    }

    %{mission | done_ms: if(done?(mission), do: mission.done_ms || mission.now_ms)}
  end

  defp pace(_together?, true), do: 1.0
  defp pace(true, false), do: 0.5
  defp pace(false, false), do: 0.0

  defp middle(points) do
    count = length(points)

    {points |> Enum.map(&elem(&1, 0)) |> Enum.sum() |> Kernel./(count),
     points |> Enum.map(&elem(&1, 1)) |> Enum.sum() |> Kernel./(count)}
  end

  defp done?(%{leg: 0} = mission),
    do: mission.together? and mission.now_ms - mission.since_ms >= @first_ms

  defp done?(mission), do: mission.leg < last(mission) and near?(mission, point(mission))

  defp near?(_mission, nil), do: true
  defp near?(%{middle: middle}, point), do: Pose.distance(middle, point) < @there

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

  defp velocity(mission, agents, percept) do
    at = Pose.point(percept.pose)
    reach = Field.reach(mission.spacing)
    near = Enum.filter(agents, &(Pose.distance(at, &1.at) < reach))
    rules = %{spacing: mission.spacing, top: mission.speed, guide: guide(mission, at)}
    velocity = Motion.velocity(mission.velocity, percept, near, rules)
    {velocity, %{mission | near: length(near), velocity: velocity}}
  end

  # Each by itself to the first point; then all about the middle of the flock, which goes to the next.
  defp guide(%{leg: 0} = mission, at),
    do: {point(mission) || at, {0.0, 0.0}, mission.speed, radius(mission)}

  defp guide(%{middle: middle} = mission, _at) do
    velocity = Field.toward(middle, point(mission) || middle, mission.pace * mission.speed, @slow)

    {middle, velocity, @cohere * mission.speed, radius(mission)}
  end

  # About that of the flock, in metres.
  defp radius(mission), do: 0.6 * mission.spacing * :math.sqrt(map_size(mission.heard) + 1)

  defp claim(mission) do
    %{
      phase: phase(mission),
      standing: false,
      formed: phase(mission) == :arrived and mission.together?,
      says: says(mission)
    }
  end

  defp says(mission) do
    way =
      case phase(mission) do
        :gather -> "gathers"
        :flock -> "on the way to point #{mission.leg} of #{map_size(mission.course)}"
        :arrived -> "arrived"
      end

    if mission.together?,
      do: "#{way}, #{many(mission)} together",
      else: "#{way}, #{many(mission)}, not together"
  end
end
