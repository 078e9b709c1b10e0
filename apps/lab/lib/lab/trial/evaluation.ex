defmodule Lab.Trial.Evaluation do
  @moduledoc false
  # Evaluates a run from outside, by true poses: how far each robot is from its slot, relative to
  # the leader's true pose. Robots never see this. Pure.
  alias Hal.Pose
  alias Sim.{Scene, World}
  alias Lab.Trial.{AgreementMetrics, Claims, RunLog, Progress}

  @typedoc "A run at one moment; `claims` are those of the living robots."
  @type run :: %{
          at_ms: non_neg_integer(),
          options: map(),
          world: World.t(),
          run_log: RunLog.t(),
          claims: %{atom() => map()},
          messages: %{sent: non_neg_integer(), lost: non_neg_integer()}
        }

  @doc "The scene for viewers."
  @spec scene(run()) :: Scene.t()
  def scene(run) do
    leader = RunLog.leader(run.run_log)
    shape = shape(run, leader)

    robots =
      for id <- run.options.robots do
        claim = run.claims[id]
        {_index, slot} = Map.get(shape.slots, id, {nil, nil})
        account = account(run, claim)

        %{
          id: id,
          pose: World.truth(run.world, id),
          radius: run.options.bodies[id].radius,
          corners: Hal.Profile.corners(run.options.bodies[id]),
          alive: claim != nil,
          state: account.state,
          slot: slot && Pose.point(slot),
          leader?: id == leader,
          believed: claim[:believed],
          uncertainty: claim[:uncertainty],
          blocked_by: claim[:blocked_by],
          says: claim[:says],
          crashed: claim[:crashed],
          arming: claim[:arming],
          fault: claim[:fault],
          offline: claim[:offline] || [],
          size_ppm: account.sight && account.sight.size_ppm
        }
      end

    %Scene{
      at_ms: run.at_ms,
      map: run.world.map,
      landmark: run.world.landmark,
      objects: Enum.map(run.world.objects, &World.Object.thing/1),
      robots: robots,
      mission: most(for {_id, %{mission: module}} <- Enum.sort(run.claims), do: module),
      layer: layer([leader | run.options.robots], &run.claims[&1][:layer]),
      leader: leader,
      epoch: run.run_log.epoch,
      formation: shape.formation,
      error: error(robots),
      formed?: RunLog.formed?(run.run_log),
      estop: run.run_log.estop,
      stages: RunLog.stages(run.run_log)
    }
  end

  @doc "What the mission of the first of these robots draws that draws something; `drawn` says what one draws, if anything."
  @spec layer([atom()], (atom() -> Robot.Mission.layer() | nil)) :: Robot.Mission.layer()
  def layer(robots, drawn) do
    Enum.find_value(robots, [], fn id ->
      with [_ | _] = layer <- drawn.(id), do: layer, else: (_nothing -> nil)
    end)
  end

  # What most of the robots do, by the name that people call it.
  defp most([]), do: nil

  defp most(modules) do
    counts = Enum.frequencies(modules)
    modules |> Enum.max_by(&counts[&1]) |> Swarm.MissionRegistry.name()
  end

  @doc "The report of a run, without its wall time; keys as in the report."
  @spec result(run()) :: map()
  def result(run) do
    scene = scene(run)
    leader = scene.leader
    slots = shape(run, leader).slots
    {mean, max} = scene.error || {nil, nil}
    {kind, spacing} = scene.formation

    %{
      seed: run.options.seed,
      map: run.options.map,
      robots: length(run.options.robots),
      simulated_s: run.at_ms / 1000,
      stages: scene.stages,
      leader: leader,
      leaders_at_once_max: run.run_log.leaders_at_once_max,
      leader_changes: max(run.run_log.elections - 1, 0),
      mission: mission(run.options) || scene.mission,
      formation: %{
        kind: kind,
        spacing_m: spacing,
        error_mean_m: mean,
        error_max_m: max,
        share_of_time_formed: RunLog.share_formed(run.run_log)
      },
      landmark_distance_m:
        leader && scene.landmark &&
          Pose.distance(World.truth(run.world, leader), scene.landmark),
      collisions: run.world.collisions,
      min_separation_m: run.world.min_separation,
      claims: Claims.report(run.run_log.claims, run.at_ms, &worst(run, &1)),
      stuck: Progress.report(run.run_log.stuck),
      messages: run.messages,
      agreement: AgreementMetrics.report(run.run_log.agreement),
      fleet: for(r <- scene.robots, do: row(r, Map.get(slots, r.id), run.claims[r.id]))
    }
  end

  # The one that was asked for by its name; of robots that a person has given another one, what most of them are on.
  defp mission(%{mission: {module, _options}}), do: Swarm.MissionRegistry.name(module)
  defp mission(_default), do: nil

  @doc """
  How far the worst living robot of a leader's shape is from its slot, in metres; `nil` if it
  leads none.
  """
  @spec worst(run(), leader :: atom()) :: float() | nil
  def worst(run, leader) do
    errors =
      for {id, {_place, slot}} <- shape(run, leader).slots,
          is_map_key(run.claims, id),
          do: Pose.distance(World.truth(run.world, id), slot)

    Enum.max(errors, fn -> nil end)
  end

  @doc "The living followers whose progress `Lab.Trial.Progress` judges."
  @spec followers(run()) :: [Progress.row()]
  def followers(run) do
    leader = RunLog.leader(run.run_log)

    for {id, {_place, slot}} <- shape(run, leader).slots, claim = run.claims[id], claim != nil do
      error_m = Pose.distance(World.truth(run.world, id), slot)
      %{id: id, under_way?: under_way?(run.run_log, claim), error_m: error_m, slot: slot}
    end
  end

  # It claims neither to be in place, nor to be blocked, nor to be unsure of its place, and it has not been stopped.
  defp under_way?(log, claim), do: log.roles[RunLog.account(log, claim).state] == :follows

  defp row(robot, slot, claim) do
    %{
      name: robot.id,
      alive: robot.alive,
      state: robot.state,
      blocked_by: claim[:blocked_by],
      formed?: claim[:formed] == true,
      says: claim[:says],
      x: robot.pose.x,
      y: robot.pose.y,
      theta: robot.pose.heading,
      slot: if(robot.leader?, do: 0, else: slot && elem(slot, 0)),
      error_m: Scene.slot_error(robot),
      uncertainty_m: robot.uncertainty,
      size_ppm: robot.size_ppm
    }
  end

  # As the leader means it, where it truly stands.
  defp shape(run, leader) do
    none = %{formation: run.options.formation, slots: %{}}
    claim = leader && run.claims[leader]
    if claim, do: meant(run, World.truth(run.world, leader), claim) || none, else: none
  end

  defp meant(%{world: %{landmark: landmark}} = run, pose, claim) do
    ahead_m = if landmark, do: Pose.distance(pose, landmark), else: 1.6
    Robot.Mission.shape(run.run_log.mission, claim, pose, ahead_m)
  end

  defp error(robots) do
    case for robot <- robots, robot.alive, e = Scene.slot_error(robot), do: e do
      [] -> nil
      errors -> {Enum.sum(errors) / length(errors), Enum.max(errors)}
    end
  end

  # What its claim says of a robot; `nil` is that of one that is dead.
  defp account(run, claim), do: account_of(run.run_log.mission, claim)

  @doc "What the claim of a robot on this mission says, for people: `state` is one word for what it does; `nil` is that of one that is dead."
  @spec account_of(module() | nil, map() | nil) :: Robot.Mission.account()
  def account_of(_mission, nil), do: %{state: :dead, says: [], sight: nil}

  def account_of(mission, claim) do
    account = Robot.Mission.account(mission, claim)
    # What keeps it from moving comes before what it would do.
    if is_map_key(claim, :estop), do: %{account | state: :estop}, else: account
  end
end
