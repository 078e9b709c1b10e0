defmodule Sim.Scenario.Live do
  @moduledoc """
  Runs a scenario in real time on a fleet of processes (`Sim.Fleet`), and judges what it expects by ten looks a second. The world and
  the events are those of the run in lockstep; times are those of this machine, so two runs are not the same.

  Of the invariants (`{:never, invariant}`) those of `Sim.Invariants.live/0` are judged; of the others nothing is said.
  """
  alias Sim.{Fleet, Invariants, Scenario}
  alias Sim.Scenario.{Check, Runner, View}
  alias Sim.Trial.RunLog

  @look_ms 100

  @typedoc "Shows a look: its time, what has happened to the fleet so far, the checks, and what the last call returned."
  @type shown ::
          (at_ms :: integer(), [Sim.Scene.stage()], [Check.t()], view :: term() -> term())

  @doc """
  A whole run: its report, how long it took in seconds, and the verdicts in the order of the expectations. `shown` is called at each look, at first with
  `view`. The error is one line.
  """
  @spec run(Scenario.t(), view :: term(), shown()) ::
          {:ok, result :: map(), at_s :: float(), [Check.verdict()]}
          | {:error, line :: String.t()}
  def run(
        %Scenario{} = scenario,
        view \\ nil,
        shown \\ fn _at_ms, _stages, _checks, view -> view end
      ) do
    with {:ok, fleet} <- Fleet.start_link(Scenario.trial(scenario)) do
      try do
        judge = Invariants.new(Fleet.moment(fleet))
        checks = Enum.map(scenario.expect, &Check.new/1)
        follow(%{fleet: fleet, scenario: scenario, judge: judge, checks: checks}, view, shown)
      after
        Fleet.stop(fleet)
      end
    end
  end

  defp follow(%{fleet: fleet} = run, view, shown) do
    receive do
    after
      @look_ms -> :ok
    end

    moment = Fleet.moment(fleet)
    seen = View.of(moment)
    judge = Invariants.watch(run.judge, moment)
    checks = Enum.map(run.checks, &Check.tick(&1, seen, judge))
    view = shown.(moment.at_ms, RunLog.stages(moment.run_log), checks, view)
    run = %{run | judge: judge, checks: checks}

    cond do
      line = Fleet.ended(fleet) ->
        {:error, line}

      Runner.over?(run.scenario, checks, View.at_s(seen), fn -> Fleet.done?(fleet) end) ->
        over(run, View.at_s(seen))

      true ->
        follow(run, view, shown)
    end
  end

  defp over(run, at_s) do
    result = Fleet.result(run.fleet)
    judge = Invariants.finish(run.judge, result)
    judged = Invariants.live()
    {:ok, result, at_s, for(check <- run.checks, do: Check.verdict(check, at_s, judge, judged))}
  end
end
