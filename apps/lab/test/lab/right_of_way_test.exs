defmodule Lab.RightOfWayTest do
  @moduledoc """
  Robots that meet where only one fits: `Robot.Behaviour.Avoid.RightOfWay`. `FIGURES=1 mix test --only long` prints what is
  in docs/reports/avoidance.md.
  """
  use Lab.LockstepCase, async: true
  @moduletag :slow
  alias Lab.Corridor

  @two [mag1: :left, min1: :right]
  @three [mag1: :left, mag2: :left, min1: :right]
  @minis [min1: :left, min2: :right]

  # Width and length (metres), what is drawn over it, and who is sent through.
  @cases [
    {"corridor of 1.0 m, Magellan and mini", {1.0, 6.0}, [], @two},
    {"the same with a niche", {1.0, 6.0}, [{:free, {:box, -0.5, 0.5, 0.5, 1.4}}], @two},
    {"corridor of 1.0 m, two minis", {1.0, 6.0}, [], @minis},
    {"corridor of 1.4 m", {1.4, 6.0}, [], @two},
    {"corridor of 1.0 m, two and one", {1.0, 6.0}, [], @three},
    {"door of 1.1 m, two and one", {1.1, 0.2}, [], @three}
  ]

  # In all runs but so many.
  defp all_arrive({about, {width, length}, shapes, sides}, seeds, missed \\ 0) do
    map = Corridor.map(width, length, shapes)

    runs =
      for seed <- seeds,
          do: Corridor.run(map, map, seed, Corridor.robots(sides, length / 2, seed), 150)

    assert Enum.all?(runs, &(&1.collisions == 0))
    {arrived, others} = Enum.split_with(runs, &(arrived(&1) == length(sides)))
    assert length(others) <= missed, "#{about}: #{inspect(for run <- others, do: run.ended)}"

    if System.get_env("FIGURES") do
      times = Enum.sort(for run <- runs, {_id, {:done, s}} <- run.ended, do: s)
      gap = runs |> Enum.map(& &1.gap) |> Enum.min()

      IO.puts(
        "#{about}: #{length(arrived)} of #{length(runs)}, median #{Enum.at(times, div(length(times), 2))} s, " <>
          "last #{List.last(times)} s, gap #{Float.round(gap, 2)} m"
      )
    end
  end

  defp arrived(run), do: Enum.count(run.ended, &match?({_id, {:done, _s}}, &1))

  test "two that meet in a corridor for one both arrive", do: all_arrive(hd(@cases), [1])
  test "three that meet in a door all arrive", do: all_arrive(List.last(@cases), [1])

  test "a robot whose sonars have seen walls all round gives up in words, before its patience ends" do
    wall = [{:wall, {:box, -0.1, -2.5, 0.1, 2.5}}]
    robots = Corridor.robots([mag1: :left], 0.1, 3)
    run = Corridor.run(Corridor.map(1.1, 0.2, wall), :sonar, 3, robots, 60)
    assert %{mag1: {:given_up, "no way", at_s}} = run.ended
    assert at_s < 40
  end

  @tag long: true
  test "all arrive, by ten seeds; of the three in the door in nine" do
    {door, corridors} = List.pop_at(@cases, -1)
    for one <- corridors, do: all_arrive(one, 1..10)
    all_arrive(door, 1..10, 1)
  end
end
