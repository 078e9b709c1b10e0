defmodule Swarm.Formation.Chain do
  @moduledoc """
  Orders robots by the thesis's chain: the child of each robot is the one with the next greater distance to the leader,
  which each robot computes from the same poses. Equal distances are ordered by id, so that any poses give a unique chain.
  Pure; places in mm, as reported.
  """

  @type millimetres :: {integer(), integer()}

  @doc """
  The followers from the nearest to the leader to the farthest.

      iex> Swarm.Formation.Chain.order([mag3: {0, 500}, mag2: {500, 0}, min1: {100, 100}], {0, 0})
      [:min1, :mag2, :mag3]
  """
  @spec order([{atom(), millimetres()}], millimetres()) :: [atom()]
  def order(followers, leader) do
    followers
    |> Enum.sort_by(fn {id, place} -> {squared(place, leader), id} end)
    |> Enum.map(&elem(&1, 0))
  end

  @doc """
  The child of a robot along `[leader | order]`; `nil` for the last one and for strangers.

      iex> Swarm.Formation.Chain.child([:mag1, :mag2, :min1], :mag2)
      :min1
      iex> Swarm.Formation.Chain.child([:mag1, :mag2, :min1], :min1)
      nil
  """
  @spec child([atom()], atom()) :: atom() | nil
  def child([parent, child | _rest], parent), do: child
  def child([_other | rest], robot), do: child(rest, robot)
  def child([], _robot), do: nil

  @doc """
  The chain without a robot: its child becomes its parent's child.

      iex> Swarm.Formation.Chain.heal([:mag1, :mag2, :min1], [:mag1, :min1])
      [:mag1, :min1]
  """
  @spec heal([atom()], [atom()]) :: [atom()]
  def heal(chain, alive), do: Enum.filter(chain, &(&1 in alive))

  defp squared({ax, ay}, {bx, by}), do: (ax - bx) * (ax - bx) + (ay - by) * (ay - by)
end
