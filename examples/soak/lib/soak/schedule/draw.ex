defmodule Soak.Schedule.Draw do
  @moduledoc "Draws deeds of `bin/soak`, and what they are made of, from a state of `:rand`. Pure."

  import Lab.Chaos.Random, only: [pick: 2, whole: 3]

  @type random :: Lab.Chaos.Random.t()

  @doc "A deed of a kind that lasts for itself, as in `Soak.Schedule`."
  @spec one(atom(), [atom(), ...], random()) :: {tuple() | atom(), random()}
  def one(:world, _robots, random), do: {:world, random}

  def one(:process, robots, random) do
    {robot, random} = pick(random, robots)
    {chance, random} = :rand.uniform_s(random)
    {{:process, robot, chance}, random}
  end

  def one(:node, robots, random) do
    {robot, random} = pick(random, robots)
    {{:node, robot}, random}
  end

  def one(:freeze, robots, random) do
    {robot, random} = pick(random, robots)
    {ms, random} = whole(random, 200, 5_000)
    {{:freeze, robot, ms}, random}
  end

  def one(:junk, robots, random) do
    {robot, random} = pick(random, robots)
    {kind, random} = pick(random, [:random, :recorded, :mutated])
    {count, random} = whole(random, 10, 300)
    {seed, random} = whole(random, 0, 1_000_000)
    {{:junk, robot, kind, count, seed}, random}
  end

  def one(:flood, robots, random) do
    {robot, random} = pick(random, robots)
    {count, random} = whole(random, 5_000, 20_000)
    {seed, random} = whole(random, 0, 1_000_000)
    {{:flood, robot, count, seed}, random}
  end

  def one(:formation, _robots, random) do
    {kind, random} = pick(random, [:line, :wedge, :triangle, :diamond, :circle, :column])
    {{:formation, kind}, random}
  end

  def one(:landmark, _robots, random) do
    {x, random} = :rand.uniform_s(random)
    {y, random} = :rand.uniform_s(random)
    {{:landmark, {x - 0.5, y - 0.5}}, random}
  end
end
