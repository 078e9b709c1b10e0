defmodule Sim.Scenario.Runner do
  @moduledoc """
  Runs a scenario in lockstep and judges what it expects, as a fold. Pure.

  A run ends when all expectations are decided, when those that are left concern the whole run, have been judged for 5 s
  and the fleet is calm (`Sim.Trial.done?/1`), or when its time is up. One that ends at a time keeps it alive until then.
  A run that raises does so here, too, but where a scenario expects that it does not: then it ends.
  """
  alias Sim.{Invariants, Scenario, Trial}
  alias Sim.Scenario.{Check, View}

  @enforce_keys [:scenario, :trial, :judge, :checks]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          scenario: Scenario.t(),
          trial: Trial.t(),
          judge: Invariants.t(),
          checks: [Check.t()]
        }

  @doc "A run at its beginning; the error is one line."
  @spec new(Scenario.t()) :: {:ok, t()} | {:error, line :: String.t()}
  def new(%Scenario{} = scenario) do
    with {:ok, trial} <- Trial.new(Scenario.trial(scenario)), do: {:ok, begin(scenario, trial)}
  end

  @doc "The same with a trial that was made of the scenario's options, as one that is recorded."
  @spec begin(Scenario.t(), Trial.t()) :: t()
  def begin(%Scenario{} = scenario, trial) do
    checks = Enum.map(scenario.expect, &Check.new/1)

    %__MODULE__{
      scenario: scenario,
      trial: trial,
      judge: Invariants.new(trial),
      checks: checks
    }
  end

  @doc "Advances the run by 100 ms."
  @spec step(t()) :: t()
  def step(%__MODULE__{} = run) do
    {trial, judge} = advance(run)
    view = View.of(trial)
    checks = Enum.map(run.checks, &Check.tick(&1, view, judge))
    %{run | trial: trial, judge: judge, checks: checks}
  end

  defp advance(%{scenario: %{expect: expect}, judge: judge, trial: trial}) do
    if {:never, :crash} in expect do
      Invariants.step(judge, trial)
    else
      trial = Trial.step(trial)
      {trial, Invariants.note(judge, trial)}
    end
  end

  # As long as a fleet has to be calm.
  @judged_s 5

  @doc "Whether the run is over."
  @spec done?(t()) :: boolean()
  def done?(%__MODULE__{trial: trial, checks: checks} = run) do
    Invariants.violated?(run.judge, :crash) or
      over?(run.scenario, checks, trial.at_ms / 1000, fn -> Trial.done?(trial) end)
  end

  @doc "Whether a run is over at this second, by its checks; `done?` says whether its fleet has nothing left to do."
  @spec over?(Scenario.t(), [Check.t()], at_s :: number(), done? :: (... -> boolean())) ::
          boolean()
  def over?(scenario, checks, at_s, done?) do
    left = Enum.filter(checks, &(&1.status in [:open, :holding]))

    cond do
      at_s >= Scenario.duration_s(scenario) -> true
      checks != [] and left == [] -> true
      Enum.any?(left, &wanted?(&1, at_s)) -> false
      true -> done?.()
    end
  end

  defp wanted?(%{status: :open}, _at_s), do: true
  defp wanted?(%{window: {from_s, :end}}, at_s), do: at_s < from_s + @judged_s
  defp wanted?(_until_a_time, _at_s), do: true

  @doc "The verdicts if the run ended now, in the order of the expectations."
  @spec verdicts(t()) :: [Check.verdict()]
  def verdicts(%__MODULE__{trial: trial, checks: checks} = run) do
    judge = Invariants.finish(run.judge, Trial.result(trial))

    for check <- checks, do: Check.verdict(check, trial.at_ms / 1000, judge)
  end

  @doc """
  A whole run: the report (`Sim.Trial.result/1`) and the verdicts.

      iex> {:ok, scenario} = Sim.Scenario.new(options: [robots: 1, duration_s: 1], expect: [{:never, :collision}, {:formed, by_s: 0.5}])
      iex> {:ok, result, [safe, formed]} = Sim.Scenario.Runner.run(scenario)
      iex> {result.simulated_s, safe.held?, formed.held?, formed.at_s, formed.figures}
      {1.0, true, false, 0.5, "not in formation: nobody leads; mag1 search"}
  """
  @spec run(Scenario.t()) ::
          {:ok, result :: map(), [Check.verdict()]} | {:error, line :: String.t()}
  def run(%Scenario{} = scenario) do
    with {:ok, run} <- new(scenario) do
      run = finish(run)
      {:ok, Trial.result(run.trial), verdicts(run)}
    end
  end

  defp finish(run), do: if(done?(run), do: run, else: run |> step() |> finish())
end
