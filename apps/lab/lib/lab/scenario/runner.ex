defmodule Lab.Scenario.Runner do
  @moduledoc """
  Runs a scenario and judges what it expects: in lockstep, as a fold, or in real time on a fleet of processes (`Lab.Fleet`). The
  world and the events are the same; times of a fleet are those of this machine, so two of its runs are not the same.

  A run ends when all expectations are decided, when those that are left concern the whole run, have been judged for 5 s
  and the fleet is calm (`Lab.Trial.done?/1`), or when its time is up. One that ends at a time keeps it alive until then.
  A run that raises does so here, too, but where a scenario expects that it does not: then it ends.

  In real time nothing is said of invariants that are judged by what is inside processes (`Lab.Check.Kind`).
  """
  alias Lab.{Check, Fleet, Run, Scenario, Trial}

  # As long as a fleet has to be calm.
  @judged_s 5

  @doc "A run at its beginning; the error is one line."
  @spec new(Scenario.t()) :: {:ok, Run.t()} | {:error, line :: String.t()}
  def new(%Scenario{} = scenario),
    do:
      with({:ok, trial} <- Trial.new(Scenario.trial(scenario)), do: {:ok, begin(scenario, trial)})

  @doc "The same of a trial that was made of the scenario's options, as one that is recorded, or of a fleet."
  @spec begin(Scenario.t(), Run.source()) :: Run.t()
  def begin(%Scenario{expect: expect}, source) do
    guarded? = {:never, :crash} in expect and not is_pid(source)
    Run.new(source, Enum.map(expect, &Check.new/1), guarded?: guarded?)
  end

  @doc "Runs it on a fleet, and ends the fleet; the error, also of a fleet that has ended before its time, is one line."
  @spec live(Scenario.t(), (Run.t() -> answer)) :: {:ok, answer} | {:error, line :: String.t()}
        when answer: term()
  def live(scenario, play) do
    with {:ok, fleet} <- Fleet.start_link(Scenario.trial(scenario)) do
      try do
        answer = play.(begin(scenario, fleet))
        if line = Fleet.ended(fleet), do: {:error, line}, else: {:ok, answer}
      after
        Fleet.stop(fleet)
      end
    end
  end

  @doc "Plays it to its end. After each step `each` gets the run and what it returned last."
  @spec play(Scenario.t(), Run.t(), memory, (Run.t(), memory -> {Run.t(), memory})) ::
          {Run.t(), memory}
        when memory: term()
  def play(scenario, run, memory \\ nil, each \\ &{&1, &2}),
    do: Run.fold(run, memory, &done?(scenario, &1), fn _, run, memory -> each.(run, memory) end)

  defp done?(scenario, %{checks: checks} = run) do
    at_s = Run.at_ms(run) / 1000
    left = Enum.filter(checks, &(&1.status in [:open, :holding]))

    cond do
      Run.crashed?(run) or at_s >= Scenario.duration_s(scenario) -> true
      checks != [] and left == [] -> true
      is_pid(run.source) and Fleet.ended(run.source) != nil -> true
      Enum.any?(left, &wanted?(&1, at_s)) -> false
      true -> Run.done?(run)
    end
  end

  defp wanted?(%{status: :open}, _at_s), do: true
  defp wanted?(%{window: {from_s, :end}}, at_s), do: at_s < from_s + @judged_s
  defp wanted?(_until_a_time, _at_s), do: true

  @doc "The report (`Lab.Trial.result/1`) and the verdicts if the run ended now, in the order of the expectations."
  @spec verdicts(Run.t()) :: {result :: map(), [Check.verdict()]}
  def verdicts(run) do
    result = Run.result(run)
    {result, for(check <- run.checks, do: Check.verdict(check, Run.at_ms(run) / 1000, result))}
  end

  @doc """
  A whole run in lockstep: the report and the verdicts.

      iex> {:ok, scenario} = Lab.Scenario.new(options: [robots: 1, duration_s: 1], expect: [{:never, :collision}, {:formed, by_s: 0.5}])
      iex> {:ok, result, [safe, formed]} = Lab.Scenario.Runner.run(scenario)
      iex> {result.simulated_s, safe.held?, formed.held?, formed.at_s, formed.figures}
      {1.0, true, false, 0.5, "not in formation: no robot leads; mag1 search"}
  """
  @spec run(Scenario.t()) ::
          {:ok, result :: map(), [Check.verdict()]} | {:error, line :: String.t()}
  def run(%Scenario{} = scenario) do
    with {:ok, run} <- new(scenario) do
      {run, nil} = play(scenario, run)
      {result, verdicts} = verdicts(run)
      {:ok, result, verdicts}
    end
  end
end
