defmodule Missions.Push do
  @moduledoc """
  Pushes a box to a place: two robots push, the others watch. Pure; written with the interface of `Robot.Mission` alone.

  A robot that touches the box does not see it: its camera sees the floor from 1.4 m on. So all tell each other five times a second what they see of the box, and
  each estimates from that, and from where the robots that push it are, where it lies (`Missions.Push.Estimate`). First they look at it from all sides. The
  two places at its side (`Missions.Push.Plan`) go by auction, to those with the shortest ways; one that dies or gives up is replaced by the next.
  The two drive at the box together, and wait for each other. When they are no longer sure of the box, as without a third robot that watches, they stand back and look again.

  Its phases are `:search`, `:watch`, `:approach`, `:push` and `:done`: then the box lies within the goal, and was seen there after it was pushed last. It claims
  `formed` then. Options: `Missions.Push.Options`.
  """
  alias Hal.Pose
  alias Missions.Chase.Search
  alias Missions.Push.{Estimate, Moves, Options, Places, Plan, Sight, Talk, Words}
  alias Robot.Percept
  alias Robot.Percept.CameraPointing

  @behaviour Robot.Mission

  @tell_ms 200
  @forget_ms 10_000
  @most_peers 256
  # The estimate is too uncertain to push by (m, rad), until it is this certain.
  @unsure 0.22
  @unsure_heading 0.3
  @sure 0.1
  @sure_heading 0.12
  # Pushing ends so near to the goal, as a share of `within`.
  @stops 0.35
  @trail 60
  @lone_doubt 4.0
  @brush 0.06
  # A box that was not seen for so long, while it should have been, is looked for.
  @lost_ms 10_000

  @kept [:me, :goal, :within, :speed, :colour, :size, :plan]
  @enforce_keys @kept
  defstruct @kept ++
              [
                now_ms: nil,
                picture_ms: nil,
                box: nil,
                sighting: nil,
                heard: %{},
                side: nil,
                stage: :none,
                direction: nil,
                phase: :search,
                looks?: true,
                target: nil,
                go: 0,
                rests?: false,
                search: %Search{},
                aside_ms: nil,
                why: nil,
                waits_ms: nil,
                busy_ms: nil,
                goes_ms: nil,
                moved: nil,
                told_ms: nil,
                trail: [],
                started?: false
              ]

  @typedoc """
  `plan` is the number of its options in 28 bits, so that only robots with the same box and goal understand each other; `side` is where it pushes, 1 on
  the left, -1 on the right; `stage` how far it is there, `direction` that of the push.
  """
  @type t :: %__MODULE__{}

  @impl Robot.Mission
  def phases, do: [:search, :watch, :approach, :push, :done]

  @impl Robot.Mission
  defdelegate option_table, to: Options, as: :table

  @impl Robot.Mission
  def commands, do: []

  @impl Robot.Mission
  defdelegate messages, to: Talk, as: :table

  @impl Robot.Mission
  def init(robot, options) do
    size = {options[:length], options[:width]}
    plan = :erlang.phash2({options[:goal], options[:colour], size}, 0x10000000)

    kept =
      options
      |> Keyword.drop([:length, :width])
      |> Keyword.merge(me: robot, plan: plan, size: size)

    {:idle, struct!(__MODULE__, kept), []}
  end

  @impl Robot.Mission
  def halted(mission), do: struct!(__MODULE__, mission |> Map.take(@kept) |> Map.to_list())

  @impl Robot.Mission
  def handle({:command, :start}, mission), do: result(%{mission | started?: true}, [])

  def handle({:message, %{kind: :box, from: from, body: said}}, %{now_ms: now_ms} = mission)
      when now_ms != nil,
      do: result(hear(mission, from, Map.new(said)), [])

  def handle({:outcome, {:go, go}, outcome}, %{go: go} = mission),
    do: result(Moves.arrived(mission, outcome), [])

  def handle({:outcome, {:search, n}, outcome}, mission),
    do: result(%{mission | search: Search.ended(mission.search, n, outcome)}, [])

  def handle({:tick, %{pose: nil}}, mission), do: result(mission, [])

  def handle({:tick, percept}, %{started?: true} = mission) do
    before = mission.phase

    mission =
      %{mission | now_ms: percept.at_ms} |> look(percept) |> forget() |> pushed(percept) |> lose()

    scene = scene(mission, percept)
    astray? = Percept.astray(percept) != nil
    mission = if astray?, do: wander(mission), else: decide(mission, scene, percept)
    {mission, told} = tell(mission, scene, percept)
    {goal, mission} = Moves.goal(mission, scene, percept)

    result(
      mission,
      Words.stages(mission, before) ++
        told ++ [goal, {:look, pan(scene, percept)}, {:claim, Words.claim(mission, scene)}]
    )
  end

  def handle(_event, mission), do: result(mission, [])

  defp result(%{started?: false} = mission, effects), do: {:idle, mission, effects}
  defp result(mission, effects), do: {mission.phase, mission, effects}

  # A picture counts once.
  defp look(%{picture_ms: at_ms} = mission, %{detections: %{at_ms: at_ms}}), do: mission

  defp look(mission, %{detections: %{at_ms: at_ms}} = percept) do
    case Sight.box(percept, mission.colour, believed(mission)) do
      nil -> %{mission | picture_ms: at_ms}
      {:near, place} -> near(%{mission | picture_ms: at_ms}, place, percept)
      sighting -> %{mission | picture_ms: at_ms, sighting: sighting}
    end
  end

  defp look(mission, _without_picture), do: mission

  defp believed(%{box: box, size: size}),
    do: if(Estimate.sure?(box), do: {elem(Estimate.best(box), 0), size})

  # One that looks for the box before its feet goes back, to see it whole.
  defp near(%{phase: :search, search: %{kind: :turn} = search} = mission, {x, y}, %{pose: pose}) do
    angle = :math.atan2(pose.y - y, pose.x - x)
    to = {x + Moves.ring() * :math.cos(angle), y + Moves.ring() * :math.sin(angle)}
    %{mission | search: %Search{n: search.n + 1, kind: :go, to: to}}
  end

  defp near(mission, _place, _percept), do: mission

  # Sightings of a robot are alike within a fifth of a second: only those that are told count.
  defp note(mission, sighting) do
    box = Estimate.note(mission.box, sighting, mission.size, mission.now_ms)
    %{mission | box: box, trail: trail(mission.trail, box)}
  end

  defp trail(trail, box) do
    if Estimate.sure?(box), do: add(trail, Pose.point(elem(Estimate.best(box), 0))), else: trail
  end

  defp add([newest | _] = trail, at),
    do: if(Pose.distance(newest, at) < 0.2, do: trail, else: Enum.take([at | trail], @trail))

  defp add([], at), do: [at]

  defp hear(%{plan: plan} = mission, from, %{plan: plan} = said) do
    if is_map_key(mission.heard, from) or map_size(mission.heard) < @most_peers do
      peer = Talk.peer(said, mission.now_ms)
      sighting = Talk.sighting(said)
      mission = adopt(%{mission | heard: Map.put(mission.heard, from, peer)}, Talk.box(said))
      if sighting, do: note(mission, sighting), else: mission
    else
      mission
    end
  end

  defp hear(mission, _from, _of_others), do: mission

  # Beside robots that hide it, a box may show too little to begin with.
  defp adopt(mission, nil), do: mission

  defp adopt(mission, {pose, sd}) do
    if Estimate.sure?(mission.box) or mission.stage != :none,
      do: mission,
      else: %{mission | box: Estimate.adopt(pose, sd, mission.size, mission.now_ms)}
  end

  defp forget(mission) do
    heard =
      for {id, peer} <- mission.heard, mission.now_ms - peer.at_ms < @forget_ms, do: {id, peer}

    %{mission | heard: Map.new(heard)}
  end

  # While robots are at the box, none may see it.
  defp lose(%{box: nil} = mission), do: mission

  defp lose(%{box: box, now_ms: now_ms} = mission) do
    busy? =
      mission.stage != :none or
        Enum.any?(Places.fresh(mission), fn {_id, peer} -> peer.stage != :none end)

    mission = if busy?, do: %{mission | busy_ms: now_ms}, else: mission

    if now_ms - max(box.seen_ms, mission.busy_ms || box.seen_ms) > @lost_ms,
      do: %{mission | box: nil, search: %Search{}},
      else: mission
  end

  # A robot that does not push must not move a box that it does not touch, because it is a little off its place.
  defp pushed(mission, percept) do
    stages = for {id, %{stage: stage}} <- Places.fresh(mission), into: %{}, do: {id, stage}

    others =
      for {id, peer} <- Enum.sort(percept.peers),
          do: disc(peer.pose, peer.radius, if(peer.mode == :dead, do: :push, else: stages[id]))

    discs = [disc(percept.pose, percept.profile.radius, mission.stage) | others]
    pushers = Enum.count([mission.stage | Map.values(stages)], &(&1 == :push))
    # A lone one turns the box more than two do, by a little that none knows.
    doubt = if pushers == 1, do: @lone_doubt, else: 1.0
    %{mission | box: Estimate.push(mission.box, discs, doubt, mission.now_ms)}
  end

  defp disc(%{x: x, y: y}, radius, stage),
    do: {x, y, if(stage == :push, do: radius, else: radius - @brush)}

  # All that is asked of the box at this tick; `nil` while no robot knows where it is.
  defp scene(%{box: nil}, _percept), do: nil

  defp scene(mission, percept) do
    {box, sd, sd_heading} = Estimate.best(mission.box)
    others = for {id, peer} <- percept.peers, do: {id, Pose.point(peer.pose), peer.mode}
    pushes? = mission.stage != :none and length(mission.box.all) == 1

    scene = %{
      box: box,
      sd: sd,
      sd_heading: sd_heading,
      sure?: pushes? or Estimate.sure?(mission.box),
      room?: true,
      size: mission.size,
      goal: mission.goal,
      speed: mission.speed,
      far: Pose.distance(box, mission.goal),
      radius: percept.profile.radius,
      broadest: broadest(mission, percept),
      grid: percept.grid,
      others: others,
      taken:
        for(
          {_id, %{mode: :dead} = wreck} <- Enum.sort(percept.peers),
          do: {wreck.pose.x, wreck.pose.y, wreck.radius}
        )
    }

    {before, direction} = Places.agreed(mission)
    Plan.choose(scene, before, direction) || %{scene | room?: false}
  end

  # All must agree on whether a place is free, whatever their own bodies are.
  defp broadest(mission, percept) do
    for {id, _peer} <- mission.heard,
        %{radius: radius} <- [percept.peers[id]],
        reduce: percept.profile.radius do
      broadest -> max(broadest, radius)
    end
  end

  # One that does not know where it is goes about until it does: standing, it would not learn it.
  defp wander(%{search: %{kind: :turn, n: n}} = mission),
    do: %{Places.rest(mission, :search) | search: %Search{n: n + 1, kind: :go}}

  defp wander(mission), do: Places.rest(mission, :search)

  defp decide(mission, nil, _percept), do: Places.rest(mission, :search)

  defp decide(mission, %{sure?: false}, _percept),
    do: %{
      Places.rest(mission, if(mission.box.seen > 0, do: :watch, else: :search))
      | looks?: true
    }

  defp decide(mission, scene, percept) do
    looks? =
      if mission.looks?,
        do: scene.sd > @sure or scene.sd_heading > @sure_heading,
        else: scene.sd > @unsure or scene.sd_heading > @unsure_heading

    mission = %{mission | looks?: looks?, direction: scene[:direction], why: nil}

    cond do
      looks? ->
        Places.rest(mission, :watch)

      seen_since?(mission) and done?(mission, scene) ->
        Places.rest(mission, :done)

      scene.far <= max(@stops * mission.within, mission.within - Estimate.margin(mission.box)) ->
        %{
          Places.rest(mission, :watch)
          | looks?: not seen_since?(mission),
            why: if(seen_since?(mission), do: Words.may_be(mission, scene))
        }

      not scene.room? ->
        %{Places.rest(mission, :watch) | why: "no room behind the box"}

      true ->
        Places.take(mission, scene, percept)
    end
  end

  # One that lies there, and was not touched, is not looked at anew for a little more doubt.
  defp done?(%{phase: :done} = mission, scene), do: scene.far <= mission.within

  defp done?(mission, scene), do: scene.far + Estimate.margin(mission.box) <= mission.within

  defp seen_since?(%{box: %{pushed_ms: nil}}), do: true

  defp seen_since?(%{box: %{pushed_ms: pushed_ms, seen_ms: seen_ms}}),
    do: seen_ms > pushed_ms + 500

  defp tell(%{told_ms: told_ms, now_ms: now_ms} = mission, _scene, _percept)
       when told_ms != nil and now_ms - told_ms < @tell_ms,
       do: {mission, []}

  defp tell(%{now_ms: now_ms, sighting: sighting} = mission, scene, percept) do
    costs =
      if scene && scene.sure? && scene.room? && not mission.looks?,
        do: Places.costs(mission, scene, percept),
        else: %{}

    body = Talk.body(mission, costs)
    mission = if sighting, do: note(mission, sighting), else: mission
    {%{mission | told_ms: now_ms, sighting: nil}, [{:tell, :all, :box, body}]}
  end

  defp pan(nil, _percept), do: 0.0

  defp pan(%{box: box}, percept),
    do: CameraPointing.pan(Pose.bearing(percept.pose, box), percept)

  @impl Robot.Mission
  defdelegate explain(mission), to: Words

  @impl Robot.Mission
  defdelegate layer(mission), to: Words
end
