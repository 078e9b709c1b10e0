defmodule Lab.Chaos.ShrinkTest do
  use Lab.LockstepCase, async: true
  alias Lab.Chaos.{Draw, Shrink}
  alias Lab.Trial.Options

  doctest Lab.Chaos.Shrink

  @run [
    robots: [:mag1, :mag2, :mag3, :min1, :min2],
    seed: 5,
    map: "arena",
    landmark: {1.0, 2.0},
    moves: [{{1.0, 1.0}, 20}],
    kills: [{:mag3, 15}, {:leader, 30}],
    cuts: [{10, 20, [[:mag1, :mag2], [:mag3, :min1, :min2]]}, {5, :end, {:link, :mag1, :min2}}],
    script: [{12, {:freeze, :mag2, 3.0}}, {50, {:estop, :mag1}}],
    loss: 0.3,
    noise: :slip,
    duration_s: 200
  ]

  test "keeps what is needed, and takes away all else" do
    wrong? = fn run ->
      cut? = Enum.any?(run[:cuts], &match?({10, 20, [_, _]}, &1))
      if cut? and :min1 in run[:robots] and run[:noise] == :slip, do: 17_300
    end

    {smallest, attempts} = Shrink.shrink(@run, wrong?, 200)
    assert [robot, :min1] = smallest[:robots]
    assert smallest[:cuts] == [{10, 20, [[robot], [:min1]]}]
    assert smallest[:moves] == [] and smallest[:kills] == [] and smallest[:script] == []
    assert smallest[:loss] == 0.0 and smallest[:noise] == :slip
    assert smallest[:map] == "hall" and smallest[:landmark] == :default
    assert smallest[:duration_s] == 18
    assert attempts < 60
    assert {smallest, attempts} == Shrink.shrink(@run, wrong?, 200)
  end

  test "stops after so many attempts, and judges no run twice" do
    test = self()

    judge = fn run ->
      send(test, {:judged, run})
      if :min1 in run[:robots], do: 100_000
    end

    assert {_smaller, 5} = Shrink.shrink(@run, judge, 5)
    assert length(judged()) == 5
    assert Shrink.shrink(@run, judge, 0) == {@run, 0}
    {_smallest, attempts} = Shrink.shrink(@run, judge, 500)
    runs = judged()
    assert length(runs) == attempts and runs == Enum.uniq(runs)
  end

  test "a run that is wrong for one reason alone stays as it is" do
    assert {@run, _attempts} = Shrink.shrink(@run, &if(&1 == @run, do: 1_000), 500)
  end

  test "does not shorten a run that is then no longer wrong" do
    # Judged at its end, as claims are.
    wrong? = fn run -> if run[:duration_s] == 200, do: 30_000 end
    {smallest, _attempts} = Shrink.shrink(@run, wrong?, 200)
    assert smallest[:duration_s] == 200 and length(smallest[:robots]) == 1
  end

  test "every smaller run of a drawn one is a valid run" do
    test = self()

    judge = fn run ->
      send(test, {:judged, run})
      if :erlang.phash2(run, 2) == 0, do: 50_000
    end

    for n <- 1..8, do: Shrink.shrink(Draw.options(3, n), judge, 40)
    for run <- judged(), do: assert({:ok, _options} = Options.check(run))
  end

  defp judged do
    receive do
      {:judged, run} -> [run | judged()]
    after
      0 -> []
    end
  end
end
