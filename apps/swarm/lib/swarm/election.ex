defmodule Swarm.Election do
  @moduledoc """
  Who leads: of those that found the landmark, the one that sees it largest (R48); ties go to the
  first name. A pure function of the committed record, so that all get the same answer.
  """

  @typedoc "What a robot reported in a round; `nil` where it was silent until the deadline."
  @type report ::
          %{
            found: boolean(),
            size_ppm: non_neg_integer(),
            pose: {integer(), integer(), integer()}
          }
          | nil

  @doc """
  The leader, or `:nobody` where none found the landmark.

      iex> pose = {0, 0, 0}
      iex> Swarm.Election.leader(%{
      ...>   mag1: %{found: true, size_ppm: 900, pose: pose},
      ...>   mag2: %{found: true, size_ppm: 900, pose: pose},
      ...>   min1: %{found: false, size_ppm: 0, pose: pose},
      ...>   min2: nil
      ...> })
      {:ok, :mag1}
      iex> Swarm.Election.leader(%{min2: nil})
      :nobody
  """
  @spec leader(%{atom() => report()}) :: {:ok, atom()} | :nobody
  def leader(reports) do
    reports
    |> Enum.filter(fn {_id, report} -> report != nil and report.found end)
    |> Enum.min_by(fn {id, report} -> {-report.size_ppm, id} end, fn -> nil end)
    |> case do
      nil -> :nobody
      {id, _report} -> {:ok, id}
    end
  end
end
