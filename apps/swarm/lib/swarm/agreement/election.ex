defmodule Swarm.Agreement.Election do
  @moduledoc """
  Elects the leader: a pure function of the committed record, so that all robots get the same
  answer.

  Among those that may lead at all, the one of the greatest merit wins (the landmark mission's
  is how large a robot sees the landmark); ties go to the first name. If two or more leaders report,
  parts of a fleet have met, and the one with the highest {robots led, merit, name} leads all: the
  fewest have to turn to another.

  Under the policy `:majority` (`of` is the fleet's size) no robot leads a view that is not more than
  half of the fleet.
  """

  @typedoc """
  What a robot reported in a round; `nil` if it was silent until the deadline. `merit` says how well
  it would lead, in millionths, by the measure of its mission; `nil`: not at all. `led` is how many
  robots it leads including itself, 0 if it leads none; `of` is the size of the fleet of which
  only a majority may lead, 0 under the policy `:available`.
  """
  @type report ::
          %{
            merit: 0..1_000_000 | nil,
            pose: {integer(), integer(), integer()},
            led: non_neg_integer(),
            of: non_neg_integer()
          }
          | nil

  @doc """
  The leader; `:nobody` if none may, `:minority` if the view may not lead.

      iex> one = %{merit: 900, pose: {0, 0, 0}, led: 0, of: 0}
      iex> Swarm.Agreement.Election.leader(%{mag1: one, mag2: one, min1: %{one | merit: nil}, min2: nil})
      {:ok, :mag1}
      iex> Swarm.Agreement.Election.leader(%{min2: nil})
      :nobody
      iex> Swarm.Agreement.Election.leader(%{mag1: one, mag2: %{one | led: 2}, min1: %{one | led: 3, merit: 5}})
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
      true -> best(present)
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
      |> Enum.max_by(fn {id, report} -> {report.led, report.merit || 0, id} end)

    id
  end

  defp best(present) do
    present
    |> Enum.filter(fn {_id, report} -> report.merit != nil end)
    |> Enum.min_by(fn {id, report} -> {-report.merit, id} end, fn -> nil end)
    |> case do
      nil -> :nobody
      {id, _report} -> {:ok, id}
    end
  end
end
