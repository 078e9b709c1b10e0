defmodule Lab.Trial.Cuts do
  @moduledoc """
  Decides when and how a run's radio is cut. Pure. A cut is `{from_s, to_s, what}`:

  | what | cuts |
  |---|---|
  | `[[:mag1, :mag2], [:mag3]]` | all links between robots of different groups; a robot in no group is alone |
  | `{:link, :mag1, :mag2}` | one link |
  | `{:way, :mag1, :mag2}` | one direction of a link: the second does not hear the first |

  `to_s` may be `:end`. Several cuts may apply at once.
  """

  @type what :: [[atom()]] | {:link | :way, atom(), atom()}
  @type cut :: {from_s :: number(), to_s :: number() | :end, what()}

  @doc """
  Whether a term is a list of cuts among these robots.

      iex> Lab.Trial.Cuts.valid?([{5, 9.5, {:link, :mag1, :mag2}}], [:mag1, :mag2])
      true
      iex> Lab.Trial.Cuts.valid?([{5, 2, {:link, :mag1, :mag2}}], [:mag1, :mag2])
      false
  """
  @spec valid?(term(), [atom()]) :: boolean()
  def valid?(cuts, robots) when is_list(cuts), do: Enum.all?(cuts, &cut?(&1, robots))
  def valid?(_other, _robots), do: false

  defp cut?({from_s, to_s, what}, robots) when is_number(from_s) and from_s >= 0 do
    (to_s == :end or (is_number(to_s) and to_s > from_s)) and what?(what, robots)
  end

  defp cut?(_other, _robots), do: false

  defp what?({kind, a, b}, robots) when kind in [:link, :way],
    do: a != b and a in robots and b in robots

  defp what?([_ | _] = groups, robots) do
    Enum.all?(groups, &is_list/1) and Enum.concat(groups) -- robots == []
  end

  defp what?(_other, _robots), do: false

  @doc """
  The directions that are cut at a time, as `{from, to}`.

      iex> Lab.Trial.Cuts.ways([{1, 2, [[:mag1], [:mag2]]}], [:mag1, :mag2], 1_500)
      [mag1: :mag2, mag2: :mag1]
      iex> Lab.Trial.Cuts.ways([{1, 2, [[:mag1], [:mag2]]}], [:mag1, :mag2], 2_000)
      []
  """
  @spec ways([cut()], [atom()], integer()) :: [{from :: atom(), to :: atom()}]
  def ways(cuts, robots, at_ms) do
    for {from_s, to_s, what} <- cuts,
        holds?(from_s, to_s, at_ms),
        way <- cut(what, robots),
        uniq: true do
      way
    end
  end

  @doc "The times at which a cut is over, in milliseconds, sorted."
  @spec healed_ms([cut()]) :: [integer()]
  def healed_ms(cuts),
    do: Enum.sort(for {_from_s, to_s, _what} <- cuts, to_s != :end, uniq: true, do: ms(to_s))

  defp holds?(from_s, :end, at_ms), do: ms(from_s) <= at_ms
  defp holds?(from_s, to_s, at_ms), do: ms(from_s) <= at_ms and at_ms < ms(to_s)

  defp cut({:link, a, b}, _robots), do: [{a, b}, {b, a}]
  defp cut({:way, a, b}, _robots), do: [{a, b}]

  defp cut(groups, robots) do
    for a <- robots,
        b <- robots,
        a != b,
        not Enum.any?(groups, &(a in &1 and b in &1)),
        do: {a, b}
  end

  defp ms(seconds), do: round(seconds * 1000)
end
