defmodule Sim.Chaos.Run do
  @moduledoc "Plays one run of `mix chaos` from its options to its violations. Pure."
  alias Sim.Check.{Invariants, Violation}
  alias Sim.{Run, Trial}

  @typedoc """
  What became of a run: its violations, and figures for the table. `claims` counts those that can be
  judged, `true_claims` the true ones among them.
  """
  @type outcome :: %{
          violations: [Violation.t()],
          simulated_s: float(),
          robots: pos_integer(),
          elections: non_neg_integer(),
          partitions: non_neg_integer(),
          kills: non_neg_integer(),
          formed?: boolean(),
          ended_formed?: boolean(),
          claims: non_neg_integer(),
          true_claims: non_neg_integer(),
          rivals_s: float()
        }

  @doc "Plays a run to its end; the error is one line of `Sim.Trial.new/1`."
  @spec play(keyword()) :: {:ok, outcome()} | {:error, String.t()}
  def play(options) do
    with {:ok, trial} <- Trial.new(Map.new(options)),
         do: {:ok, trial |> judged(&Run.done?/1) |> outcome()}
  end

  @doc """
  The first violation of this invariant, `nil` if there is none, or if there cannot be such a run. The
  run ends with it.
  """
  @spec first(keyword(), atom()) :: Violation.t() | nil
  def first(options, invariant) do
    case Trial.new(Map.new(options)) do
      {:ok, trial} -> first_of(trial, invariant)
      {:error, _line} -> nil
    end
  end

  @doc "The same of a run that was set up."
  @spec first_of(Trial.t(), atom()) :: Violation.t() | nil
  def first_of(%Trial{} = trial, invariant) do
    found? = fn %{checks: [judge]} -> Invariants.first(judge, invariant) != nil end
    run = judged(trial, &(Run.done?(&1) or found?.(&1)))
    [judge] = run.checks
    judge = if found?.(run), do: judge, else: Invariants.finish(judge, Run.result(run))
    Invariants.first(judge, invariant)
  end

  defp judged(trial, over?),
    do: trial |> Run.new([Invariants.new(trial.options)], guarded?: true) |> Run.play(over?)

  defp outcome(%{checks: [judge]} = run) do
    result = Run.result(run)
    judge = Invariants.finish(judge, result)

    judged =
      for claim <- result.claims, (right? = Invariants.right?(judge, claim)) != nil, do: right?

    told = Enum.frequencies_by(result.stages, & &1.stage)

    %{
      violations: Invariants.violations(judge),
      simulated_s: result.simulated_s,
      robots: result.robots,
      elections: Map.get(told, :elected, 0),
      kills: Map.get(told, :killed, 0),
      partitions: length(result.agreement.heals),
      formed?: is_map_key(told, :formed),
      ended_formed?: Trial.formed?(run.source),
      claims: length(judged),
      true_claims: Enum.count(judged, & &1),
      rivals_s: result.agreement.rivals_max_s
    }
  end
end
