defmodule Bench.Goto do
  @moduledoc """
  Measures how well one robot that has the floor plan gets from a place to another: `mix bench goto`. A draw is one run in lockstep
  with default noise, from a random free pose to a random place that a way leads to; all of it follows from map and seed.
  """
  alias Hal.Pose
  alias Nav.{Grid, Reach}
  alias Lab.{Run, Trial}
  alias Lab.Trial.Setup
  alias Swarm.Member

  # It counts as there if it truly is so near to the goal (metres): 0.1 is what it aims at by its own estimate.
  @there_m 0.5
  # It has so many times the time of the shortest way, and so many seconds more, before it counts as silent.
  @times 4
  @more_s 60
  # A start is so far from all walls (metres), and a goal so far from the start.
  @start_m 0.1
  @apart_m 1.0
  @tries 100_000

  @typedoc """
  `ended` is what the robot says: `:done`, `{:given_up, blocked_by}`, or nothing within its time (`:silent`). `off_m` is how far
  it truly is from the goal then, `worst_s` the time that the shortest way takes at top speed.
  """
  @type measured :: %{
          map: String.t(),
          seed: integer(),
          from: Pose.t(),
          goal: Pose.point(),
          ended: :done | {:given_up, String.t()} | :silent,
          off_m: float(),
          took_s: float(),
          way_m: float(),
          way_s: float(),
          collisions: non_neg_integer()
        }

  @doc "One draw."
  @spec run(map :: String.t(), seed :: integer()) :: {:ok, measured()} | {:error, String.t()}
  def run(map, seed) do
    kind = Enum.at([:mag1, :min1], rem(seed, 2))
    options = %{robots: [kind], map: map, seed: seed, landmark: :none, plan: :known}

    with {:ok, setup} <- Trial.setup(Map.merge(options, %{blobs: :direct, duration_s: 10_000})),
         {:ok, {from, goal, way_m}} <- draw(setup, kind, seed) do
      {:ok, drive(placed(setup, from), kind, goal, way_m, seed)}
    end
  end

  @doc "A setup of one robot with that robot elsewhere than the setup puts it."
  @spec placed(Setup.t(), Pose.t()) :: Setup.t()
  def placed(%{robots: [robot], map: map, options: options} = setup, from) do
    body = %{id: robot.id, profile: robot.profile, pose: from}
    world = Sim.World.new!(map: map, seed: options.seed, noise: options.noise, robots: [body])
    %{setup | world: world, robots: [%{robot | start: from}]}
  end

  @doc "Start, goal and the length of the shortest way (metres) of a draw."
  @spec draw(Setup.t(), atom(), integer()) ::
          {:ok, {Pose.t(), Pose.point(), float()}} | {:error, String.t()}
  def draw(%{map: map, plan: plan} = setup, kind, seed) do
    radius = setup.options.bodies[kind].radius
    state = :rand.seed_s(:exsss, {seed, :erlang.phash2(map.name), 1})
    pair(map, plan, radius, state, @tries)
  end

  defp pair(map, _plan, _radius, _state, 0),
    do: {:error, "map #{map.name} has no two free places with a way between them"}

  defp pair(map, plan, radius, state, left) do
    {from, state} = place(map, state)
    {goal, state} = place(map, state)
    {turn, state} = :rand.uniform_s(state)

    with true <- Sim.Floorplan.free?(map, from, radius + @start_m),
         true <- Pose.distance(from, goal) >= @apart_m,
         true <- Sim.Floorplan.free?(map, goal, radius),
         :ok <- Reach.check(plan, from, goal, radius) do
      {x, y} = from
      {:ok, {Pose.new(x, y, 2 * :math.pi() * turn), goal, shortest(plan, from, goal, radius)}}
    else
      _unfit -> pair(map, plan, radius, state, left - 1)
    end
  end

  defp place(map, state) do
    {width, height} = Sim.Floorplan.size(map)
    {x, state} = :rand.uniform_s(state)
    {y, state} = :rand.uniform_s(state)
    {{(x - 0.5) * width, (y - 0.5) * height}, state}
  end

  # The ways of robots keep away from walls where they can; the shortest is found where all room is alike. Of its cells
  # only straight and diagonal steps are known, so the robots' way, which is pulled straight, may be shorter.
  defp shortest(plan, from, goal, radius) do
    need = Grid.needed(Reach.room(radius))

    alike =
      for <<clear <- plan.clear>>, into: <<>>, do: if(clear < need, do: <<0>>, else: <<255>>)

    [a, b] = for place <- [from, goal], do: cell(plan, place, radius)
    cells = Grid.kernel().way(alike, plan.width, plan.height, need, <<>>, a, b)
    steps = cells |> Enum.zip(tl(cells)) |> Enum.map(&step(&1, plan)) |> Enum.sum()
    planned = Grid.Way.find(plan, from, goal, Reach.room(radius))

    corners =
      [from | planned] |> Enum.zip(planned) |> Enum.map(fn {a, b} -> Pose.distance(a, b) end)

    min(steps, Enum.sum(corners))
  end

  defp cell(plan, place, radius) do
    {:ok, near} = Grid.Way.near(plan, place, Reach.room(radius))
    {i, j} = Grid.index(plan, near)
    j * plan.width + i
  end

  defp step({a, b}, plan) when abs(a - b) in [1, plan.width], do: plan.cell
  defp step(_diagonal, plan), do: plan.cell * :math.sqrt(2)

  defp drive(setup, kind, {x, y} = goal, way_m, seed) do
    way_s = way_m / setup.options.bodies[kind].max_linear
    limit_ms = round(1000 * (@more_s + @times * way_s))
    trial = setup |> Trial.begin() |> Trial.command(kind, {:goto, x, y, nil})

    over? = &(&1.at_ms >= limit_ms or ended(&1, kind) != :silent)
    trial = Run.play(trial, over?)
    [robot] = Trial.scene(trial).robots

    %{
      map: setup.map.name,
      seed: seed,
      from: hd(setup.robots).start,
      goal: goal,
      ended: ended(trial, kind),
      off_m: Pose.distance(robot.pose, goal),
      took_s: trial.at_ms / 1000,
      way_m: way_m,
      way_s: way_s,
      collisions: Trial.result(trial).collisions
    }
  end

  defp ended(trial, kind) do
    case Member.runner(Trial.robot(trial, kind)) do
      %{phase: :done} -> :done
      %{phase: :given_up, claim: %{blocked_by: why}} -> {:given_up, why}
      _under_way -> :silent
    end
  end

  @doc "Whether a robot that says that it is there truly is."
  @spec arrived?(measured()) :: boolean()
  def arrived?(measured), do: measured.ended == :done and measured.off_m <= @there_m
end
