defmodule Sim.Chaos.Run do
  @moduledoc "Plays one run of `mix chaos` from its options to its violations. Pure."
  alias Sim.{Invariants, Trial}
  alias Sim.Invariants.Violation

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
    with {:ok, trial} <- Trial.new(Map.new(options)) do
      {trial, judge} = go_on(trial, Invariants.new(trial), fn _judge -> false end)
      result = Trial.result(trial)
      {:ok, outcome(Invariants.finish(judge, result), trial, result)}
    end
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
    done? = &Invariants.violated?(&1, invariant)
    {trial, judge} = go_on(trial, Invariants.new(trial), done?)
    judge = if done?.(judge), do: judge, else: Invariants.finish(judge, Trial.result(trial))
    Invariants.first(judge, invariant)
  end

  defp go_on(trial, judge, enough?) do
    if Trial.done?(trial) or Invariants.violated?(judge, :crash) or enough?.(judge) do
      {trial, judge}
    else
      {trial, judge} = Invariants.step(judge, trial)
      go_on(trial, judge, enough?)
    end
  end

  defp outcome(judge, trial, result) do
    judged =
      for claim <- result.claims, (right? = Invariants.right?(judge, claim)) != nil, do: right?

    %{
      violations: Invariants.violations(judge),
      simulated_s: result.simulated_s,
      robots: result.robots,
      elections: Enum.count(result.stages, &(&1.stage == :elected)),
      kills: Enum.count(result.stages, &(&1.stage == :killed)),
      partitions: length(result.agreement.heals),
      formed?: Enum.any?(result.stages, &(&1.stage == :formed)),
      ended_formed?: Trial.formed?(trial),
      claims: length(judged),
      true_claims: Enum.count(judged, & &1),
      rivals_s: result.agreement.rivals_max_s
    }
  end
end
