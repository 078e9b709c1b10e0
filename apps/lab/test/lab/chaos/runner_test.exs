defmodule Lab.Chaos.RunnerTest do
  use Lab.LockstepCase, async: true
  @moduletag :slow
  alias Lab.Chaos.{Draw, Runner, ScenarioFile}
  alias Lab.Check.Violation
  alias Lab.Scenario

  # Small fleets for a short time, so that some runs take seconds.
  defp small(seed, number) do
    run = Draw.options(seed, number)

    [
      robots: Enum.take(run[:robots], 2),
      seed: run[:seed],
      script: Enum.reject(run[:script], fn {at_s, event} -> at_s > 20 or named?(event) end),
      loss: run[:loss],
      noise: run[:noise],
      blobs: :direct,
      duration_s: 25
    ]
  end

  defp named?(event), do: Lab.Trial.Event.robot(event) not in [nil, :all, :leader]

  test "runs give the same report, however many are played at once" do
    alone = Runner.run(5, 1..6, draw: &small/2, jobs: 1, attempts: 0)
    assert alone == Runner.run(5, 1..6, draw: &small/2, jobs: 4, attempts: 0)
    assert alone.clean? and length(alone.runs) == 6
    assert Enum.map(alone.runs, & &1.number) == Enum.to_list(1..6)
    assert Enum.any?(alone.runs, &(&1.outcome.elections > 0))
    # Each by itself is the same run.
    assert [one] = Runner.run(5, 5..5, draw: &small/2).runs
    assert one == Enum.at(alone.runs, 4)
  end

  test "each run is told when it ends" do
    test = self()
    done = &send(test, {:done, &1.number})
    Runner.run(1, 1..3, draw: &small/2, done: done)
    for number <- 1..3, do: assert_received({:done, ^number})
  end

  defp broken(_seed, _number), do: [robots: [:mag1], kills: [{:mag1, :soon}], duration_s: 5]

  test "a run that is refused is a violation, not the end" do
    assert %{clean?: false, runs: [run]} = Runner.run(1, [1], draw: &broken/2)
    assert [%Violation{invariant: :crash, figures: "not a run: " <> _}] = Runner.found(run)
  end

  defmodule Raising do
    @moduledoc "A mission that raises when it begins, or after a second."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def option_table, do: [at_once: :boolean]

    @impl Robot.Mission
    def init(robot, options) do
      if options[:at_once], do: raise("out of order")
      {:idle, robot, []}
    end

    @impl Robot.Mission
    def handle({:tick, %{at_ms: at_ms}}, _robot) when at_ms >= 1_000, do: raise("out of order")
    def handle(_event, robot), do: {:search, robot, []}
  end

  test "a run that raises is a violation, with the function, and made small as any other" do
    for {options, at_ms, duration_s, function} <- [
          {[], 1_000, 2, "handle/2"},
          {[at_once: true], 0, 1, "init/2"}
        ] do
      draw = &Keyword.put(small(&1, &2), :mission, {Raising, options})
      assert %{clean?: false, runs: [run]} = Runner.run(1, [1], draw: draw, attempts: 20)
      assert [%Violation{invariant: :crash, at_ms: ^at_ms, figures: line}] = Runner.found(run)
      assert line =~ ~r/"out of order".* in #{inspect(Raising)}\.#{function}$/
      assert [%{smallest: smallest, again: again}] = run.failures
      assert smallest[:duration_s] == duration_s and length(smallest[:robots]) == 1
      assert again.figures == line
    end
  end

  test "some false claims among many are within the goal, other violations never" do
    outcome = %{
      claims: 200,
      true_claims: 199,
      violations: [Violation.new(:false_claim, 1, [], "")]
    }

    run = %{number: 1, outcome: outcome, failures: []}
    assert Runner.clean?([run])
    refute Runner.clean?([put_in(run.outcome.true_claims, 197)])
    stuck = Violation.new(:stuck, 1, [:mag1], "")
    refute Runner.clean?([put_in(run.outcome.violations, [stuck])])
    assert Runner.clean?([])
  end

  test "a failure becomes a scenario, which can be read again" do
    violation = Violation.new(:collision, 12_300, [:mag1, :mag2], "mag1 at 0.00,0.00")
    smallest = Draw.options(1, 8)

    failure = %{
      number: 8,
      violation: violation,
      smallest: smallest,
      again: violation,
      attempts: 4
    }

    assert {:ok, "chaos-1-8-collision.exs", text} = ScenarioFile.text(1, failure)
    assert {:ok, scenario} = Scenario.File.parse(text)
    assert scenario.about =~ "Run 8 of seed 1: collision at 12.3 s, mag1 mag2"
    assert scenario.expect == [{:never, :collision}]

    given = for {key, value} <- smallest, key != :script, value not in [nil, []], do: {key, value}
    # That of its runs, and not that of a file that does not say.
    assert Enum.sort(scenario.options) == Enum.sort([{:plan, :none} | given])
    assert length(scenario.script) == length(smallest[:script])
  end

  test "a failure with another mission is a scenario with that mission" do
    patrol = {Missions.Patrol, period: 90}
    run = Draw.instead(Draw.options(1, 8), patrol)
    violation = Violation.new(:collision, 12_300, [:mag1], "")

    failure = %{number: 8, violation: violation, smallest: run, again: violation, attempts: 0}
    assert {:ok, _name, text} = ScenarioFile.text(1, failure)
    assert {:ok, scenario} = Scenario.File.parse(text)
    assert {:ok, played} = Lab.Trial.setup(Scenario.trial(scenario))
    assert {:ok, drawn} = Lab.Trial.setup(Map.new(run))
    assert played.options.mission == drawn.options.mission
    assert %{played.options | mission: nil} == %{drawn.options | mission: nil}
  end

  # The goal is that 99 % of all claims are true, and `mix chaos` judges by it. It is missed by little (docs/results.md);
  # here it must not get worse. One seed has some 70 claims, of which two would decide; five have 330.
  # `CHAOS_RUNS=100` plays more.
  @tag :long
  @tag timeout: :infinity
  test "forty runs as drawn of five seeds: nothing is violated but that a few claims are false" do
    last = String.to_integer(System.get_env("CHAOS_RUNS", "40"))
    all = for seed <- 1..5, do: {seed, Runner.run(seed, 1..last, attempts: 0).runs}

    found =
      for {seed, runs} <- all,
          run <- runs,
          %{invariant: what} <- Runner.found(run),
          what != :false_claim,
          do: {seed, run.number, what}

    assert found == []
    runs = for {_seed, runs} <- all, run <- runs, do: run
    count = fn key -> runs |> Enum.map(&Map.fetch!(&1.outcome, key)) |> Enum.sum() end
    assert count.(:true_claims) >= 0.97 * count.(:claims)
  end
end
