defmodule Missions.Explore do
  @moduledoc """
  Explores: robots see all of a building that they do not know, and make its map together. Pure. Each robot keeps a map of what its sonars have seen and of what others tell (`Missions.Explore.SharedMap`), by the poses that
  they estimate, and where printed marks hang (`Missions.Explore.FoundMarks`). Once a second it looks for the frontiers of what is known (`Nav.Frontiers`), chooses one (`.Choice`), and tells
  the others to where it goes, how far that is, and what it has seen. Its ways are those of its map, whatever floor plan it
  has been given.

  Its phases are `:explore`, and `:explored` while no frontier is left that it can reach; then it claims `formed`, unless
  too much of the edge of what it has seen is no wall: it has no room to get there, and says so. Before, it goes to the
  walls of few echoes that close its ways (`Nav.Survey.doubt/3`), and looks at them from nearby; where these
  were many, it says so and claims nothing. A place to which it came no nearer is left alone for a while, and for ever the
  second time. Options: `Missions.Explore.Options`.
  """
  alias Hal.Pose
  alias Missions.Explore.{FoundMarks, Options, SharedMap}
  alias Nav.Frontiers
  alias Nav.Frontiers.Choice

  @behaviour Robot.Mission

  @plan_ms 1_000
  # It has seen enough to say anything after so long.
  @first_ms 3_000
  # A robot that was silent for so long goes nowhere; so many are remembered.
  @silent_ms 3_500
  @most_peers 256
  # A robot that has not moved by so many metres within this time comes no nearer.
  @moved 0.3
  @stuck_ms 10_000
  # The frontiers within so many metres of a place that it gave up are left alone for so long at first; so many are remembered.
  @aside 0.8
  @aside_ms 30_000
  @most_aside 64
  @ever_ms 86_400_000
  @tolerance 0.2
  # So near to a wall that it doubts it has looked at it (metres).
  @near 0.5
  # So many such looks, and one for each so many square metres, are usual: in the built-in maps it was 5 at most, in lanes 1.5 m
  # wide 1; in lanes of 1 m, which echoes from their sides close, 8 on 24 m2 and more.
  @few 3
  @per_look 10
  # The share of the edge of what was seen that may be unknown when all is explored. In the built-in maps it was 5 % at most,
  # 10 % where poses had drifted and walls had gaps; in lanes too narrow for the robot 25 to 45 %.
  @unknown 0.15

  @enforce_keys [:me, :within]
  defstruct @enforce_keys ++
              [
                map: SharedMap.new(),
                marks: %FoundMarks{},
                home: nil,
                now_ms: nil,
                since_ms: nil,
                planned_ms: nil,
                peers: %{},
                target: nil,
                ahead: nil,
                goal: 0,
                still: nil,
                aside: [],
                looked: [],
                doubts?: false,
                done?: false,
                unknown: 1.0,
                good: nil,
                told?: false,
                why: nil,
                started?: false
              ]

  @typedoc """
  `target` is the frontier to which it goes, `ahead` the point of the way there for which it goes now, by goal number
  `goal`. `still` is where it was when it last had moved, and since when; `aside` are places that it gave up, and until
  when; `unknown` is the share of the edge of what was seen along which nothing is known (`Nav.Frontiers.unknown/1`), 1.0 while
  there are frontiers; `good` says how good its map is, once it is done; `looked` are walls of few echoes at which it has looked,
  `doubts?` that it goes to one; `told?` that it has said that all is explored. `peers` are what others told last: when, to where
  they go, and how far that is.
  """
  @type t :: %__MODULE__{
          me: atom(),
          within: float(),
          map: SharedMap.t(),
          marks: FoundMarks.t(),
          home: Pose.point() | nil,
          now_ms: integer() | nil,
          since_ms: integer() | nil,
          planned_ms: integer() | nil,
          peers: %{atom() => {at_ms :: integer(), Choice.goal() | nil}},
          target: Frontiers.frontier() | nil,
          ahead: Pose.point() | nil,
          goal: non_neg_integer(),
          still: {Pose.point(), integer()} | nil,
          aside: [{Pose.point(), until_ms :: integer()}],
          looked: [Pose.point()],
          doubts?: boolean(),
          done?: boolean(),
          unknown: float(),
          good: String.t() | nil,
          told?: boolean(),
          why: String.t() | nil,
          started?: boolean()
        }

  @impl Robot.Mission
  def phases, do: [:explore, :explored]

  @impl Robot.Mission
  defdelegate option_table, to: Options, as: :table

  @impl Robot.Mission
  def commands, do: []

  @place {:tuple,
          [{:integer, -10_000_000, 10_000_000, "mm"}, {:integer, -10_000_000, 10_000_000, "mm"}],
          "{x, y} in mm"}

  @impl Robot.Mission
  def messages do
    {2,
     mark: FoundMarks.table(),
     seen: [
       goal: [{:or, nil, @place}, required: true],
       far_mm: [{:integer, 0, 10_000_000, "mm"}, required: true],
       tiles: [{:check, &SharedMap.told?/1, "tiles of a map"}, required: true]
     ]}
  end

  @impl Robot.Mission
  def init(robot, options),
    do: {:idle, %__MODULE__{me: robot, within: options[:within] * 1.0}, []}

  # The map is what a stop must not lose.
  @impl Robot.Mission
  def halted(mission),
    do:
      struct!(
        __MODULE__,
        mission |> Map.take([:me, :within, :map, :marks, :home]) |> Map.to_list()
      )

  @impl Robot.Mission
  def map(mission),
    do: mission.map |> SharedMap.raster() |> Map.put(:marks, FoundMarks.hung(mission.marks))

  @impl Robot.Mission
  def layer(mission), do: [SharedMap.layer(mission.map) | FoundMarks.layer(mission.marks)]

  @impl Robot.Mission
  def handle({:command, :start}, mission), do: result(%{mission | started?: true}, [])

  def handle({:message, %{kind: :seen, from: from, body: body}}, %{now_ms: now_ms} = mission)
      when now_ms != nil,
      do: result(hear(mission, from, Map.new(body)), [])

  def handle({:message, %{kind: :mark, from: from, body: body}}, mission),
    do: result(%{mission | marks: FoundMarks.hear(mission.marks, from, Map.new(body))}, [])

  def handle({:outcome, {:go, n}, outcome}, %{goal: n} = mission) do
    mission = %{mission | goal: n + 1}
    result(if(outcome == 1, do: mission, else: give_up(mission)), [])
  end

  def handle({:tick, %{pose: nil}}, mission), do: result(mission, [])

  def handle({:tick, percept}, %{started?: true} = mission) do
    mission = %{
      mission
      | now_ms: percept.at_ms,
        since_ms: mission.since_ms || percept.at_ms,
        home: mission.home || Pose.point(percept.pose),
        map: SharedMap.look(mission.map, percept),
        marks: FoundMarks.look(mission.marks, percept)
    }

    {mission, effects} = mission |> move(Pose.point(percept.pose)) |> plan(percept)
    result(mission, effects ++ [goal(mission), {:look, 0.0}, {:claim, claim(mission)}])
  end

  def handle(_event, mission), do: result(mission, [])

  defp result(%{started?: false} = mission, effects), do: {:idle, mission, effects}
  defp result(mission, effects), do: {phase(mission), mission, effects}

  defp phase(%{done?: true}), do: :explored
  defp phase(_mission), do: :explore

  defp hear(mission, from, said) do
    map = SharedMap.hear(mission.map, said.tiles)

    if is_map_key(mission.peers, from) or map_size(mission.peers) < @most_peers do
      goal = with {x, y} <- said.goal, do: {from, {x / 1_000, y / 1_000}, said.far_mm / 1_000}
      %{mission | map: map, peers: Map.put(mission.peers, from, {mission.now_ms, goal})}
    else
      %{mission | map: map}
    end
  end

  defp move(%{target: nil, now_ms: now_ms} = mission, at), do: %{mission | still: {at, now_ms}}

  defp move(%{still: {before, since_ms}, now_ms: now_ms} = mission, at) do
    cond do
      Pose.distance(before, at) > @moved -> %{mission | still: {at, now_ms}}
      now_ms - since_ms > @stuck_ms -> give_up(mission)
      true -> mission
    end
  end

  defp give_up(%{target: nil} = mission), do: mission

  defp give_up(%{doubts?: true, target: %{at: at}} = mission),
    do: choose_anew(%{mission | looked: [at | mission.looked]})

  defp give_up(%{target: %{at: at}} = mission) do
    again? = Enum.any?(mission.aside, fn {place, _until} -> Pose.distance(place, at) < @aside end)
    until_ms = mission.now_ms + if(again?, do: @ever_ms, else: @aside_ms)
    choose_anew(%{mission | aside: Enum.take([{at, until_ms} | mission.aside], @most_aside)})
  end

  defp choose_anew(mission),
    do: %{mission | target: nil, ahead: nil, planned_ms: nil, still: nil}

  defp plan(%{planned_ms: planned_ms, now_ms: now_ms} = mission, _percept)
       when planned_ms != nil and now_ms - planned_ms < @plan_ms,
       do: {mission, []}

  defp plan(%{now_ms: now_ms} = mission, percept) do
    from = Pose.point(percept.pose)
    peers = for {id, {at_ms, goal}} <- mission.peers, now_ms - at_ms < @silent_ms, do: {id, goal}
    mission = looked(mission, from)
    find = &Frontiers.find(&1, from, percept.profile.radius)
    field = mission.map |> SharedMap.raster() |> find.()
    {open, unknown} = open(mission, field)
    {field, open, doubts?} = doubt(mission, find, field, open)
    goals = for {_id, goal} <- Enum.sort(peers), goal != nil, do: goal
    target = Choice.of(open, mission.me, mission.target && mission.target.at, goals)
    done? = field != nil and open == [] and now_ms - mission.since_ms >= @first_ms
    first? = Enum.all?(peers, fn {id, _goal} -> mission.me < id end)

    good = if done?, do: SharedMap.good(mission.map)
    mission = %{mission | unknown: unknown, good: good, doubts?: doubts?}

    stages =
      if done? and not mission.told? and first?,
        do: [
          {:stage, :explored,
           %{says: "says that #{area(mission)} are explored; #{left(mission)}#{mission.good}"}}
        ],
        else: []

    mission = %{
      mission
      | planned_ms: now_ms,
        target: target,
        ahead: target && Frontiers.ahead(field, target, from),
        still: mission.still || {from, now_ms},
        done?: done?,
        told?: mission.told? or stages != []
    }

    {told, map} = SharedMap.tell(mission.map)
    {mark, marks} = FoundMarks.tell(mission.marks)
    mark = if mark, do: [{:tell, :all, :mark, mark}], else: []

    {%{mission | map: map, marks: marks},
     stages ++ [{:tell, :all, :seen, said(target, told)}] ++ mark}
  end

  # Where much of the edge is unknown, what seems too narrow is tried, too, when nothing else is left.
  defp open(_mission, nil), do: {[], 1.0}

  defp open(mission, field) do
    with [] <- Enum.filter(field.found, &open?(mission, &1)),
         unknown when unknown > @unknown <- Frontiers.unknown(field, &within?(mission, &1)) do
      {field |> Frontiers.narrow() |> Enum.filter(&open?(mission, &1)), unknown}
    else
      [_ | _] = open -> {open, 1.0}
      unknown -> {[], unknown}
    end
  end

  # Before all is explored, it looks at what closes a way by few echoes.
  defp doubt(%{looked: looked} = mission, find, %{} = field, [])
       when length(looked) < @most_aside do
    look? = &(open?(mission, &1) and not seen?(looked, &1))

    with %{} = doubted <- mission.map |> SharedMap.doubted() |> find.(),
         [_ | _] = open <- look(doubted, look?) do
      {doubted, open, true}
    else
      _nothing -> {field, [], false}
    end
  end

  defp doubt(_mission, _find, field, open), do: {field, open, false}

  defp look(field, look?) do
    with [] <- Enum.filter(field.found, look?),
         do: field |> Frontiers.narrow() |> Enum.filter(look?)
  end

  defp seen?(looked, %{at: at}), do: Enum.any?(looked, &(Pose.distance(&1, at) < @aside))

  defp looked(%{doubts?: doubts?, target: target} = mission, from) do
    near? = doubts? and target != nil and Pose.distance(from, target.at) < @near
    if near?, do: %{mission | looked: [target.at | mission.looked]}, else: mission
  end

  defp within?(%{home: {hx, hy}, within: within}, {x, y}),
    do: abs(x - hx) <= within and abs(y - hy) <= within

  defp open?(mission, %{at: at}) do
    within?(mission, at) and
      not Enum.any?(mission.aside, fn {place, until_ms} ->
        until_ms > mission.now_ms and Pose.distance(place, at) < @aside
      end)
  end

  defp said(nil, tiles), do: [goal: nil, far_mm: 0, tiles: tiles]

  defp said(%{at: {x, y}, far: far}, tiles),
    do: [goal: {round(x * 1_000), round(y * 1_000)}, far_mm: round(far * 1_000), tiles: tiles]

  defp goal(%{ahead: nil}), do: {:goal, :stand, {Robot.Behaviour.Stop, []}}

  defp goal(%{ahead: {x, y}, goal: n}),
    do:
      {:goal, {:go, n}, {Robot.Behaviour.Goto, x: x, y: y, tolerance: @tolerance, unmapped: true}}

  defp claim(mission) do
    %{
      phase: phase(mission),
      standing: mission.target == nil,
      formed: mission.done? and mission.unknown <= @unknown and not closed?(mission),
      says: says(mission)
    }
  end

  defp says(%{target: nil, done?: true} = mission),
    do: "#{area(mission)} explored, #{left(mission)}#{mission.good}"

  defp says(%{target: nil} = mission), do: "#{area(mission)} explored, looks for a frontier"

  defp says(%{target: %{far: far}} = mission),
    do: "#{area(mission)} explored, going to a frontier #{Float.round(far, 1)} m away"

  # A status has room for 80 characters.
  defp left(%{aside: aside, now_ms: now_ms, unknown: unknown} = mission) do
    count = Enum.count(aside, fn {_place, until_ms} -> until_ms > now_ms end)
    frontiers = if count > 0, do: ["#{count} frontiers left"], else: []

    doubt =
      cond do
        unknown > @unknown -> ["#{round(unknown * 100)} % of edge unknown"]
        closed?(mission) -> ["#{length(mission.looked)} walls in doubt"]
        true -> []
      end

    if frontiers ++ doubt == [],
      do: "no frontier is left",
      else: Enum.join(frontiers ++ doubt, ", ")
  end

  defp closed?(%{looked: looked, map: map}),
    do: length(looked) > @few + SharedMap.area(map) / @per_look

  defp area(mission), do: "#{round(SharedMap.area(mission.map))} m²"
end
