defmodule Sim.Trial.Score do
  @moduledoc """
  A run judged from outside, by true poses: how far each robot is from its slot, counted from the
  leader's true pose. Robots never see this. Pure.
  """
  alias Hal.Pose
  alias Sim.{Scene, World}
  alias Sim.Trial
  alias Sim.Trial.Ledger
  alias Swarm.{Anchor, Formation, Member}

  @doc "What a viewer sees."
  @spec scene(Trial.t()) :: Scene.t()
  def scene(trial) do
    leader = Ledger.leader(trial.ledger)
    slots = slots(trial, leader)

    robots =
      for id <- trial.options.robots do
        claim = claim(trial, id)
        {_index, slot} = Map.get(slots, id, {nil, nil})

        %{
          id: id,
          pose: World.truth(trial.world, id),
          radius: Trial.profile(id).radius,
          alive: claim != nil,
          state: state(claim),
          slot: slot && Pose.point(slot),
          leader?: id == leader,
          size_ppm: size(claim)
        }
      end

    %Scene{
      at_ms: trial.at_ms,
      map: trial.map,
      landmark: trial.world.landmark,
      robots: robots,
      leader: leader,
      epoch: trial.ledger.epoch,
      formation: formation(trial, leader),
      error: error(robots),
      formed?: Trial.formed?(trial),
      stages: Ledger.stages(trial.ledger)
    }
  end

  @doc "The report of a run, but for its wall time; keys as in the report."
  @spec result(Trial.t()) :: map()
  def result(trial) do
    scene = scene(trial)
    leader = scene.leader
    slots = slots(trial, leader)
    {mean, max} = scene.error || {nil, nil}
    {kind, spacing} = scene.formation

    %{
      seed: trial.options.seed,
      map: trial.options.map,
      robots: length(trial.options.robots),
      simulated_s: trial.at_ms / 1000,
      stages: scene.stages,
      leader: leader,
      leaders_at_once_max: trial.ledger.leaders_at_once_max,
      leader_changes: max(trial.ledger.elections - 1, 0),
      formation: %{
        kind: kind,
        spacing_m: spacing,
        error_mean_m: mean,
        error_max_m: max,
        share_of_time_formed: Ledger.share_formed(trial.ledger)
      },
      landmark_distance_m:
        leader && scene.landmark &&
          Pose.distance(World.truth(trial.world, leader), scene.landmark),
      collisions: trial.world.collisions,
      min_separation_m: trial.world.min_separation,
      messages: %{sent: trial.radio.sent, lost: trial.radio.lost},
      fleet: for(robot <- scene.robots, do: row(robot, Map.get(slots, robot.id)))
    }
  end

  defp row(robot, slot) do
    %{
      name: robot.id,
      alive: robot.alive,
      state: robot.state,
      x: robot.pose.x,
      y: robot.pose.y,
      theta: robot.pose.heading,
      slot: if(robot.leader?, do: 0, else: slot && elem(slot, 0)),
      error_m: Scene.slot_error(robot),
      size_ppm: robot.size_ppm
    }
  end

  # Slot number and true pose of each follower that the leader has in its order.
  defp slots(_trial, nil), do: %{}

  defp slots(trial, leader) do
    case Member.claim(trial.members[leader]) do
      %{anchor: %Anchor{} = anchor} ->
        pose = World.truth(trial.world, leader)
        landmark = trial.world.landmark
        distance = if landmark, do: Pose.distance(pose, landmark), else: 1.6

        anchor
        |> true_slots(pose, distance)
        |> Enum.zip(anchor.order)
        |> Map.new(fn {{place, slot}, id} -> {id, {place, slot}} end)

      _no_anchor ->
        %{}
    end
  end

  # The slots as the leader means them, hung from where it really stands.
  defp true_slots(%Anchor{trail: nil} = anchor, pose, distance) do
    slots = anchor.formation |> Formation.slots(anchor.size, distance) |> List.to_tuple()
    for place <- anchor.places, do: {place, Pose.compose(pose, elem(slots, place - 1))}
  end

  defp true_slots(%Anchor{trail: trail, pose: {x, y, heading}}, pose, _distance) do
    believed = Pose.new(x / 1000, y / 1000, heading / 1000)

    for {{sx, sy, sh}, place} <- Enum.with_index(trail, 1) do
      slot = Pose.relative(believed, Pose.new(sx / 1000, sy / 1000, sh / 1000))
      {place, Pose.compose(pose, slot)}
    end
  end

  defp formation(trial, leader) do
    case leader && Member.claim(trial.members[leader]) do
      %{anchor: %{formation: formation}} -> formation
      _none -> trial.options.formation
    end
  end

  defp error(robots) do
    case for robot <- robots, robot.alive, e = Scene.slot_error(robot), do: e do
      [] -> nil
      errors -> {Enum.sum(errors) / length(errors), Enum.max(errors)}
    end
  end

  defp claim(trial, id) do
    case trial.members do
      %{^id => member} -> Member.claim(member)
      _dead -> nil
    end
  end

  defp state(nil), do: :dead
  defp state(%{blocked: true}), do: :blocked
  defp state(%{phase: :follow, in_place: true}), do: :in_place
  defp state(%{phase: phase}), do: phase
  defp state(_new), do: :idle

  defp size(%{sight: %{size_ppm: size}}), do: size
  defp size(_blind), do: nil
end
