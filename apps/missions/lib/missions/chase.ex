defmodule Missions.Chase do
  @moduledoc """
  Chases a ball: robots surround it, and one of them drives it to a goal. Pure; written with the interface of `Robot.Mission` alone.

  Each robot tells the others five times a second where it sees the ball and how sure it is of that, so all track one ball
  (`Missions.Chase.Track`), also those that do not see it. The camera looks at the floor from 1.4 m on: so the driver does not see the ball that it
  pushes, but those round it do. Exactly one robot drives at a time (`Missions.Chase.Driver`): it gets behind the ball, and pushes it
  (`Missions.Chase.Push`). The others keep a ring about it (`Missions.Chase.Ring`).

  Its phases are `:search`, while no robot knows where the ball is, `:ring`, `:approach`, `:push`, and `:scored`, when the ball lies within the goal; it claims
  `formed` then. A ball that leaves the goal is chased again. Options: `Missions.Chase.Options`.
  """
  alias Hal.Pose
  alias Missions.Chase.{Driver, Moves, Options, Push, Search, Sight, Track, Words}

  @behaviour Robot.Mission

  @tell_ms 200
  @aim_ms 1_000
  @forget_ms 10_000
  @most_peers 256
  @most_mm 20_000_000
  # The ball lies if it is slower (m/s); it has left the goal when it is so far beyond it (metres).
  @lies 0.08
  @leaves 0.1
  # The driver looks again when the place of the ball is so uncertain (metres), until it is not.
  @unsure 0.6
  @sure 0.25
  # A robot that found no way to the ball leaves it to others for so long.
  @aside_ms 10_000
  # A ball that is pushed for so long has moved by so much (metres); a side from which it did not is not tried for so long.
  @patience_ms 8_000
  @moved 0.15
  @failed_ms 40_000
  @trail 60

  @kept [:me, :goal, :within, :ring, :speed, :colour, :radius, :plan]
  @enforce_keys @kept
  defstruct @kept ++
              [
                now_ms: nil,
                picture_ms: nil,
                track: nil,
                aim: nil,
                sighting: nil,
                heard: %{},
                driver: %Driver{},
                phase: :search,
                side: 0.0,
                looks?: false,
                target: nil,
                go: 0,
                rests?: false,
                search: %Search{},
                aside_ms: nil,
                held: nil,
                failed: [],
                why: nil,
                told_ms: nil,
                trail: [],
                started?: false
              ]

  @typedoc """
  `plan` is the number of its options in 28 bits, so that only robots with the same goal understand each other; `target` is where it
  drives, `go` how many it had, `trail` where the ball was, the newest first.
  """
  @type t :: %__MODULE__{}

  @impl Robot.Mission
  def phases, do: [:search, :ring, :approach, :push, :scored]

  @impl Robot.Mission
  defdelegate option_table, to: Options, as: :table

  @impl Robot.Mission
  def commands, do: []

  @impl Robot.Mission
  def messages do
    mm = {:integer, -@most_mm, @most_mm, "mm"}

    {1,
     ball: [
       plan: [{:integer, 0, 0xFFFFFFF}, required: true],
       at: [{:or, nil, {:tuple, [mm, mm], "{x, y} in mm"}}, required: true],
       sd_mm: [{:integer, 1, 10_000, "mm"}, required: true],
       age_ms: [{:integer, 0, 1_000, "ms"}, required: true],
       cost_mm: [{:or, nil, {:integer, 0, @most_mm, "mm"}}, required: true],
       drives: [:boolean, required: true]
     ]}
  end

  @impl Robot.Mission
  def init(robot, options) do
    plan = :erlang.phash2({options[:goal], options[:colour]}, 0x10000000)
    {:idle, struct!(__MODULE__, [me: robot, plan: plan] ++ options), []}
  end

  @impl Robot.Mission
  def halted(mission), do: struct!(__MODULE__, mission |> Map.take(@kept) |> Map.to_list())

  @impl Robot.Mission
  def handle({:command, :start}, mission), do: result(%{mission | started?: true}, [])

  def handle({:message, %{kind: :ball, from: from, body: said}}, %{now_ms: now_ms} = mission)
      when now_ms != nil,
      do: result(hear(mission, from, Map.new(said)), [])

  def handle({:outcome, {:go, go}, outcome}, %{go: go} = mission),
    do: result(arrived(mission, outcome), [])

  def handle({:outcome, {:search, n}, outcome}, mission),
    do: result(%{mission | search: Search.ended(mission.search, n, outcome)}, [])

  def handle({:tick, %{pose: nil}}, mission), do: result(mission, [])

  def handle({:tick, percept}, %{started?: true} = mission) do
    before = mission.phase
    mission = %{mission | now_ms: percept.at_ms} |> look(percept) |> forget() |> aim(percept)
    scene = scene(mission, percept)
    mission = decide(mission, scene, percept)
    {mission, told} = tell(mission, scene, percept)
    {goal, mission} = Moves.goal(mission, scene, percept)
    stages = Words.stages(mission, before)

    result(
      mission,
      stages ++
        told ++ [goal, {:look, Moves.pan(scene, percept)}, {:claim, Words.claim(mission, scene)}]
    )
  end

  def handle(_event, mission), do: result(mission, [])

  defp result(%{started?: false} = mission, effects), do: {:idle, mission, effects}
  defp result(mission, effects), do: {mission.phase, mission, effects}

  # A picture counts once.
  defp look(%{picture_ms: at_ms} = mission, %{detections: %{at_ms: at_ms}}), do: mission

  defp look(mission, %{detections: %{at_ms: at_ms}} = percept) do
    case Sight.ball(percept, mission.colour, mission.radius) do
      nil ->
        %{mission | picture_ms: at_ms}

      {place, var} ->
        note(%{mission | picture_ms: at_ms, sighting: {place, var, at_ms}}, place, var, at_ms)
    end
  end

  defp look(mission, _without_picture), do: mission

  defp note(mission, place, var, at_ms) do
    track = Track.note(mission.track, place, var, at_ms)
    %{mission | track: track, trail: mission.trail |> trail(track.at) |> Enum.take(@trail)}
  end

  defp trail([newest | _] = trail, at),
    do: if(Pose.distance(newest, at) < 0.2, do: trail, else: [at | trail])

  defp trail([], at), do: [at]

  defp hear(%{plan: plan} = mission, from, %{plan: plan} = said) do
    if is_map_key(mission.heard, from) or map_size(mission.heard) < @most_peers do
      peer = %{
        at_ms: mission.now_ms,
        cost: said.cost_mm && said.cost_mm / 1000,
        drives?: said.drives
      }

      seen(%{mission | heard: Map.put(mission.heard, from, peer)}, said)
    else
      mission
    end
  end

  defp hear(mission, _from, _of_others), do: mission

  defp seen(mission, %{at: nil}), do: mission

  defp seen(mission, %{at: {x, y}, sd_mm: sd, age_ms: age_ms}),
    do: note(mission, {x / 1000, y / 1000}, sd * sd / 1.0e6, mission.now_ms - age_ms)

  defp forget(mission) do
    heard =
      for {id, peer} <- mission.heard, mission.now_ms - peer.at_ms < @forget_ms, do: {id, peer}

    failed = Enum.filter(mission.failed, fn {_at, ms} -> mission.now_ms - ms < @failed_ms end)
    %{mission | heard: Map.new(heard), failed: failed}
  end

  # Once a second: where to push the ball next on its way past walls.
  defp aim(%{track: nil} = mission, _percept), do: mission

  defp aim(%{aim: {_place, at_ms}, now_ms: now_ms} = mission, _percept)
       when now_ms - at_ms < @aim_ms,
       do: mission

  defp aim(mission, %{grid: grid, profile: profile}) do
    {ball, _sd} = Track.place(mission.track, mission.now_ms)
    %{mission | aim: {Push.aim(ball, mission.goal, grid, profile.radius), mission.now_ms}}
  end

  # All that is asked of the ball and what is round it at this tick; `nil` while no robot knows where it is.
  defp scene(mission, percept) do
    if Track.state(mission.track, mission.now_ms) == :found do
      {ball, sd} = Track.place(mission.track, mission.now_ms)
      others = for {id, peer} <- percept.peers, do: {id, Pose.point(peer.pose), peer.mode}

      %{
        ball: ball,
        sd: sd,
        ball_radius: mission.radius,
        goal: elem(mission.aim || {mission.goal, 0}, 0),
        far: Pose.distance(ball, mission.goal),
        speed: Track.speed(mission.track, mission.now_ms),
        radius: percept.profile.radius,
        grid: percept.grid,
        others: others,
        taken:
          for({_id, at, mode} <- others, mode == :dead, do: at) ++
            for({at, _ms} <- mission.failed, do: at)
      }
    end
  end

  defp decide(mission, nil, _percept),
    do: %{mission | phase: :search, driver: %Driver{}, looks?: false, why: nil}

  defp decide(mission, scene, percept) do
    within = if mission.phase == :scored, do: mission.within + @leaves, else: mission.within

    if scene.far < within and scene.speed < @lies do
      %{mission | phase: :scored, driver: %Driver{}, looks?: false, why: nil}
    else
      behind = Push.behind(scene)
      cost = cost(mission, behind, percept)
      driver = Driver.tick(mission.driver, mission.me, cost, mission.heard, mission.now_ms)
      mission = %{mission | driver: driver, why: why(mission, behind)}

      if Driver.drives?(driver),
        do: mission |> drive(scene, behind, percept) |> persist(scene, percept),
        else: %{mission | phase: :ring, held: nil}
    end
  end

  defp why(_mission, nil), do: "no room behind the ball"
  defp why(%{failed: [_ | _]}, _behind), do: "the ball did not move when it was pushed"
  defp why(_mission, _behind), do: nil

  # One that pushes for long, and the ball does not move, leaves it to others, and next time does it from another side.
  defp persist(
         %{phase: :push, held: {was, since_ms}, now_ms: now_ms} = mission,
         %{ball: ball},
         percept
       ) do
    cond do
      Pose.distance(was, ball) > @moved ->
        %{mission | held: {ball, now_ms}, failed: []}

      now_ms - since_ms < @patience_ms ->
        mission

      true ->
        failed = [{Pose.point(percept.pose), now_ms} | mission.failed]
        aside_ms = now_ms + @aside_ms

        %{
          mission
          | phase: :ring,
            driver: %Driver{left_ms: now_ms},
            held: nil,
            failed: failed,
            aside_ms: aside_ms
        }
    end
  end

  defp persist(%{phase: :push} = mission, scene, _percept),
    do: %{mission | held: {scene.ball, mission.now_ms}}

  defp persist(mission, _scene, _percept), do: %{mission | held: nil}

  defp cost(_mission, nil, _percept), do: nil

  defp cost(%{aside_ms: aside_ms, now_ms: now_ms}, _behind, _percept)
       when aside_ms != nil and now_ms < aside_ms,
       do: nil

  defp cost(_mission, {place, _side}, percept), do: Pose.distance(percept.pose, place)

  defp drive(mission, scene, {_place, side}, %{pose: pose}) do
    looks? = scene.sd > if(mission.looks?, do: @sure, else: @unsure)
    pushes? = mission.phase == :push
    side = if pushes?, do: mission.side, else: side
    slow? = scene.far > mission.within * 0.7 or scene.speed < @lies

    push? =
      not looks? and slow? and Driver.sure?(mission.driver, mission.now_ms) and Push.alone?(scene) and
        Push.pushes?(scene, pose, side, pushes?)

    %{mission | phase: if(push?, do: :push, else: :approach), side: side, looks?: looks?}
  end

  defp arrived(%{phase: :approach} = mission, outcome) when outcome != 1,
    do: %{mission | rests?: true, aside_ms: (mission.now_ms || 0) + @aside_ms}

  defp arrived(mission, _outcome), do: %{mission | rests?: true}

  defp tell(%{told_ms: told_ms, now_ms: now_ms} = mission, _scene, _percept)
       when told_ms != nil and now_ms - told_ms < @tell_ms,
       do: {mission, []}

  defp tell(%{now_ms: now_ms} = mission, scene, percept) do
    cost = scene && cost(mission, Push.behind(scene), percept)
    {at, sd, age_ms} = told(mission.sighting, now_ms)

    body = [
      plan: mission.plan,
      at: at,
      sd_mm: sd,
      age_ms: age_ms,
      cost_mm: cost && min(round(1000 * cost), @most_mm),
      drives: Driver.drives?(mission.driver)
    ]

    {%{mission | told_ms: now_ms, sighting: nil}, [{:tell, :all, :ball, body}]}
  end

  defp told({{x, y}, var, at_ms}, now_ms) when now_ms - at_ms <= 1_000 do
    sd = round(1000 * :math.sqrt(var))

    if sd <= 10_000 and abs(x) < 1.0e4 and abs(y) < 1.0e4,
      do: {{round(1000 * x), round(1000 * y)}, max(sd, 1), max(now_ms - at_ms, 0)},
      else: {nil, 1, 0}
  end

  defp told(_none, _now_ms), do: {nil, 1, 0}

  @impl Robot.Mission
  defdelegate explain(mission), to: Words

  @impl Robot.Mission
  defdelegate layer(mission), to: Words
end
