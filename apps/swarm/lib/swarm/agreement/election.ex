defmodule Swarm.Agreement.Election do
  @moduledoc """
  Elects the leader: a pure function of the committed record, so that all robots get the same
  answer.

  Among those that found the landmark, the one that sees it largest wins (R48); ties go to the
  first name. If two or more leaders report, parts of a fleet have met, and the one with the
  highest {robots led, size, name} leads all: the fewest have to turn to another.

  Under the policy `:majority` (`of` is the fleet's size) nobody leads a view that is not more than
  half of the fleet.
  """

  @typedoc """
  What a robot reported in a round; `nil` if it was silent until the deadline. `led` is how many
  robots it leads including itself, 0 if it leads nobody; `of` is the size of the fleet of which
  only a majority may lead, 0 under the policy `:available`.
  """
  @type report ::
          %{
            found: boolean(),
            size_ppm: non_neg_integer(),
            pose: {integer(), integer(), integer()},
            led: non_neg_integer(),
            of: non_neg_integer()
          }
          | nil

  @doc """
  The leader; `:nobody` if none found the landmark, `:minority` if the view may not lead.

      iex> one = %{found: true, size_ppm: 900, pose: {0, 0, 0}, led: 0, of: 0}
      iex> Swarm.Agreement.Election.leader(%{mag1: one, mag2: one, min1: %{one | found: false}, min2: nil})
      {:ok, :mag1}
      iex> Swarm.Agreement.Election.leader(%{min2: nil})
      :nobody
      iex> Swarm.Agreement.Election.leader(%{mag1: one, mag2: %{one | led: 2}, min1: %{one | led: 3, size_ppm: 5}})
      {:ok, :min1}
      iex> Swarm.Agreement.Election.leader(%{mag1: %{one | of: 4}, mag2: %{one | of: 4}})
      :minority
  """
  @spec leader(%{atom() => report()}) :: {:ok, atom()} | :nobody | :minority
  def leader(reports) do
    present = for {id, report} <- reports, report != nil, do: {id, report}

    cond do
      not enough?(map_size(reports), fleet(reports)) -> :minority
      Enum.count(present, &leads?/1) >= 2 -> {:ok, merge(present)}
      true -> largest(present)
    end
  end

  @doc """
  The size of the fleet of which a majority is required, 0 if none is; the strictest report
  counts.

      iex> Swarm.Agreement.Election.fleet(%{mag1: nil})
      0
  """
  @spec fleet(%{atom() => report()}) :: non_neg_integer()
  def fleet(reports) do
    for {_id, %{of: of}} <- reports, reduce: 0 do
      most -> max(most, of)
    end
  end

  @doc """
  Whether so many robots of a fleet of `of` may lead themselves; 0 requires no majority.

      iex> for robots <- 1..3, do: Swarm.Agreement.Election.enough?(robots, 4)
      [false, false, true]
      iex> Swarm.Agreement.Election.enough?(1, 0)
      true
  """
  @spec enough?(non_neg_integer(), non_neg_integer()) :: boolean()
  def enough?(_robots, 0), do: true
  def enough?(robots, of), do: 2 * robots > of

  defp leads?({_id, report}), do: report.led > 0

  defp merge(present) do
    {id, _report} =
      present
      |> Enum.filter(&leads?/1)
      |> Enum.max_by(fn {id, report} -> {report.led, size(report), id} end)

    id
  end

  defp size(%{found: true, size_ppm: size}), do: size
  defp size(_blind), do: 0

  defp largest(present) do
    present
    |> Enum.filter(fn {_id, report} -> report.found end)
    |> Enum.min_by(fn {id, report} -> {-report.size_ppm, id} end, fn -> nil end)
    |> case do
      nil -> :nobody
      {id, _report} -> {:ok, id}
    end
  end
end
