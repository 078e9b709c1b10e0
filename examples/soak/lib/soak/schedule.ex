defmodule Soak.Schedule do
  @moduledoc """
  Draws what `bin/soak` does to a fleet and when, as a function of the seed. Pure: the same arguments give the same
  list, so a run can be repeated.

  A run is a sequence of cycles of 75 s. In its first 45 s processes, nodes and the world are killed, nodes are
  frozen, links cut, junk is sent, the fleet is given other formations, and perhaps stopped; during the other
  30 s nothing is done, and the fleet must heal. Changes of the network never overlap; all else may. The last
  cycle of a run that is no multiple of 75 s is shorter in both its parts.
  """

  alias Lab.Chaos.Random

  @cycle_ms 75_000
  @busy 0.6

  @typedoc """
  What is done, after so many milliseconds of the run. Numbers named `chance` are from 0 to 1 and choose among
  what is there at that moment; `ms` is how long it lasts.
  """
  @type deed ::
          {at_ms :: non_neg_integer(),
           {:process, robot :: atom(), chance :: float()}
           | {:node, robot :: atom()}
           | :world
           | {:freeze, robot :: atom(), ms :: pos_integer()}
           | {:block, atom(), atom(), ms :: pos_integer()}
           | {:split, [[atom()]], ms :: pos_integer()}
           | {:loss, share :: float(), ms :: pos_integer()}
           | {:junk, robot :: atom(), :random | :recorded | :mutated, count :: pos_integer(),
              seed :: non_neg_integer()}
           | {:flood, robot :: atom(), count :: pos_integer(), seed :: non_neg_integer()}
           | {:formation, atom()}
           | {:landmark, {float(), float()}}
           | {:estop, robot :: atom()}
           | :reset
           | :start
           | :calm}

  # How often each comes in a cycle, at least and at most.
  @kinds [
    process: {6, 10},
    node: {0, 2},
    world: {0, 1},
    freeze: {1, 3},
    junk: {1, 3},
    flood: {0, 1},
    formation: {0, 1},
    landmark: {0, 1}
  ]

  @doc "The kinds of deeds that disturb, for a table."
  @spec kinds() :: [atom()]
  def kinds, do: [:process, :node, :world, :freeze, :block, :split, :loss, :junk, :flood]

  @doc """
  All deeds of a run of so many milliseconds, by time. `cuts?` says whether the network can be changed.

      iex> Soak.Schedule.new(1, 60_000, [:mag1, :mag2], true) ==
      ...>   Soak.Schedule.new(1, 60_000, [:mag1, :mag2], true)
      true
  """
  @spec new(integer(), pos_integer(), [atom(), ...], boolean()) :: [deed()]
  def new(seed, duration_ms, robots, cuts?) do
    count = max(round(duration_ms / @cycle_ms), 1)
    length_ms = div(duration_ms, count)

    {cycles, _random} =
      Enum.map_reduce(0..(count - 1), :rand.seed_s(:exsss, seed), fn n, random ->
        cycle(n * length_ms, length_ms, robots, cuts?, random)
      end)

    cycles |> List.flatten() |> Enum.sort_by(&elem(&1, 0))
  end

  defp cycle(from, length_ms, robots, cuts?, random) do
    busy = round(@busy * length_ms)
    share = min(length_ms / @cycle_ms, 1.0)

    {single, random} =
      Enum.map_reduce(@kinds, random, &several(&1, &2, {from, busy, share, robots}))

    {net, random} = if cuts?, do: network(from, from + busy, robots, random), else: {[], random}
    {stop, random} = stop(from, busy, robots, random)
    {[single, net, stop, {from, :start}, {from + busy, :start}, {from + busy, :calm}], random}
  end

  defp several({kind, {least, most}}, random, {from, busy, share, robots}) do
    {n, random} = Random.whole(random, round(least * share), max(round(most * share), 1))

    Enum.map_reduce(List.duplicate(kind, n), random, fn kind, random ->
      {at, random} = Random.whole(random, 500, busy)
      {deed, random} = one(kind, robots, random)
      {{from + at, deed}, random}
    end)
  end

  # One after the other, with time between them, and none beyond the end.
  defp network(at, until, robots, random) do
    {pause, random} = Random.whole(random, 1_000, 15_000)
    {ms, random} = Random.whole(random, 500, 12_000)
    {kind, random} = Random.pick(random, [:block, :block, :split, :loss])
    {[a, b | _] = mixed, random} = Random.shuffle(random, robots)
    {size, random} = Random.whole(random, 1, max(length(robots) - 1, 1))
    {share, random} = :rand.uniform_s(random)
    at = at + pause

    deed =
      case kind do
        :block ->
          {:block, a, b, ms}

        :split ->
          {:split, mixed |> Enum.split(size) |> Tuple.to_list() |> Enum.map(&Enum.sort/1), ms}

        :loss ->
          {:loss, Float.round(0.1 + 0.3 * share, 2), ms}
      end

    if at + ms > until do
      {[], random}
    else
      {more, random} = network(at + ms, until, robots, random)
      {[{at, deed} | more], random}
    end
  end

  # Every other cycle, held for a third of the disturbances.
  defp stop(from, busy, robots, random) do
    {chance, random} = :rand.uniform_s(random)
    {robot, random} = Random.pick(random, robots)
    {at, random} = Random.whole(random, div(busy, 10), div(busy, 2))
    reset = from + at + div(busy, 3)

    if chance < 0.5,
      do: {[{from + at, {:estop, robot}}, {reset, :reset}, {reset + 500, :start}], random},
      else: {[], random}
  end

  # Draws deeds of `bin/soak`, and what they are made of, from a state of `:rand`. Pure.

  import Lab.Chaos.Random, only: [pick: 2, whole: 3]

  @type random :: Lab.Chaos.Random.t()

  # A deed of a kind that lasts for itself, as in `Soak.Schedule`.
  defp one(:world, _robots, random), do: {:world, random}

  defp one(:process, robots, random) do
    {robot, random} = pick(random, robots)
    {chance, random} = :rand.uniform_s(random)
    {{:process, robot, chance}, random}
  end

  defp one(:node, robots, random) do
    {robot, random} = pick(random, robots)
    {{:node, robot}, random}
  end

  defp one(:freeze, robots, random) do
    {robot, random} = pick(random, robots)
    {ms, random} = whole(random, 200, 5_000)
    {{:freeze, robot, ms}, random}
  end

  defp one(:junk, robots, random) do
    {robot, random} = pick(random, robots)
    {kind, random} = pick(random, [:random, :recorded, :mutated])
    {count, random} = whole(random, 10, 300)
    {seed, random} = whole(random, 0, 1_000_000)
    {{:junk, robot, kind, count, seed}, random}
  end

  defp one(:flood, robots, random) do
    {robot, random} = pick(random, robots)
    {count, random} = whole(random, 5_000, 20_000)
    {seed, random} = whole(random, 0, 1_000_000)
    {{:flood, robot, count, seed}, random}
  end

  defp one(:formation, _robots, random) do
    {kind, random} = pick(random, [:line, :wedge, :triangle, :diamond, :circle, :column])
    {{:formation, kind}, random}
  end

  defp one(:landmark, _robots, random) do
    {x, random} = :rand.uniform_s(random)
    {y, random} = :rand.uniform_s(random)
    {{:landmark, {x - 0.5, y - 0.5}}, random}
  end
end
