defmodule Swarm.Wire.StopTags do
  @moduledoc false
  # Describes what a heartbeat says of the emergency stops that hold its robot: their tags (`Swarm.EStop.State`), at most 16. Pure.

  @most 16
  @last 0xFFFFFFFF

  @typedoc "A stop's tag, of 32 bits."
  @type tag :: 0..0xFFFFFFFF

  @doc "How many stops hold a robot at a time, at most."
  @spec most() :: pos_integer()
  def most, do: @most

  @doc "How many tags there are."
  @spec count() :: pos_integer()
  def count, do: @last + 1

  @doc """
  Whether a term from outside can be what a heartbeat says of the stops that hold its robot.

      iex> for term <- [[], [1, 2], [-1], [1 | 2], Enum.to_list(1..17)], do: Swarm.Wire.StopTags.tags?(term)
      [true, true, false, false, false]
  """
  @spec tags?(term()) :: boolean()
  def tags?(term), do: tags?(term, @most)

  defp tags?([], _left), do: true
  defp tags?([tag | tags], left) when left > 0 and tag in 0..@last, do: tags?(tags, left - 1)
  defp tags?(_other, _left), do: false
end
