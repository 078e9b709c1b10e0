defmodule Sim.ExploreTest do
  @moduledoc "The exploration as a fleet carries it out."
  use ExUnit.Case, async: true
  alias Missions.Explore.SharedMap
  alias Sim.Trial

  defp trial(options) do
    all = %{landmark: :none, blobs: :direct, duration_s: 400, mission: :explore}
    {:ok, trial} = Trial.new(Map.merge(all, Map.new(options)))
    trial
  end

  defp run(trial), do: if(Trial.done?(trial), do: trial, else: run(Trial.step(trial)))

  defp map(trial, id), do: Trial.robot(trial, id).runner.mission.map

  @tag :slow
  test "one robot explores the hall, and says so" do
    trial = [robots: [:mag1], seed: 1] |> trial() |> run()
    assert Trial.formed?(trial)
    {width, height} = Sim.Floorplan.size(trial.map)
    # Without the walls, which are 0.2 m thick or more.
    assert SharedMap.area(map(trial, :mag1)) > 0.85 * width * height
    assert Trial.result(trial).collisions == 0
    assert [%{says: says}] = for(%{stage: :explored} = stage <- Trial.stages(trial), do: stage)
    assert says =~ ~r/^says that \d+ m² are explored/
  end

  @tag :slow
  test "four know together what each has seen, although every fifth message is lost, and one dies" do
    robots = [:mag1, :mag2, :min1, :min2]
    trial = [robots: robots, seed: 2, loss: 0.2, kills: [{:mag2, 30}]] |> trial() |> run()
    assert Trial.formed?(trial)
    areas = for id <- Trial.living(trial), do: SharedMap.area(map(trial, id))
    assert Enum.max(areas) - Enum.min(areas) < 0.03 * Enum.max(areas)
    assert Trial.result(trial).collisions == 0
  end

  test "what holds for every mission holds" do
    assert Robot.MissionCase.problems(:explore, seeds: 1..2, seconds: 60) == []
  end
end
