defmodule Robot.Behaviour.Arbiter do
  @moduledoc """
  Chooses among wishes: the one with the greatest weight wins. The weight of the behaviour
  that won last counts a tenth more, so that two behaviours of nearly equal weight do not
  alternate; among equal weights the first in the list wins. Pure.
  """
  alias Robot.Wish

  @stubbornness 1.1

  @doc """
  The winning wish, or `nil` without wishes.

      iex> wish = fn by, weight -> Robot.Wish.new(by, Hal.Twist.zero(), weight) end
      iex> Robot.Behaviour.Arbiter.choose([wish.(:rest, 0.1), wish.(:goto, 0.5), nil], nil).by
      :goto
      iex> Robot.Behaviour.Arbiter.choose([wish.(:goto, 0.5), wish.(:move, 0.52)], :goto).by
      :goto
      iex> Robot.Behaviour.Arbiter.choose([], :goto)
      nil
  """
  @spec choose([Wish.t() | nil], last_by :: atom()) :: Wish.t() | nil
  def choose(wishes, last_by) do
    wishes
    |> Enum.reject(&is_nil/1)
    |> Enum.max_by(&weight(&1, last_by), &>=/2, fn -> nil end)
  end

  @doc """
  The weight with which a wish is compared, after the behaviour `last_by` won.

      iex> Robot.Behaviour.Arbiter.weight(Robot.Wish.new(:goto, Hal.Twist.zero(), 0.5), :rest)
      0.5
  """
  @spec weight(Wish.t(), last_by :: atom()) :: float()
  def weight(%Wish{by: by, weight: weight}, by), do: weight * @stubbornness
  def weight(%Wish{weight: weight}, _last_by), do: weight

  @doc """
  The sources of the wishes, with the weights by which they are compared, the winner first.

      iex> wish = fn by, weight -> Robot.Wish.new(by, Hal.Twist.zero(), weight) end
      iex> Robot.Behaviour.Arbiter.weights([nil, wish.(:rest, 0.1), wish.(:goto, 0.5)], nil)
      [goto: 0.5, rest: 0.1]
  """
  @spec weights([Wish.t() | nil], last_by :: atom()) :: [{by :: atom(), weight :: float()}]
  def weights(wishes, last_by) do
    for(%Wish{by: by} = wish <- wishes, do: {by, weight(wish, last_by)})
    |> Enum.sort_by(&elem(&1, 1), :desc)
  end
end
