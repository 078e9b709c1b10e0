defmodule Lab.Chaos.Random do
  @moduledoc """
  Draws from an explicit state of `:rand`. Pure; each function returns what it drew and the next
  state.
  """

  @type t :: :rand.state()

  @doc """
  The state of run `number` of a seed, independent of the runs before it and of those of other seeds.

  Both numbers go through a hash, because `:rand.seed_s/2` combines the numbers of a tuple by exclusive or: of
  `{1, 63, 0}` and `{2, 62, 0}` it makes the same state.

      iex> draw = fn seed, number -> elem(Lab.Chaos.Random.whole(Lab.Chaos.Random.new(seed, number), 1, 1_000_000), 0) end
      iex> draw.(1, 7) == draw.(1, 7)
      true
      iex> draw.(1, 63) == draw.(2, 62)
      false
  """
  @spec new(seed :: integer(), number :: pos_integer()) :: t()
  def new(seed, number) do
    <<one::64, _rest::binary>> = :crypto.hash(:sha256, "chaos #{seed} #{number}")
    :rand.seed_s(:exsss, one)
  end

  @doc "A whole number, both limits included."
  @spec whole(t(), integer(), integer()) :: {integer(), t()}
  def whole(random, least, most) do
    {n, random} = :rand.uniform_s(most - least + 1, random)
    {least + n - 1, random}
  end

  @doc "A number between two limits, rounded to so many decimals."
  @spec number(t(), number(), number(), 0..15) :: {float(), t()}
  def number(random, least, most, decimals) do
    {share, random} = :rand.uniform_s(random)
    {Float.round(least + share * (most - least), decimals), random}
  end

  @doc "One of these."
  @spec pick(t(), [one, ...]) :: {one, t()} when one: term()
  def pick(random, all) do
    {n, random} = whole(random, 0, length(all) - 1)
    {Enum.at(all, n), random}
  end

  @doc """
  One of these, with weights in whole numbers.

      iex> {only, _} = Lab.Chaos.Random.weighted(Lab.Chaos.Random.new(1, 1), hall: 3, arena: 0)
      iex> only
      :hall
  """
  @spec weighted(t(), [{one, non_neg_integer()}, ...]) :: {one, t()} when one: term()
  def weighted(random, all) do
    {n, random} = whole(random, 1, all |> Enum.map(&elem(&1, 1)) |> Enum.sum())

    {one, _left} =
      Enum.reduce_while(all, {nil, n}, fn {one, weight}, {_none, left} ->
        if left <= weight, do: {:halt, {one, left}}, else: {:cont, {nil, left - weight}}
      end)

    {one, random}
  end

  @doc "These in another order."
  @spec shuffle(t(), [one]) :: {[one], t()} when one: term()
  def shuffle(random, all) do
    {keyed, random} =
      Enum.map_reduce(all, random, fn one, random ->
        {key, random} = :rand.uniform_s(random)
        {{key, one}, random}
      end)

    {for({_key, one} <- Enum.sort(keyed), do: one), random}
  end

  @doc "So many draws of the same kind."
  @spec times(t(), non_neg_integer(), (t() -> {one, t()})) :: {[one], t()} when one: term()
  def times(random, count, draw),
    do: Enum.map_reduce(Enum.to_list(1..count//1), random, fn _k, random -> draw.(random) end)
end
