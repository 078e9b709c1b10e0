defmodule System.ScenariosTest do
  @moduledoc "All scenarios of test/scenarios and examples/thesis hold, side by side."
  use ExUnit.Case, async: true
  alias Console.Scenario.Report
  alias Lab.Scenario
  alias Lab.Scenario.Runner

  @files Path.wildcard(Path.expand("scenarios/*.exs", __DIR__)) ++
           Path.wildcard(Path.expand("../examples/thesis/*.exs", __DIR__))

  test "there are enough, each says what it is for and expects something" do
    assert length(@files) >= 20

    for file <- @files do
      assert {:ok, scenario} = Scenario.File.load(file)
      assert scenario.about != "" and scenario.expect != [], file
      assert File.read!(file) == Scenario.File.text(scenario), "#{file} is not as it is written"
    end
  end

  test "all hold" do
    failed =
      @files
      |> Task.async_stream(&failed/1, timeout: :infinity, ordered: false)
      |> Enum.flat_map(fn {:ok, lines} -> lines end)

    assert failed == []
  end

  defp failed(file) do
    Lab.Trial.Memory.prepare()
    {:ok, scenario} = Scenario.File.load(file)
    {:ok, _result, verdicts} = Runner.run(scenario)

    for verdict <- verdicts,
        not verdict.held?,
        do: "#{Path.basename(file)}: #{Report.verdict(verdict)}"
  end
end
