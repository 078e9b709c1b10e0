defmodule Bench.Explore do
  @moduledoc """
  Measures one exploration of a map that the robots do not know, and what of it they have seen at which time: `mix bench
  explore`. In lockstep with default noise; all of it follows from map, number of robots and seed.

  The area, and what of it is seen: `Lab.Trial.Coverage`.
  """
  alias Hal.Pose
  alias Lab.{Run, Trial}
  alias Lab.Trial.Coverage
  alias Swarm.Member

  @share 0.95
  # A wall on the map that is so near to a true one (metres) is one; one that is farther away than this is wrong.
  @near_m 0.3
  @wrong_m 0.2

  @typedoc """
  When 95 % of the area were seen, and when all robots said that they are ready (seconds, `nil` for never); the share that
  was seen in the end; how many of the map's cells of wall are within 0.3 m of a true wall, and how many farther than
  0.2 m from any (`nil` of a map without a wall); how far the worst robot was from where it believed to be at the end.
  """
  @type measured :: %{
          map: String.t(),
          robots: pos_integer(),
          seed: integer(),
          area_m2: float(),
          seen_s: float() | nil,
          ready_s: float() | nil,
          share: float(),
          walls: float() | nil,
          wrong: float() | nil,
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
      area = Coverage.area(setup.map, Enum.map(setup.robots, &Pose.point(&1.start)))
      seen = %{area: area, seen_s: nil, share: 0.0}
      run = setup |> Trial.begin() |> Run.new()
      {%{source: trial}, seen} = Run.fold(run, seen, &Run.done?/1, &note/3)
      {:ok, measure(trial, look(trial, seen), plan, options)}
    end
  end

  defp note(_before, %{source: trial} = run, seen),
    do: {run, if(rem(trial.at_ms, 1_000) == 0, do: look(trial, seen), else: seen)}

  defp look(trial, seen) do
    share = Coverage.share(seen.area, Coverage.fullest(trial))
    seen_s = seen.seen_s || if(share >= @share, do: trial.at_ms / 1_000)
    %{seen | share: share, seen_s: seen_s}
  end

  defp measure(trial, seen, plan, options) do
    map = Coverage.fullest(trial)
    right = Coverage.walls(map, plan, @wrong_m)
    ready? = Trial.formed?(trial)

    off =
      for id <- Trial.living(trial) do
        believed = Member.role(Trial.robot(trial, id), :executive).controller.percept.pose
        Pose.distance(believed, Sim.World.truth(trial.world, id))
      end

    %{
      map: options.map,
      robots: length(options.robots),
      seed: options.seed,
      area_m2: Coverage.size_m2(seen.area),
      seen_s: seen.seen_s,
      ready_s: if(ready?, do: trial.at_ms / 1_000),
      share: seen.share,
      walls: Coverage.walls(map, plan, @near_m),
      wrong: right && 1.0 - right,
      off_m: Enum.max(off),
      collisions: Trial.result(trial).collisions
    }
  end
end
