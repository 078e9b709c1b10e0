defmodule Soak.RunnerTest do
  @moduledoc "A whole soak of some seconds: two robots on loopback."
  use ExUnit.Case, async: true
  alias Soak.Fleet.Processes
  alias Soak.{Report, Runner}

  @moduletag :realtime

  @plan [
    {0, :start},
    {1_000, {:process, :mag1, 0.3}},
    {1_200, {:junk, :mag1, :random, 20, 1}},
    {2_000, {:freeze, :mag2, 500}},
    {3_500, {:estop, :mag1}},
    {5_000, :reset},
    {5_200, {:node, :mag2}},
    {5_500, :world}
  ]

  test "nodes are killed, frozen and stopped, heal, and leave nothing" do
    journal = Path.join(System.tmp_dir!(), "soak-test-#{System.unique_integer([:positive])}.log")
    on_exit(fn -> File.rm(journal) end)

    s =
      Runner.run(%{
        seed: 1,
        plan: @plan,
        duration_ms: 10_000,
        robots: [:mag1, :mag2],
        namespaces?: false,
        journal: journal,
        progress: fn _s -> :ok end
      })

    assert s.violations == []
    assert s.counts == %{process: 1, junk: 1, freeze: 1, estop: 1, node: 1, world: 1}
    assert s.judge.stops.worst_us > 0
    assert s.restarts - s.gave_up == 1
    assert Processes.marked(s.mark) == []
    refute File.exists?(s.fleet.folder)
    said = File.read!(journal)

    for words <- [
          "kill -9 of mag2",
          "kill -9 of world",
          "frozen for 500 ms: mag2",
          "e-stop ordered"
        ],
        do: assert(said =~ words)

    assert Report.table(s, 10_000) =~ "| node | 1 |"
    assert Report.first(s, 1) == nil
  end
end
