defmodule Lab.Corridor do
  @moduledoc "Robots that are sent through a corridor or a door, both ways, in lockstep."
  alias Hal.Pose
  alias Sim.Floorplan.{Drawing, Shape}
  alias Lab.Trial
  alias Lab.Trial.Setup

  @doc "Two rooms, and between them a corridor, or a door, of this width and length (metres) along x; `shapes` are drawn over it."
  @spec map(float(), float(), [Shape.t()]) :: Sim.Floorplan.t()
  def map(width, length, shapes \\ []) do
    {x, y} = {length / 2 + 4.0, 2.5}

    walls = [
      {:wall, {:box, -length / 2, -y, length / 2, y}},
      {:free, {:box, -length / 2, -width / 2, length / 2, width / 2}}
    ]

    shapes = walls ++ shapes ++ Shape.frame(x, y, 0.2)
    struct!(Sim.Floorplan, Drawing.plan("corridor", {2 * x, 2 * y}, {-x, -y, x, y}, shapes))
  end

  @doc "Where robots begin and are sent to, each from its room into the other, by the seed; `half` is half the length between the rooms."
  @spec robots([{atom(), :left | :right}], float(), integer()) :: [
          {atom(), Pose.t(), Pose.point()}
        ]
  def robots(sides, half, seed) do
    {robots, _random} =
      sides
      |> Enum.with_index()
      |> Enum.map_reduce(:rand.seed_s(:exsss, seed), fn {{id, side}, k}, random ->
        {[a, b, c, d, e], random} =
          Enum.map_reduce(1..5, random, fn _, r -> :rand.uniform_s(r) end)

        sign = if side == :left, do: -1, else: 1
        # Those of one room begin and end one beside the other.
        {low, high} = {1.5 * rem(k, 2) - 1.5, 1.5 * rem(k, 2)}
        y = fn share -> low + 0.2 + share * (high - low - 0.4) end
        from = Pose.new(sign * (half + 1.0 + 2.0 * a), y.(b), 6.28 * c)
        {{id, from, {-sign * (half + 1.5 + 1.3 * d), y.(e)}}, random}
      end)

    robots
  end

  @doc """
  How it ended: when each arrived (s), the least gap between two (metres), and the collisions. `plan` is that of the
  robots, which may differ from the `map`: `:sonar`, or the map that they have.
  """
  @spec run(Sim.Floorplan.t(), Sim.Floorplan.t() | :sonar, integer(), [tuple()], pos_integer()) ::
          %{ended: map(), gap: float(), collisions: non_neg_integer(), trial: Trial.t()}
  def run(map, plan, seed, robots, limit_s) do
    ids = for {id, _from, _goal} <- robots, do: id
    trial = map |> setup(plan, seed, robots) |> Trial.begin()

    trial =
      for {id, _from, {x, y}} <- robots, reduce: trial do
        trial -> Trial.command(trial, id, {:goto, x, y, nil})
      end

    go(trial, ids, limit_s * 1000, %{}, 99.0)
  end

  @doc "The start of such a run."
  @spec setup(Sim.Floorplan.t(), Sim.Floorplan.t() | :sonar, integer(), [tuple()]) :: Setup.t()
  def setup(map, plan, seed, robots) do
    ids = for {id, _from, _goal} <- robots, do: id
    options = %{robots: ids, map: "doorway", seed: seed, landmark: :none, blobs: :direct}
    kind = if plan == :sonar, do: :sonar, else: :known
    {:ok, setup} = Trial.setup(Map.merge(options, %{plan: kind, duration_s: 10_000}))

    bodies =
      for {id, from, _} <- robots, do: %{id: id, profile: setup.options.bodies[id], pose: from}

    world = Sim.World.new!(map: map, seed: seed, noise: :default, robots: bodies)

    starts =
      for {robot, {_id, from, _}} <- Enum.zip(setup.robots, robots), do: %{robot | start: from}

    plan = if plan == :sonar, do: setup.plan, else: Sim.Floorplan.grid(plan)
    %{setup | map: map, world: world, plan: plan, robots: starts}
  end

  defp go(trial, ids, limit_ms, ended, gap)
       when trial.at_ms >= limit_ms or map_size(ended) == length(ids),
       do: %{ended: ended, gap: gap, collisions: Trial.result(trial).collisions, trial: trial}

  defp go(trial, ids, limit_ms, ended, gap) do
    trial = Trial.step(trial)

    ended =
      Enum.reduce(ids, ended, fn id, ended ->
        case Swarm.Member.runner(Trial.robot(trial, id)) do
          %{phase: :done} ->
            Map.put_new(ended, id, {:done, trial.at_ms / 1000})

          %{phase: :given_up, claim: %{blocked_by: why}} ->
            Map.put_new(ended, id, {:given_up, why, trial.at_ms / 1000})

          _under_way ->
            ended
        end
      end)

    go(trial, ids, limit_ms, ended, min(gap, gap(Trial.scene(trial).robots)))
  end

  defp gap(robots) do
    for a <- robots, b <- robots, a.id < b.id, reduce: 99.0 do
      gap ->
        min(gap, Pose.distance(a.pose, b.pose) - a.radius - b.radius)
    end
  end
end
