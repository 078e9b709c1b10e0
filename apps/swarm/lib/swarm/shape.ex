defmodule Swarm.Shape do
  @moduledoc """
  What terms from outside are made of, told without trusting them in anything. Pure.
  """

  @doc """
  Whether a struct has all the fields of its kind and no others: over the wire anything can come.

      iex> Swarm.Shape.whole?(Hal.Pose.new(1, 2), Hal.Pose)
      true
      iex> Swarm.Shape.whole?(%{__struct__: Hal.Pose, x: 1}, Hal.Pose)
      false
  """
  @spec whole?(term(), module()) :: boolean()
  def whole?(%{__struct__: module} = struct, module),
    do: Map.keys(struct) == Map.keys(module.__struct__())

  def whole?(_other, _module), do: false

  @doc """
  Whether it is a list of names.

      iex> {Swarm.Shape.names?([:mag1]), Swarm.Shape.names?([:mag1 | :mag2])}
      {true, false}
  """
  @spec names?(term()) :: boolean()
  def names?(list),
    do: is_list(list) and not List.improper?(list) and Enum.all?(list, &is_atom/1)
end
