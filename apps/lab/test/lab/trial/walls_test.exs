defmodule Lab.Trial.WallsTest do
  @moduledoc "Fleets in rooms that nobody tuned anything to, most with the floor plan."
  use Lab.LockstepCase, async: true
  @moduletag :slow
  import Lab.TrialRuns
  alias Lab.Trial
  alias Sim.Floorplan
  @moduletag :tmp_dir
  @robots [:mag1, :mag2, :mag3, :min1, :min2]

  # 20 cells a metre; walls are rectangles in metres, the origin is in the middle.
  defp draw(folder, {width, height}, walls) do
    walls = frame(width, height) ++ walls
    file = Path.join(folder, "plan.pgm")

    rows =
      for j <- (height * 20 - 1)..0//-1, i <- 0..(width * 20 - 1), into: <<>> do
        {x, y} = {(i + 0.5) / 20 - width / 2, (j + 0.5) / 20 - height / 2}

        <<if(Enum.any?(walls, fn {l, b, r, t} -> x >= l and x < r and y >= b and y < t end),
            do: 0,
            else: 255
          )>>
      end

    File.write!(file, ["P5\n#{width * 20} #{height * 20}\n255\n", rows])
    "#{file}:#{width}x#{height}"
  end

  defp frame(w, h) do
    [
      {-w / 2, -h / 2, w / 2, -h / 2 + 0.2},
      {-w / 2, h / 2 - 0.2, w / 2, h / 2},
      {-w / 2, -h / 2, -w / 2 + 0.2, h / 2},
      {w / 2 - 0.2, -h / 2, w / 2, h / 2}
    ]
  end

  defp formed(map, seed, plan \\ :known) do
    trial = run(%{map: map, robots: @robots, seed: seed, plan: plan, duration_s: 180})
    result = Trial.result(trial)
    assert Trial.formed?(trial)
    assert result.collisions == 0
    assert Enum.all?(result.claims, &(&1.worst_m < 0.5))
    result
  end

  test "a wall with a door in it", %{tmp_dir: folder} do
    map = draw(folder, {16, 12}, [{1.9, -6, 2.1, -1.4}, {1.9, 1.35, 2.1, 6}])
    formed(map, 1)
  end

  test "a wall that nobody knows before, with a door in it", %{tmp_dir: folder} do
    map = draw(folder, {16, 12}, [{1.9, -6, 2.1, -1.4}, {1.9, 1.35, 2.1, 6}])
    formed(map, 3, :sonar)
  end

  describe "a landmark where nobody sees it" do
    @describetag long: true

    test "is looked for from room to room" do
      moves = [{1, {:move, {8.0, 6.0}}}]
      options = %{map: "rooms:3", robots: @robots, landmark: :none, script: moves}
      trial = run(Map.merge(options, %{seed: 1, plan: :known, duration_s: 180}))
      assert Trial.formed?(trial)
      assert Trial.result(trial).collisions == 0
    end

    test "is said not to be there once all has been looked at" do
      options = %{map: "rooms:3", robots: @robots, landmark: :none, seed: 1, plan: :known}
      trial = run(Map.put(options, :duration_s, 240))
      assert %{collisions: 0, leader: nil, fleet: fleet} = Trial.result(trial)
      assert Enum.uniq(for robot <- fleet, do: robot.state) == [:rest]
      for robot <- fleet, do: assert(robot.says =~ ~r/no landmark: .* 2[23]\d m²/)
    end
  end

  test "four rooms with doors of 1.2 m", %{tmp_dir: folder} do
    walls = [
      {-0.1, -6, 0.1, -3.2},
      {-0.1, -2.0, 0.1, 2.4},
      {-0.1, 3.6, 0.1, 6},
      {-7, -0.1, -4.0, 0.1},
      {-2.8, -0.1, 3.0, 0.1},
      {4.2, -0.1, 7, 0.1}
    ]

    map = draw(folder, {14, 12}, walls)

    trial =
      run(%{
        map: map,
        robots: @robots,
        seed: 2,
        landmark: {-4.0, -3.0},
        plan: :known,
        duration_s: 180
      })

    # All get there. To claim it, each must also be sure of its place, which is not what walls change.
    result = Trial.result(trial)
    assert result.formation.error_max_m < 0.25 and result.collisions == 0
    assert Enum.all?(result.claims, &(&1.worst_m < 0.5))
  end

  test "the walls that robots know are the map's" do
    for name <- ["hall", "hospital", "arena"] do
      {:ok, map} = Floorplan.open(name, 4)
      grid = Floorplan.grid(map)
      {width, height} = Floorplan.size(map)
      :rand.seed(:exsss, 7)

      for _ <- 1..300 do
        point = {(:rand.uniform() - 0.5) * width, (:rand.uniform() - 0.5) * height}
        known = Nav.Grid.clearance(grid, point)
        # Never more than there is, but for the half of a cell; and not much less.
        assert known <= Floorplan.clearance(map, point, 6.0) + 0.08
        assert known >= min(Floorplan.clearance(map, point, 5.0), 5.0) - 0.25
      end
    end
  end
end
