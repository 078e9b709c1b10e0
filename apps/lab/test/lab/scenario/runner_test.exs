defmodule Lab.Scenario.RunnerTest do
  use Lab.LockstepCase, async: true
  alias Lab.{Moment, Scenario, Trial}
  alias Sim.World
  alias Lab.Scenario.Runner

  defp run(options, script, expect) do
    {:ok, scenario} =
      Scenario.new(options: [{:blobs, :direct} | options], script: script, expect: expect)

    assert {:ok, result, verdicts} = Runner.run(scenario)
    {result, verdicts}
  end

  defp held(options, script, expect),
    do: for(verdict <- elem(run(options, script, expect), 1), do: verdict.held?)

  # A robot alone that drives from where it stands, for a few seconds.
  @alone [robots: [:mag1], landmark: :none, noise: :off, duration_s: 8]
  @drive [{0, {:displace, :mag1, {-3, 0, 0}}}, {0, {:tell, :mag1, "move:0.3:0"}}]

  test "each expectation about a body can hold, and can fail" do
    expect = [
      {:moves, :mag1, by_s: 3},
      {:moves, :mag1, by_s: 0.1},
      {:still, :mag1, from_s: 0, to_s: 8},
      {:at, :mag1, {-2, 0}, within_m: 0.1, by_s: 8},
      {:at, :mag1, {2, 2}, within_m: 0.1, by_s: 8},
      {:speed_at_most, 0.31},
      {:speed_at_most, 0.2},
      {:turned, :mag1, 0, within_deg: 1, by_s: 5},
      {:turned, :mag1, 90, within_deg: 1, by_s: 5},
      {:phase, :mag1, :move, by_s: 1},
      {:phase, :mag1, :lead, by_s: 8},
      {:never_phase, :mag1, :lead},
      {:never_phase, :mag1, :move}
    ]

    assert held(@alone, @drive, expect) ==
             [true, false, false, true, false, true, false, true, false, true, false, true, false]
  end

  # It rests from some 45 s on.
  test "an expectation with an end keeps a calm run alive until then, one without for 5 s from its beginning" do
    options = [robots: [:mag1], landmark: :none, noise: :off, duration_s: 200, plan: :none]

    ends = fn expect -> elem(run(options, [], expect), 0).simulated_s end
    calm_s = ends.([{:never_phase, :mag1, :lead}])
    assert calm_s < 100
    assert ends.([{:never_phase, :mag1, :lead, from_s: 60, to_s: 130}]) == 130.0
    assert ends.([{:speed_at_most, 1, to_s: 140}, {:never, :collision}]) == 140.0
    assert ends.([{:one_leader, after_s: 150, to_s: 160}]) == 150.0
    assert ends.([{:never_phase, :mag1, :lead, from_s: 150}]) == 155.0
    assert ends.([{:never_phase, :mag1, :lead, from_s: 10}]) == calm_s
  end

  test "a verdict names the time and the figures" do
    {_result, [verdict]} = run(@alone, @drive, [{:speed_at_most, 0.2}])
    assert verdict.at_s > 0.2 and verdict.at_s < 3
    assert verdict.figures =~ ~r"mag1 at 0\.2\d* m/s"
  end

  test "a robot that touches the wall is found" do
    script = [{0, {:displace, :mag1, {7, 0, 0}}}, {0, {:tell, :mag1, "move:0.3:0"}}]
    {_result, [verdict]} = run(@alone, script, [{:never, :collision}])
    assert verdict.held?, "the gate stops it: #{verdict.figures}"
  end

  test "a stop ends a command, a start begins the group's mission again" do
    script = @drive ++ [{2, {:tell, :mag1, :stop}}, {5, {:tell, :mag1, :start}}]

    assert held(@alone, script, [
             {:phase, :mag1, :idle, after_s: 2, by_s: 3},
             {:still, :mag1, from_s: 4, to_s: 5},
             {:phase, :mag1, :search, after_s: 5, by_s: 6}
           ]) == [true, true, true]

    # And from a command, without a stop between.
    assert held(@alone, @drive ++ [{2, {:tell, :mag1, :start}}], [
             {:phase, :mag1, :search, after_s: 2, by_s: 3}
           ]) == [true]
  end

  test "a frozen robot stands, sends nothing and gets no commands" do
    script = @drive ++ [{2, {:freeze, :mag1, 3}}, {3, {:tell, :mag1, :stop}}]

    assert held(@alone, script, [
             {:moves, :mag1, by_s: 2},
             {:still, :mag1, from_s: 4, to_s: 5},
             {:moves, :mag1, after_s: 5, by_s: 8}
           ]) == [true, true, true]
  end

  test "what a frozen robot claimed last does not count" do
    script = [{1, {:freeze, :mag1, 3}}]

    expect = [
      {:phase, :mag1, :search, by_s: 0.5},
      {:never_phase, :mag1, :search, from_s: 1.2, to_s: 3.8},
      {:phase, :mag1, :search, after_s: 4.1, by_s: 5},
      {:never_phase, :all, :search, from_s: 1.2, to_s: 3.8}
    ]

    assert held(@alone, script, expect) == [true, true, true, true]
  end

  test "a frozen leader does not lead, and its fleet is not in formation by what it said" do
    options = [robots: 2, seed: 3, duration_s: 60]
    {_result, [formed]} = run(options, [], [{:formed, by_s: 60}])
    assert formed.held?
    at_s = formed.at_s + 1
    script = [{at_s, {:freeze, :leader, 1}}]

    assert held(options, script, [
             {:leader, by_s: at_s - 0.5},
             {:not_formed, from_s: at_s + 0.2, to_s: at_s + 0.9},
             {:same_leader, from_s: at_s - 0.5, to_s: at_s + 0.9}
           ]) == [true, true, false]
  end

  test "an order that is refused is told as that, by whom and why" do
    script = [
      {1, {:estop, :mag1}},
      {2, {:freeze, :mag2, 2}},
      {3, {:tell, :all, "wander"}},
      {3.5, {:tell, :mag2, {:formation, :line, 1.0}}}
    ]

    {%{stages: stages}, _verdicts} = run([robots: [:mag1, :mag2], duration_s: 4], script, [])

    assert [
             {3.0, :mag1, "wander", "mag1 is held by the emergency stop; reset it first"},
             {3.0, :mag2, "wander", "mag2 does not answer"},
             {3.5, :mag2, {:formation, :line, 1.0}, "mag2 does not answer"}
           ] ==
             for(
               %{stage: :order_refused} = s <- stages,
               do: {s.at_s, s.robot, s.command, s.why}
             )
  end

  test "the emergency stop of one robot stops all, a reset moves nobody" do
    options = [robots: 3, duration_s: 12]
    script = [{3, {:estop, :mag2}}, {6, :reset}]

    assert held(options, script, [
             {:phase, :all, :search, by_s: 3},
             {:still, :all, from_s: 5, to_s: 12},
             {:phase, :all, :idle, after_s: 11, by_s: 12}
           ]) == [true, true, true]
  end

  defp stepped(options, script, seconds) do
    {:ok, trial} = Trial.new(Map.new([{:blobs, :direct}, {:script, script} | options]))
    Enum.reduce(1..round(seconds * 10), trial, fn _, trial -> Trial.step(trial) end)
  end

  test "the radio is cut, joined, lossy, and deaf in one direction" do
    robots = [:mag1, :mag2, :min1]

    parts = fn script, at_s ->
      stepped([robots: robots], script, at_s)
      |> Moment.of()
      |> Moment.leaders()
      |> Enum.map(&elem(&1, 0))
    end

    cut = [{1, {:cut, [[:mag1], [:mag2, :min1]]}}]
    assert parts.(cut, 0.5) == [robots]
    assert parts.(cut, 2) == [[:mag1], [:mag2, :min1]]
    assert parts.(cut ++ [{2, {:join}}], 3) == [robots]
    assert parts.([{1, {:deaf, :min1, 1}}], 1.5) == [[:mag1, :mag2], [:min1]]
    assert parts.([{1, {:deaf, :min1, 1}}], 2.5) == [robots]
    # One that is frozen is not asked who leads it.
    assert parts.([{1, {:freeze, :mag2, 1}}], 1.5) == [[:mag1, :min1]]
    assert parts.([{1, {:freeze, :mag2, 1}}], 2.5) == [robots]

    lossy = stepped([robots: robots], [{0, {:loss, 1}}], 3)
    assert lossy.radio.lost == lossy.radio.sent
  end

  test "the landmark is moved, removed, and put there again" do
    script = [{1, {:remove_landmark}}, {2, {:move, {3, 1}}}]
    assert stepped([robots: 1 |> Scenario.Names.fleet()], script, 1.5).world.landmark == nil
    assert stepped([robots: [:mag1]], script, 2.5).world.landmark == {3.0, 1.0}
  end

  test "a robot is lifted where there is room only" do
    robots = [:mag1, :mag2]
    {x, y} = stepped([robots: robots], [], 0.1).world |> World.truth(:mag2) |> Hal.Pose.point()
    trial = stepped([robots: robots], [{0, {:displace, :mag1, {x, y, 0}}}], 0.2)
    assert [%{stage: :not_displaced, robot: :mag1} | _] = Trial.result(trial).stages

    assert {:error, line} =
             Trial.new(%{robots: robots, script: [{0, {:displace, :mag1, {99, 0, 0}}}]})

    assert line == "mag1 cannot be put at 99.0,0.0 of map hall: there is a wall"
    assert {:error, line} = Trial.new(%{robots: robots, script: [{0, {:move, {99, 0}}}]})
    assert line =~ "the landmark cannot stand at 99.0,0.0"
  end

  test "a blind robot finds nothing" do
    alone = [robots: [:mag1], duration_s: 20]
    script = [{0, {:displace, :mag1, {3, 0, 170}}}, {0, {:tell, :mag1, "findblob"}}]
    expect = [{:phase, :mag1, :found, by_s: 20}]
    assert held(alone, script, expect) == [true]
    assert held(alone, [{0, {:blind, :mag1, 20}} | script], expect) == [false]
  end

  test "the same scenario gives the same run" do
    script = [{3, {:freeze, :mag1, 2}}, {6, {:displace, :min1, {4, 3, 0}}}, {7, {:kill, :mag2}}]

    run = fn ->
      run([robots: 3, duration_s: 12], script, [{:never, :collision}, {:formed, by_s: 12}])
    end

    assert :erlang.term_to_binary(run.()) == :erlang.term_to_binary(run.())
  end
end
