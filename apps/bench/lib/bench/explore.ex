defmodule Bench.Explore do
  @moduledoc """
  One exploration of a map that the robots do not know, and what of it they have seen at which time: `mix bench explore`. In
  lockstep with default noise; all of it follows from map, number of robots and seed.

  The area is where the middle of a Magellan can come to from the robots' starts, on the true floor plan, in cells of 10 cm. A
  cell is seen when the map of a robot knows it, by the poses that the robots estimate; the robot whose map has most counts.
  """
  alias Hal.Pose
  alias Missions.Explore
  alias Missions.Explore.SharedMap
  alias Robot.Navigation.{Grid, Reach, Survey}
  alias Sim.Trial

  @share 0.95
  @radius Hal.Profile.magellan().radius
  # A wall on the map that is so near to a true one (metres) is one.
  @near_m 0.3

  @typedoc """
  When 95 % of the area were seen, and when all robots said that they are ready (seconds, `nil` for never); the share that
  was seen in the end; how many of the map's cells of wall are within 0.3 m of a true wall; how far the worst robot was
  from where it believed to be at the end.
  """
  @type measured :: %{
          map: String.t(),
          robots: pos_integer(),
          seed: integer(),
          area_m2: float(),
          seen_s: float() | nil,
          ready_s: float() | nil,
          share: float(),
          walls: float(),
          off_m: float(),
          collisions: non_neg_integer()
        }

  @doc "One run, of so many simulated seconds at most."
  @spec run(String.t(), pos_integer(), integer(), pos_integer(), atom()) ::
          {:ok, measured()} | {:error, String.t()}
  def run(map, robots, seed, limit_s, plan \\ :none) do
    options = %{
      robots: Console.Fleet.of(robots),
      map: map,
      seed: seed,
      landmark: :none,
      blobs: :direct,
      duration_s: limit_s,
      plan: plan,
      mission: :explore
    }

    with {:ok, setup} <- Trial.setup(options) do
      plan = Sim.Floorplan.grid(setup.map)
      area = area(plan, Enum.map(setup.robots, &Pose.point(&1.start)))
      run = %{area: masks(area), count: MapSet.size(area), seen_s: nil, share: 0.0}
      {trial, run} = setup |> Trial.begin() |> go(run)
      {:ok, measure(trial, run, plan, options)}
    end
  end

  defp go(trial, run) do
    run = if rem(trial.at_ms, 1_000) == 0, do: look(trial, run), else: run
    if Trial.done?(trial), do: {trial, look(trial, run)}, else: go(Trial.step(trial), run)
  end

  defp look(trial, run) do
    share = seen(fullest(trial), run.area) / run.count
    seen_s = run.seen_s || if(share >= @share, do: trial.at_ms / 1_000)
    %{run | share: share, seen_s: seen_s}
  end

  defp fullest(trial) do
    maps =
      for id <- Trial.living(trial),
          %{mission: %Explore{map: map}} <- [Trial.robot(trial, id).runner],
          do: map

    Enum.max_by(maps, & &1.free)
  end

  defp seen(%SharedMap{tiles: tiles}, area),
    do: for({at, states} <- tiles, mask = area[at], reduce: 0, do: (n -> both(states, mask, n)))

  defp both(<<0, states::binary>>, <<_, mask::binary>>, n), do: both(states, mask, n)
  defp both(<<_, states::binary>>, <<1, mask::binary>>, n), do: both(states, mask, n + 1)
  defp both(<<_, states::binary>>, <<_, mask::binary>>, n), do: both(states, mask, n)
  defp both(<<>>, <<>>, n), do: n

  # By tile, a byte for each cell: 1 belongs to the area.
  defp masks(area) do
    tile = Survey.tile()

    cells =
      Enum.group_by(area, fn {i, j} ->
        {Integer.floor_div(i, tile), Integer.floor_div(j, tile)}
      end)

    Map.new(cells, fn {{i, j} = at, cells} ->
      cells = MapSet.new(cells)

      mask =
        for k <- 0..(tile * tile - 1), into: <<>> do
          cell = {i * tile + rem(k, tile), j * tile + div(k, tile)}
          if MapSet.member?(cells, cell), do: <<1>>, else: <<0>>
        end

      {at, mask}
    end)
  end

  # Cells by column and row from the origin, over which a disc can move from these points.
  defp area(plan, starts) do
    cells = for point <- starts, do: cell(point)
    flood(cells, MapSet.new(cells), plan)
  end

  defp flood([], seen, _plan), do: seen

  defp flood([{i, j} | more], seen, plan) do
    next =
      for {a, b} = at <- [{i - 1, j}, {i + 1, j}, {i, j - 1}, {i, j + 1}],
          not MapSet.member?(seen, at),
          Grid.free?(plan, {(a + 0.5) * Survey.cell(), (b + 0.5) * Survey.cell()}, room()),
          do: at

    flood(next ++ more, Enum.reduce(next, seen, &MapSet.put(&2, &1)), plan)
  end

  defp room, do: Reach.room(@radius)
  defp cell({x, y}), do: {floor(x / Survey.cell()), floor(y / Survey.cell())}

  defp measure(trial, run, plan, options) do
    map = fullest(trial)
    ready? = Trial.formed?(trial)

    off =
      for id <- Trial.living(trial) do
        believed = Trial.robot(trial, id).controller.percept.pose
        Pose.distance(believed, Sim.World.truth(trial.world, id))
      end

    %{
      map: options.map,
      robots: length(options.robots),
      seed: options.seed,
      area_m2: run.count * Survey.cell() * Survey.cell(),
      seen_s: run.seen_s,
      ready_s: if(ready?, do: trial.at_ms / 1_000),
      share: run.share,
      walls: walls(map, plan),
      off_m: Enum.max(off),
      collisions: Trial.result(trial).collisions
    }
  end

  defp walls(%SharedMap{tiles: tiles}, plan) do
    tile = Survey.tile()

    near =
      for {{i, j}, states} <- tiles,
          {2, k} <- states |> :binary.bin_to_list() |> Enum.with_index() do
        x = (i * tile + rem(k, tile) + 0.5) * Survey.cell()
        y = (j * tile + div(k, tile) + 0.5) * Survey.cell()
        Grid.clearance(plan, {x, y}) <= @near_m
      end

    Enum.count(near, & &1) / max(length(near), 1)
  end
end
