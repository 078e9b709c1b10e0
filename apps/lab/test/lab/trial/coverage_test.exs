defmodule Lab.Trial.CoverageTest do
  use ExUnit.Case, async: true
  alias Lab.Trial.Coverage

  # All of a rectangle in one state.
  defp known(state, {left, right}, {low, high}) do
    {width, height} = {right - left, high - low}
    cells = :binary.copy(<<state>>, width * height)
    %{cells: cells, width: width, height: height, left: left, low: low, cell: 0.1}
  end

  test "the area is what a robot can come to, and its share what is known of it" do
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    {width, height} = Sim.Floorplan.size(map)
    area = Coverage.area(map, [{0.0, 0.0}])
    assert Coverage.size_m2(area) > 0.85 * width * height
    assert Coverage.size_m2(area) < width * height

    whole = known(1, {-200, 200}, {-200, 200})
    assert Coverage.share(area, whole) == 1.0
    assert Coverage.share(area, %{whole | cells: :binary.copy(<<0>>, 400 * 400)}) == 0.0
    assert Coverage.share(area, nil) == 0.0
    assert_in_delta Coverage.share(area, known(2, {-200, 0}, {-200, 200})), 0.5, 0.01
    assert_in_delta Coverage.share(area, known(1, {0, 200}, {-5, 5})), 0.5 / height, 0.03

    for far <- [{-900, -800}, {800, 900}],
        do: assert(Coverage.share(area, known(1, far, {-5, 5})) == 0.0)
  end

  test "the share of walls that are there; none of a map without a wall" do
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    plan = Sim.Floorplan.grid(map)
    assert Coverage.walls(known(1, {-5, 5}, {-5, 5}), plan, 0.2) == nil
    assert Coverage.walls(known(2, {-5, 5}, {-5, 5}), plan, 0.2) == 0.0
    assert Coverage.walls(known(2, {-5, 5}, {-5, 5}), plan, 100.0) == 1.0
  end

  test "a mission that makes no map has seen nothing of it" do
    {:ok, trial} = Lab.Trial.new(%{robots: [:mag1], landmark: :none, mission: :patrol})
    assert Coverage.of(trial, [{0.0, 0.0}]) == nil
  end
end
