defmodule Lab.Trial.RunLogTest do
  use ExUnit.Case, async: true
  alias Sim.Scene
  alias Lab.Trial.RunLog

  doctest RunLog

  # A fleet of which a leader claims to be formed, and withdraws it, for so many seconds.
  defp flickering(run_log, seconds) do
    Enum.reduce(1..(seconds * 10), run_log, fn tick, run_log ->
      at_ms = 100 * tick
      claims = [mag1: %{phase: :lead, formed: rem(tick, 10) < 5, epoch: 1}]
      run_log = if rem(tick, 10) == 0, do: formed(run_log, at_ms), else: run_log

      run_log
      |> RunLog.note(at_ms, claims)
      |> RunLog.judge(at_ms, claims, fn _leader -> 0.1 end)
    end)
  end

  defp formed(run_log, at_ms), do: RunLog.stage(run_log, at_ms, :formed, :mag1, %{epoch: 1})

  test "a run without an end keeps the newest of what happened, and numbers it" do
    log = Missions.Landmark |> RunLog.new(50) |> flickering(100)
    stages = RunLog.stages(log)
    assert Enum.map(stages, & &1.n) == Enum.to_list(51..100)
    assert Scene.told(stages) == 100
    assert Enum.map(Scene.news(stages, 97), & &1.at_s) == [98.0, 99.0, 100.0]
    assert length(log.claims.told) == 50

    # It has reached its size.
    size = :erts_debug.flat_size(log)
    assert_in_delta :erts_debug.flat_size(flickering(log, 300)), size, 100
  end

  test "any other run keeps all" do
    log = Missions.Landmark |> RunLog.new() |> flickering(100)
    assert length(RunLog.stages(log)) == 100
    assert Scene.told(RunLog.stages(log)) == 100
    assert length(log.claims.told) == 100
  end
end
