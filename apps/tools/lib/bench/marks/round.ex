defmodule Bench.Marks.Round do
  @moduledoc """
  Measures what marks that a robot knows are worth: `mix bench marks --round MAP`. A draw is one run in lockstep, on wheels that
  slip: robots with the floor plan, or without, patrol twelve points of a building, in sight of each of which hangs a mark. All of it follows from
  map and seed; points and marks are the same for all seeds of a map.
  """
  alias Hal.Pose
  alias Lab.Trial
  alias Nav.Reach
  alias Robot.Control.Controller
  alias Sim.{Compute, Floorplan, World}
  alias Swarm.Member

  @robots [:mag1, :mag2, :mag3, :min1, :min2, :min3]
  @size 0.3
  @radius 0.35
  # A point is so free (metres), and its mark so far away.
  @free 0.6
  @least 1.0
  @most 3.5
  @draws 3_000
  @round_ms 300_000
  # One is lifted then, and looked at for so long (ms). It knows its place again when it is nearer than this (metres) to where it
  # says, for this long (ms).
  @lift_ms 60_000
  @after_ms 180_000
  @right 0.5
  @lasting_ms 5_000

  @typedoc "A tick: its time (ms), and of each robot how far off it was (metres), and whether that was within what it told."
  @type tick :: {at_ms :: non_neg_integer(), [{off :: float(), inside? :: boolean()}]}

  @doc "The points of a round of a map, each with the mark that hangs in sight of it: where, and the degrees that it faces."
  @spec round(Floorplan.t(), pos_integer()) :: [
          {Pose.point(), {x :: float(), y :: float(), degrees :: float()}}
        ]
  def round(map, count) do
    [{start, _mark} | _] = all = candidates(map)
    plan = Floorplan.grid(map)
    [first | rest] = Enum.filter(all, &(Reach.check(plan, start, elem(&1, 0), @radius) == :ok))
    spread(rest, [first], count)
  end

  # Each as far as can be from all before it.
  defp spread(_rest, chosen, count) when length(chosen) == count, do: Enum.reverse(chosen)

  defp spread(rest, chosen, count) do
    nearest = fn {at, _} -> chosen |> Enum.map(&Pose.distance(at, elem(&1, 0))) |> Enum.min() end
    next = Enum.max_by(rest, nearest)
    spread(List.delete(rest, next), [next | chosen], count)
  end

  defp candidates(map) do
    {width, height} = Floorplan.size(map)
    random = :rand.seed_s(:exsss, {:erlang.phash2(map.name), 12, 1})

    {draws, _random} =
      Enum.map_reduce(1..@draws, random, fn _n, random ->
        {[a, b], random} = Enum.map_reduce(1..2, random, fn _, r -> :rand.uniform_s(r) end)
        {side, random} = :rand.uniform_s(4, random)
        {{{(a - 0.5) * width, (b - 0.5) * height}, side - 1}, random}
      end)

    for {{x, y} = at, side} <- draws,
        Floorplan.free?(map, at, @free),
        {rx, ry, faces} = Enum.at([{1, 0, 180}, {0, 1, -90}, {-1, 0, 0}, {0, -1, 90}], side),
        {way, _axis} = Compute.Rays.wall(Compute.pack(map), x, y, rx * 1.0, ry * 1.0, 2 * @most),
        way > @least and way < @most,
        do: {at, {x + rx * (way - 0.02), y + ry * (way - 0.02), faces * 1.0}}
  end

  @doc "The ticks of five minutes in which six robots patrol, with or without the marks `known:` to them."
  @spec patrol(String.t(), seed :: integer(), :known | :none, known :: :all | []) ::
          {:ok, [tick()]} | {:error, String.t()}
  def patrol(map, seed, plan, known) do
    with {:ok, trial} <- begin(map, seed, plan, known, @robots),
         do: {:ok, trial |> ticks(@round_ms) |> elem(0)}
  end

  @doc """
  Seconds until one of two patrolling robots, which was lifted to another point of the round, is right about its place again for #{div(@lasting_ms, 1000)} s,
  `nil` if not within #{div(@after_ms, 1000)} s.
  """
  @spec lifted(String.t(), seed :: integer(), :known | :none, known :: :all | []) ::
          {:ok, float() | nil} | {:error, String.t()}
  def lifted(map, seed, plan, known) do
    with {:ok, trial} <- begin(map, seed, plan, known, [:mag1, :min1]) do
      {_before, trial} = ticks(trial, @lift_ms)
      truth = World.truth(trial.world, :mag1)

      far =
        trial.map |> round(12) |> Enum.map(&elem(&1, 0)) |> Enum.filter(&free?(trial, &1, truth))

      {number, random} = :rand.uniform_s(length(far), :rand.seed_s(:exsss, {seed, 1, 1}))
      {turn, _random} = :rand.uniform_s(random)
      {x, y} = Enum.at(far, number - 1)
      {later, _trial} = trial |> Trial.displace(:mag1, {x, y, 360.0 * turn}) |> ticks(@after_ms)
      {:ok, right_s(later, @lift_ms)}
    end
  end

  # Another point, where no robot stands.
  defp free?(trial, at, truth) do
    Pose.distance(at, truth) > 3.0 and
      Pose.distance(at, Pose.point(World.truth(trial.world, :min1))) > 1.5
  end

  defp right_s(ticks, from_ms) do
    ticks
    |> Enum.chunk_by(fn {_at_ms, [{off, _inside?} | _]} -> off < @right end)
    |> Enum.find_value(fn [{at_ms, [{off, _} | _]} | _] = chunk ->
      if off < @right and length(chunk) * 100 >= @lasting_ms, do: (at_ms - from_ms) / 1_000
    end)
  end

  defp begin(map, seed, plan, known, robots) do
    with {:ok, floorplan} <- Floorplan.open(map, length(robots)) do
      round = round(floorplan, 12)
      marks = for {{_at, mark}, id} <- Enum.with_index(round, 1), do: {id, mark}

      options = %{
        robots: robots,
        map: map,
        seed: seed,
        landmark: :none,
        plan: plan,
        noise: :slip,
        blobs: :direct,
        duration_s: 10_000,
        mission: {:patrol, points: Enum.map(round, &elem(&1, 0))},
        marks: [size: @size, at: marks, known: known]
      }

      with {:ok, setup} <- Trial.setup(options),
           do: {:ok, setup |> Trial.begin() |> Trial.command(hd(robots), :start)}
    end
  end

  defp ticks(trial, for_ms) do
    Enum.map_reduce(1..div(for_ms, 100), trial, fn _tick, trial ->
      trial = Trial.step(trial)
      {{trial.at_ms, Enum.map(trial.options.robots, &sample(trial, &1))}, trial}
    end)
  end

  defp sample(trial, id) do
    %{pose: pose, uncertainty: %{radius: radius}} =
      Controller.percept(Member.role(Trial.robot(trial, id), :executive).controller)

    off = Pose.distance(pose, Pose.point(World.truth(trial.world, id)))
    {off, off <= radius}
  end
end
