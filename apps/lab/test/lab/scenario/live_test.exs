defmodule Lab.Scenario.LiveTest do
  @moduledoc "A scenario on robots of processes, in real time."
  use ExUnit.Case, async: false
  alias Lab.{Run, Scenario}
  alias Lab.Scenario.Runner
  @moduletag :realtime
  @moduletag :capture_log

  test "its events happen, and what it expects is judged by what was looked at" do
    {:ok, scenario} =
      Scenario.new(
        options: [robots: [:mag68, :mag69], blobs: :direct, duration_s: 5],
        script: [{1, {:tell, :mag69, "square:1"}}, {2, {:freeze, :mag69, 2}}],
        expect: [
          {:phase, :mag68, :search, by_s: 2},
          {:still, :mag69, from_s: 3.5, to_s: 3.9},
          {:moves, :mag69, by_s: 2},
          {:formed, by_s: 0.5},
          {:never, :collision},
          {:never, :too_fast}
        ]
      )

    test = self()

    shown = fn run, looks ->
      seen = {Run.at_ms(run), length(Run.stages(run)), length(run.checks)}
      send(test, {:look, looks, seen})
      {run, looks + 1}
    end

    assert {:ok, {result, verdicts}} =
             Runner.live(scenario, fn run ->
               {run, _looks} = Runner.play(scenario, run, 1, shown)
               assert Run.at_ms(run) >= 5_000
               Runner.verdicts(run)
             end)

    assert_received {:look, 20, {at_ms, count, 6}}
    assert at_ms >= 2_000 and count >= 3
    stages = for stage <- result.stages, do: {stage.stage, stage.robot}
    assert {:told, :mag69} in stages and {:frozen, :mag69} in stages

    assert [true, true, true, false, true, nil] == Enum.map(verdicts, & &1.held?),
           inspect(verdicts)

    assert List.last(verdicts).figures == "only a run in lockstep is judged by this"
  end

  test "a frozen robot claims nothing, and an order that is refused is told as that" do
    {:ok, scenario} =
      Scenario.new(
        options: [robots: [:mag70, :mag71], blobs: :direct, duration_s: 5],
        script: [{0.2, {:freeze, :mag70, 3}}, {0.4, {:tell, :mag70, "wander"}}],
        expect: [
          {:never_phase, :mag70, :search, from_s: 0.5, to_s: 2.5},
          {:phase, :mag70, :search, after_s: 3.3, by_s: 5}
        ]
      )

    assert {:ok, {%{stages: stages}, verdicts}} =
             Runner.live(scenario, fn run ->
               {run, nil} = Runner.play(scenario, run)
               Runner.verdicts(run)
             end)

    assert Enum.all?(verdicts, & &1.held?), inspect(verdicts)

    assert [%{robot: :mag70, command: "wander", why: "mag70 does not answer"}] =
             Enum.filter(stages, &(&1.stage == :order_refused))
  end

  test "a scenario with an order that only lockstep draws is refused" do
    {:ok, scenario} = Scenario.new(options: [robots: 1, casts: :drawn])

    assert Runner.live(scenario, & &1) ==
             {:error,
              "casts: :drawn is for runs in lockstep; processes hear each other as they are"}
  end

  test "what cannot start is one line" do
    {:ok, scenario} = Scenario.new(options: [robots: 1, map: "nowhere.png"])
    assert {:error, line} = Runner.live(scenario, & &1)
    assert line =~ "nowhere.png"
  end
end
