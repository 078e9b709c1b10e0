defmodule Lab.ExploreTest do
  @moduledoc "The exploration as a fleet carries it out."
  use ExUnit.Case, async: true
  alias Missions.Explore.SharedMap
  alias Lab.Trial

  defp trial(options) do
    all = %{landmark: :none, blobs: :direct, duration_s: 400, mission: :explore}
    {:ok, trial} = Trial.new(Map.merge(all, Map.new(options)))
    trial
  end

  defp map(trial, id), do: Swarm.Member.runner(Trial.robot(trial, id)).mission.map

  @tag :slow
  test "one robot explores the hall, and says so" do
    trial = [robots: [:mag1], seed: 1] |> trial() |> Lab.Run.play()
    assert Trial.formed?(trial)
    {width, height} = Sim.Floorplan.size(trial.map)
    # Without the walls, which are 0.2 m thick or more.
    assert SharedMap.area(map(trial, :mag1)) > 0.85 * width * height
    assert Trial.result(trial).collisions == 0
    assert [%{says: says}] = for(%{stage: :explored} = stage <- Trial.stages(trial), do: stage)
    assert says =~ ~r/^says that \d+ m² are explored/
  end

  for {robots, tags} <- [{3, []}, {4, [long: true]}] do
    @tag tags
    @tag :slow
    test "#{robots} know together what each has seen, although every fifth message is lost, and one dies",
      do: together(Enum.take([:mag1, :mag2, :min1, :min2], unquote(robots)))
  end

  defp together(robots) do
    trial =
      [robots: robots, seed: 2, loss: 0.2, kills: [{:mag2, 30}]] |> trial() |> Lab.Run.play()

    assert Trial.formed?(trial)
    areas = for id <- Trial.living(trial), do: SharedMap.area(map(trial, id))
    assert Enum.max(areas) - Enum.min(areas) < 0.03 * Enum.max(areas)
    assert Trial.result(trial).collisions == 0
  end

  test "printed marks that robots read on the way are on the map, and in its file" do
    at = [
      {2, {7.98, -1.98, 180.0}},
      {3, {-7.3, 5.98, -90.0}},
      {5, {-3.4, -5.98, 90.0}},
      {7, {2.1, 5.98, -90.0}},
      {8, {7.3, 5.98, -90.0}},
      {9, {-7.98, 0.2, 0.0}}
    ]

    options = [robots: [:mag1, :mag2, :mag3], seed: 1, duration_s: 90, marks: [size: 0.3, at: at]]
    trial = options |> trial() |> Lab.Run.play()
    mission = Swarm.Member.runner(Trial.robot(trial, :mag1)).mission
    hung = Missions.Explore.FoundMarks.hung(mission.marks)
    assert length(hung) >= 3
    folder = Path.join(System.tmp_dir!(), "marks#{System.unique_integer([:positive])}")
    File.mkdir_p!(folder)
    on_exit(fn -> File.rm_rf!(folder) end)
    file = Path.join(folder, "found.yaml")
    :ok = Nav.MapFile.save(file, Missions.Explore.map(mission))
    assert {:ok, %{marks: marks}} = Nav.MapFile.open(file)

    for {id, {x, y, turn, sd}} <- marks do
      assert sd > 0.0
      {true_x, true_y, degrees} = Map.fetch!(Map.new(at), id)
      assert :math.sqrt((x - true_x) ** 2 + (y - true_y) ** 2) < 0.3
      assert abs(Hal.Pose.wrap(turn - degrees * :math.pi() / 180)) < 0.1
    end

    # Whichever robot saw it, all have it.
    other = Swarm.Member.runner(Trial.robot(trial, :mag3)).mission
    ids = fn hung -> for({id, _at} <- hung, do: id) end
    assert ids.(Missions.Explore.FoundMarks.hung(other.marks)) == ids.(hung)
  end

  # Lanes one behind the other, each open at one end, in 12 x 10 m: a cell is 0.1 m.
  defp lanes(path, metres) do
    {width, height, lane} = {120, 100, round(metres * 10)}
    count = div(height - 1, lane + 1)

    rows =
      for y <- 0..(height - 1) do
        {n, within} = {div(y, lane + 1), rem(y, lane + 1)}
        open? = fn x -> if rem(n, 2) == 1, do: x >= width - 1 - lane, else: x <= lane end

        for x <- 0..(width - 1), into: "" do
          free? = n < count and (within > 0 or (n > 0 and open?.(x)))
          if(x in 1..(width - 2) and free?, do: "1 ", else: "0 ")
        end
      end

    File.write!(path, "P2\n#{width} #{height}\n1\n" <> Enum.join(rows, "\n") <> "\n")
    path <> ":12x10"
  end

  for {runs, tags} <- [{[{1.2, 1}, {1.0, 2}], []}, {[{1.2, 3}, {1.0, 4}], [long: true]}] do
    @tag tags
    @tag :slow
    @tag :tmp_dir
    test(
      "walls of few echoes that close a lane are looked at, and it does not say that all is explored where it is not, #{inspect(runs)}",
      %{tmp_dir: folder},
      do: few_echoes(folder, unquote(runs))
    )
  end

  defp few_echoes(folder, runs) do
    shares =
      for {metres, seed} <- runs do
        map = lanes(Path.join(folder, "lanes#{metres}.pgm"), metres)
        begun = trial(robots: [:mag1], seed: seed, map: map, duration_s: 600)
        start = Hal.Pose.point(begun.world.robots[:mag1].pose)
        trial = Lab.Run.play(begun)
        %{share: share} = Trial.Coverage.of(trial, [start])
        assert share > 0.95 or not Trial.formed?(trial), inspect({metres, seed, share})
        assert Trial.result(trial).collisions == 0
        share
      end

    assert Enum.sum(shares) / length(shares) > 0.5
  end

  test "what holds for every mission holds" do
    assert Lab.MissionCase.problems(:explore, seeds: 1..2, seconds: 60) == []
  end
end
