defmodule Robot.Localiser.MonteCarlo.Sampling do
  @moduledoc false
  # Draws particles by their weights, and says how many are enough. Pure, and in whole numbers, so that no order of sums matters.

  # Of a histogram of such bins (metres, radians), the estimate is off by more than the share in one of 100 cases (Fox 2003).
  @bin 0.5
  @turn :math.pi() / 18
  @error 0.05
  @quantile 2.326
  # The weight of the best particle, and the differences of logarithms (1/1024) that are told apart.
  @whole 65_536
  @step 16
  @exp for(k <- 0..700, do: round(@whole * :math.exp(-k * @step / 1024))) |> List.to_tuple()

  @type pose :: {x :: float(), y :: float(), heading :: float(), slip :: float()}

  @doc """
  Weights by the logarithms of likelihoods (1/1024); that of the best one is 65536.

      iex> Robot.Localiser.MonteCarlo.Sampling.weights([-2048, -1024, -1024])
      [24109, 65536, 65536]
      iex> Robot.Localiser.MonteCarlo.Sampling.weights([0, -60000])
      [65536, 0]
  """
  @spec weights([integer(), ...]) :: [non_neg_integer(), ...]
  def weights(logarithms) do
    best = Enum.max(logarithms)
    for log <- logarithms, do: weight(div(best - log, @step))
  end

  defp weight(k) when k < tuple_size(@exp), do: elem(@exp, k)
  defp weight(_far), do: 0

  @doc """
  Draws `count` of the poses systematically: each comes as often as its weight says, rounded up or down. `u` is a random number,
  of which the remainder by the sum of the weights counts. Poses that do not come are left out.

      iex> Robot.Localiser.MonteCarlo.Sampling.draw([:a, :b, :c], [3, 0, 1], 8, 0)
      [{:a, 6}, {:c, 2}]
  """
  @spec draw([pose], [non_neg_integer()], pos_integer(), non_neg_integer()) ::
          [{pose, copies :: pos_integer()}]
        when pose: term()
  def draw(poses, weights, count, u) do
    total = Enum.sum(weights)
    pick(poses, weights, {0, 0}, {count, total, rem(u, total)})
  end

  # The place of the k-th of them is (k * total + u) / count on the line of all weights.
  defp pick([], [], _done, _how), do: []

  defp pick([pose | poses], [weight | weights], {line, k}, {count, total, u} = how) do
    line = line + weight
    upto = min(max(div(line * count - u + total - 1, total), k), count)

    if upto > k,
      do: [{pose, upto - k} | pick(poses, weights, {line, upto}, how)],
      else: pick(poses, weights, {line, k}, how)
  end

  @doc "How many particles are enough for such poses: by the bins that they are in."
  @spec enough([{pose(), pos_integer()}]) :: pos_integer() | :most
  def enough(drawn) do
    for {{x, y, heading, _slip}, _copies} <- drawn, uniq: true do
      {floor(x / @bin), floor(y / @bin), floor(heading / @turn)}
    end
    |> length()
    |> bound()
  end

  @doc """
  How many are enough for so many bins; `:most` for one, of which nothing follows.

      iex> Enum.map([1, 2, 5, 10, 20, 50, 100, 200, 500], &Robot.Localiser.MonteCarlo.Sampling.bound/1)
      [:most, 66, 134, 217, 363, 750, 1347, 2484, 5755]
  """
  @spec bound(pos_integer()) :: pos_integer() | :most
  def bound(bins) when bins < 2, do: :most

  def bound(bins) do
    b = 2 / (9 * (bins - 1))
    ceil((bins - 1) / (2 * @error) * :math.pow(1 - b + :math.sqrt(b) * @quantile, 3))
  end
end
