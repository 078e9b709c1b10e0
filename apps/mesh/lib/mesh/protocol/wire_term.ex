defmodule Mesh.Protocol.WireTerm do
  @moduledoc """
  Checks terms from other nodes without trusting them: names, and lists of bounded length. Pure.
  """

  @most 1_000

  @doc """
  Whether a term is a list of such terms, no longer than the largest fleet.

      iex> for term <- [[1, 2], [1, :a], [1 | 2], 1], do: Mesh.Protocol.WireTerm.list?(term, &is_integer/1)
      [true, false, false, false]
  """
  @spec list?(term(), (term() -> boolean())) :: boolean()
  def list?(term, check) do
    is_list(term) and not List.improper?(term) and length(term) <= @most and
      Enum.all?(term, check)
  end

  @doc """
  Whether a term can be the name of a robot.

      iex> for term <- [:mag1, nil, true, "mag1"], do: Mesh.Protocol.WireTerm.name?(term)
      [true, false, false, false]
  """
  @spec name?(term()) :: boolean()
  def name?(term), do: is_atom(term) and term not in [nil, true, false]

  @doc """
  Whether a term is a list of names, no longer than the largest fleet.

      iex> for term <- [[:mag1], [:mag1 | :mag2], [1]], do: Mesh.Protocol.WireTerm.names?(term)
      [true, false, false]
  """
  @spec names?(term()) :: boolean()
  def names?(term), do: names?(term, @most)

  defp names?([], _left), do: true

  defp names?([name | rest], left)
       when left > 0 and is_atom(name) and name not in [nil, true, false],
       do: names?(rest, left - 1)

  defp names?(_other, _left), do: false
end
