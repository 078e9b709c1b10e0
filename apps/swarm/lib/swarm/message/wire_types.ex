defmodule Swarm.Message.WireTypes do
  @moduledoc """
  Validates terms from outside, without trusting them in any way. Pure.
  """
  alias Mesh.Protocol.WireTerm

  # Of everything more than a thousand kilometres, or than a thousand robots, is nonsense.
  @far 1_000_000_000
  @count 500_000_000
  @day_ms 86_400_000
  @latest 0xFFFFFFFFFFFFFFFF

  @doc """
  Whether a struct has all the fields of its kind and no others: over the wire anything can come.

      iex> Swarm.Message.WireTypes.whole?(Hal.Pose.new(1, 2), Hal.Pose)
      true
      iex> Swarm.Message.WireTypes.whole?(%{__struct__: Hal.Pose, x: 1}, Hal.Pose)
      false
  """
  @spec whole?(term(), module()) :: boolean()
  def whole?(%{__struct__: module} = struct, module),
    do: Map.keys(struct) == Map.keys(module.__struct__())

  def whole?(_other, _module), do: false

  @doc """
  Whether it can be a robot's name.

      iex> for term <- [:mag1, nil, true, "mag1"], do: Swarm.Message.WireTypes.name?(term)
      [true, false, false, false]
  """
  @spec name?(term()) :: boolean()
  defdelegate name?(term), to: WireTerm

  @doc """
  Whether it is a list of names, no more than the largest fleet has.

      iex> for term <- [[:mag1], [:mag1 | :mag2], [1]], do: Swarm.Message.WireTypes.names?(term)
      [true, false, false]
  """
  @spec names?(term()) :: boolean()
  defdelegate names?(term), to: WireTerm

  @doc """
  Whether nothing is twice in a list.

      iex> for list <- [[:mag1, :mag2], [:mag1, :mag1]], do: Swarm.Message.WireTypes.distinct?(list)
      [true, false]
  """
  @spec distinct?(list()) :: boolean()
  def distinct?(list), do: Enum.uniq(list) == list

  @doc """
  Whether it is a list of such terms, no longer than the largest fleet is.

      iex> for term <- [[1, 2], [1, :a], [1 | 2], 1], do: Swarm.Message.WireTypes.list?(term, &is_integer/1)
      [true, false, false, false]
  """
  @spec list?(term(), (term() -> boolean())) :: boolean()
  defdelegate list?(term, check), to: WireTerm

  @doc """
  Whether it is a whole number that a length in mm, an angle in mrad or a number of anything can be.

      iex> for term <- [-5, 1.0, 1_000_000_000], do: Swarm.Message.WireTypes.number?(term)
      [true, false, false]
  """
  @spec number?(term()) :: boolean()
  def number?(term), do: is_integer(term) and abs(term) < @far

  @doc """
  Whether it is a number that counts up: of a leadership, a round, an anchor, a stop. What comes from
  outside stays far below where a robot that counts on would itself be refused by the others.

      iex> for term <- [0, 7, -1, 900_000_000], do: Swarm.Message.WireTypes.count?(term)
      [true, true, false, false]
  """
  @spec count?(term()) :: boolean()
  def count?(term), do: is_integer(term) and term in 0..@count

  @doc """
  Whether it is the number of a robot's life: the time of day at which it began, in ms.

      iex> for term <- [1, 1_700_000_000_000, -1, 1.0e12], do: Swarm.Message.WireTypes.boot?(term)
      [true, true, false, false]
  """
  @spec boot?(term()) :: boolean()
  def boot?(term), do: is_integer(term) and term in 0..@latest

  @doc """
  Whether it is a time in ms that somebody may wait: up to a day.

      iex> for term <- [0, 500, -1, 1.5, :infinity], do: Swarm.Message.WireTypes.ms?(term)
      [true, true, false, false, false]
  """
  @spec ms?(term()) :: boolean()
  def ms?(term), do: is_integer(term) and term in 0..@day_ms

  @doc """
  Whether it is a pose as robots tell it, `{x_mm, y_mm, mrad}`.

      iex> for term <- [{1, 2, 3}, {1.0, 2, 3}, {1, 2}], do: Swarm.Message.WireTypes.pose?(term)
      [true, false, false]
  """
  @spec pose?(term()) :: boolean()
  def pose?({x, y, heading}), do: number?(x) and number?(y) and number?(heading)
  def pose?(_term), do: false
end
