defmodule BenchTest do
  use ExUnit.Case, async: true
  alias Console.FakeTrial

  doctest Bench
  doctest Bench.Table

  defp run(name) do
    {:ok, [case]} = Bench.choose(name)
    {:ok, measured} = Bench.Run.run(case, "hall", 3, :direct, FakeTrial)
    measured
  end

  test "a plain run counts from the start, one with an intervention from the intervention" do
    plain = run("six")
    assert plain.within? and plain.formed_s > 5
    assert {mean, max} = plain.error
    assert mean <= max

    for name <- ["move", "kill-leader", "kill-middle"] do
      measured = run(name)
      assert measured.formed_s != nil, name
      assert measured.formed_s < 60
    end
  end

  test "a fleet that never forms is counted as such" do
    assert %{formed_s: nil, within?: false, error: nil} = run("none")
  end

  test "claims are counted by case, and pooled, with the worst case" do
    claim = fn then, later -> %{at_s: 1.0, robot: :mag1, worst_m: then, worst_5s_m: later} end
    run = fn claims -> %{run("six") | claims: claims} end

    rows = [
      {"six", "hall", 120, [run.([claim.(0.1, 0.2)]), run.([claim.(0.5, nil)])]},
      {"slip", "hall", 180, [run.([claim.(0.4, 0.6), claim.(0.1, 0.1)])]},
      {"one", "hall", 180, [run.([claim.(nil, nil)])]}
    ]

    [_head, _rule, six, slip, one] = rows |> Bench.Table.draw() |> String.split("\n", trim: true)
    assert six =~ "| 2 of 2 (100.0 %) |"
    assert slip =~ "| 1 of 2 (50.0 %) |"
    refute one =~ "%)"
    pooled = Bench.Table.pooled(rows)
    assert pooled =~ "at most 0.5 m off, at the claim and 5 s later: 3 of 4 (75.0 %)"
    assert pooled =~ "Least in one case: slip, in hall, 1 of 2 (50.0 %)"
    assert pooled =~ "without a word: 0 (goal 0)"

    # A mission without a leader has no places.
    unled = [{"six", "hall", 120, [%{run.([]) | leaders: 0}]}]
    assert Bench.Table.pooled(unled) =~ "nobody had a place"
    refute Bench.Table.pooled(unled) =~ "without a word"
    assert "slip" in Enum.map(Bench.cases(), & &1.name)
  end

  test "the table has a line for each row, and all its columns" do
    rows = [{"six", "hall", 120, [run("six"), run("none")]}, {"none", "hall", 120, [run("none")]}]
    lines = rows |> Bench.Table.draw() |> String.split("\n", trim: true)
    assert length(lines) == 4
    assert lines |> Enum.map(&length(String.split(&1, "|"))) |> Enum.uniq() |> length() == 1
    assert Enum.at(lines, 2) =~ "1 of 2 (120 s)"
  end
end
