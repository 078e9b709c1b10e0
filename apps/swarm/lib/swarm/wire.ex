defmodule Swarm.Wire do
  @moduledoc """
  Validates terms from outside, without trusting them in any way. Pure.
  """
  alias Mesh.Protocol.WireTerm

  # More than a thousand kilometres, or a thousand robots, is nonsense.
  @far 1_000_000_000
  @count 500_000_000
  @day_ms 86_400_000
  @latest 0xFFFFFFFFFFFFFFFF
  @counter 0xFFFFFFFFFFFFFFFF

  @doc """
  Whether a struct has all fields of its kind and no others, because anything can arrive from the
  network.

      iex> Swarm.Wire.whole?(Hal.Pose.new(1, 2), Hal.Pose)
      true
      iex> Swarm.Wire.whole?(%{__struct__: Hal.Pose, x: 1}, Hal.Pose)
      false
  """
  @spec whole?(term(), module()) :: boolean()
  def whole?(%{__struct__: module} = struct, module),
    do: Map.keys(struct) == Map.keys(module.__struct__())

  def whole?(_other, _module), do: false

  @doc """
  Whether a term can be a robot's name.

      iex> for term <- [:mag1, nil, true, "mag1"], do: Swarm.Wire.name?(term)
      [true, false, false, false]
  """
  @spec name?(term()) :: boolean()
  defdelegate name?(term), to: WireTerm

  @doc """
  Whether a term is a list of names, no longer than the largest fleet.

      iex> for term <- [[:mag1], [:mag1 | :mag2], [1]], do: Swarm.Wire.names?(term)
      [true, false, false]
  """
  @spec names?(term()) :: boolean()
  defdelegate names?(term), to: WireTerm

  @doc """
  Whether the elements of a list are all different.

      iex> for list <- [[:mag1, :mag2], [:mag2, :mag1], [:mag1, :mag1]], do: Swarm.Wire.distinct?(list)
      [true, true, false]
  """
  @spec distinct?(list()) :: boolean()
  def distinct?(list), do: ascending?(list) or Enum.uniq(list) == list

  # As the lists of robots are.
  defp ascending?([a | [b | _] = rest]), do: a < b and ascending?(rest)
  defp ascending?(_one_or_none), do: true

  @doc """
  Whether a term is a list of such terms, no longer than the largest fleet.

      iex> for term <- [[1, 2], [1, :a], [1 | 2], 1], do: Swarm.Wire.list?(term, &is_integer/1)
      [true, false, false, false]
  """
  @spec list?(term(), (term() -> boolean())) :: boolean()
  defdelegate list?(term, check), to: WireTerm

  @doc """
  Whether a term is a whole number in the range of lengths in mm, angles in mrad and counts.

      iex> for term <- [-5, 1.0, 1_000_000_000], do: Swarm.Wire.number?(term)
      [true, false, false]
  """
  @spec number?(term()) :: boolean()
  def number?(term), do: is_integer(term) and abs(term) < @far

  @doc """
  Whether a term is a number of things that are counted, none of which is counted on from.

      iex> for term <- [0, 7, -1, 900_000_000], do: Swarm.Wire.count?(term)
      [true, true, false, false]
  """
  @spec count?(term()) :: boolean()
  def count?(term), do: is_integer(term) and term in 0..@count

  @doc """
  Whether a term is a number that counts up for ever: of a leadership, a heartbeat, an anchor, a
  request. Nothing counts as far as 2^64 by itself; that none is pushed there is the matter of
  receivers that count on from what they hear (`Swarm.Wire.CounterGuard`).

      iex> for term <- [0, 500_000_001, -1, 1.0, 18_446_744_073_709_551_616], do: Swarm.Wire.counter?(term)
      [true, true, false, false, false]
  """
  @spec counter?(term()) :: boolean()
  def counter?(term), do: is_integer(term) and term in 0..@counter

  @doc """
  Whether a term is the number of a robot's life: the time of day at which it began, in ns.

      iex> for term <- [1, 1_700_000_000_000, -1, 1.0e12], do: Swarm.Wire.boot?(term)
      [true, true, false, false]
  """
  @spec boot?(term()) :: boolean()
  def boot?(term), do: is_integer(term) and term in 0..@latest

  @doc """
  Whether a term is a waiting time in ms: up to a day.

      iex> for term <- [0, 500, -1, 1.5, :infinity], do: Swarm.Wire.ms?(term)
      [true, true, false, false, false]
  """
  @spec ms?(term()) :: boolean()
  def ms?(term), do: is_integer(term) and term in 0..@day_ms

  @doc """
  Whether a term is a pose as robots report it, `{x_mm, y_mm, mrad}`.

      iex> for term <- [{1, 2, 3}, {1.0, 2, 3}, {1, 2}], do: Swarm.Wire.pose?(term)
      [true, false, false]
  """
  @spec pose?(term()) :: boolean()
  def pose?({x, y, heading}), do: number?(x) and number?(y) and number?(heading)
  def pose?(_term), do: false
end
