defmodule Lab.TrialTest do
  @moduledoc "Whole missions in lockstep: every layer except the processes."
  use Lab.LockstepCase, async: true
  import Lab.TrialRuns
  alias Lab.Trial
  @moduletag :slow

  # The first formation of seed 1, from which several tests go on; a trial is a value.
  setup_all do
    {:ok, trial} = Trial.new(%{seed: 1, blobs: :direct})
    %{formed: until(trial, &Trial.formed?/1)}
  end

  defp stages(trial), do: Enum.map(Trial.result(trial).stages, & &1.stage)

  defp assert_formed(trial) do
    result = Trial.result(trial)
    assert Trial.formed?(trial)
    assert result.collisions == 0
    assert result.leaders_at_once_max == 1
    assert result.formation.error_max_m == nil or result.formation.error_max_m < 0.6
    trial
  end

  test "six robots, by painted pictures, search, elect and form" do
    trial = assert_formed(run(%{seed: 1, blobs: :painted}))
    assert [:search, :elected, :formed | _] = stages(trial)
    assert Trial.result(trial).simulated_s < 90
    assert Trial.result(trial).formation.error_mean_m < 0.15
  end

  test "the leader is the robot in the record that saw the landmark largest" do
    for seed <- 1..4 do
      {:ok, trial} = Trial.new(%{seed: seed, blobs: :direct})
      trial = until(trial, &(Lab.Trial.RunLog.leader(&1.run_log) != nil))
      leader = Lab.Trial.RunLog.leader(trial.run_log)
      reports = Swarm.Member.runner(trial.members[leader]).mission.round.reports
      assert map_size(reports) == 6
      assert reports[leader].merit

      assert Enum.all?(reports, fn {_id, report} ->
               report.merit == nil or report.merit <= reports[leader].merit
             end)

      assert [%{size_ppm: size}] =
               for(%{stage: :elected} = s <- Trial.result(trial).stages, do: s)

      assert size == reports[leader].merit
    end
  end

  test "one seed gives one run; another seed gives another" do
    digest = fn seed ->
      trial = run(%{seed: seed, blobs: :painted, loss: 0.1, duration_s: 15})
      :crypto.hash(:sha256, inspect(Trial.result(trial), limit: :infinity))
    end

    assert digest.(5) == digest.(5)
    refute digest.(5) == digest.(6)
  end

  test "without noise all stand within a quarter of a metre of their slots" do
    result = run(%{seed: 3, noise: :off}) |> assert_formed() |> Trial.result()
    assert result.formation.error_mean_m <= 0.10
    assert result.formation.error_max_m <= 0.25
  end

  test "a fleet of any number forms" do
    for n <- [1, 2, 3, 9] do
      robots = for i <- 1..n, do: :"mag#{i}"
      assert_formed(run(%{seed: 2, robots: robots, duration_s: 180}))
    end
  end

  # The column forms in other tests.
  for {kinds, tags} <- [{[:wedge, :circle], []}, {Swarm.Formation.kinds(), [long: true]}] do
    @tag tags
    test "every shape forms: #{inspect(kinds)}" do
      for kind <- unquote(kinds), do: forms(kind)
    end
  end

  defp forms(kind) do
    trial = assert_formed(run(%{seed: 1, formation: {kind, 1.0}}))
    assert Trial.result(trial).formation.kind == kind
  end

  test "the fleet elects another leader when its leader is killed" do
    trial = assert_formed(run(%{seed: 1, kills: [{:leader, 35}]}))
    result = Trial.result(trial)
    assert [:search, :elected, :formed, :killed, :elected, :formed] = stages(trial)
    assert result.leader_changes == 1
    assert Enum.count(result.fleet, & &1.alive) == 5
    [first, second] = for %{stage: :elected, epoch: epoch} <- result.stages, do: epoch
    assert second > first
  end

  test "a shape asked for just before the leader dies is the next leader's shape",
       %{formed: trial} do
    trial = trial |> Trial.command(:all, {:formation, :wedge, 1.2}) |> Trial.kill(:leader)
    result = trial |> to_the_end() |> assert_formed() |> Trial.result()
    assert {result.formation.kind, result.formation.spacing_m} == {:wedge, 1.2}
  end

  test "a gap in the middle closes, without a new election", %{formed: trial} do
    leader = Lab.Trial.RunLog.leader(trial.run_log)
    second = Enum.at(Swarm.Member.runner(trial.members[leader]).mission.order, 1)
    trial = trial |> Trial.kill(second) |> to_the_end() |> assert_formed()
    assert Trial.result(trial).leader_changes == 0
    assert Trial.result(trial).leader == leader
  end

  test "the shape follows a landmark that is moved; with the thesis's options the leader stays" do
    options = %{seed: 1, assign: :chain, leader_change: false, moves: [{{0.0, 3.0}, 35}]}
    trial = assert_formed(run(options))
    result = Trial.result(trial)
    assert [:search, :elected | rest] = stages(trial)
    assert List.last(rest) == :formed and :landmark_moved in rest
    assert result.leader_changes == 0
    assert result.landmark_distance_m < 2.5
  end

  test "a landmark that passes the leader too near to be measured misleads nobody's pose" do
    options = %{seed: 1, formation: {:line, 1.0}, moves: [{{-5.0, 3.0}, 40}]}
    result = run(options) |> assert_formed() |> Trial.result()
    assert result.formation.error_max_m < 0.35
  end

  for {seeds, tags} <- [{1..1, []}, {2..3, [long: true]}] do
    @tag tags
    test "a fifth of all messages lost changes nothing but the time, seeds #{inspect(seeds)}" do
      for seed <- unquote(Macro.escape(seeds)),
          do: assert_formed(run(%{seed: seed, loss: 0.2}))
    end
  end

  test "without a landmark the fleet searches, stands still, and nobody leads" do
    trial = run(%{seed: 1, landmark: :none})
    result = Trial.result(trial)
    assert result.leader == nil and result.leaders_at_once_max == 0
    assert Enum.uniq(stages(trial)) == [:search]
    assert Enum.all?(result.fleet, &(&1.state == :rest))
    assert result.collisions == 0
    refute Trial.formed?(trial)
  end

  test "if a wall is in the way of the shape, it closes up and follows the leader's trail" do
    # Another leader stands elsewhere, and may have room.
    options = %{seed: 2, formation: {:line, 1.0}, landmark: {6.8, 0.0}, leader_change: false}
    result = run(options) |> assert_formed() |> Trial.result()
    assert result.formation.kind == :column
    assert result.collisions == 0
  end

  test "robots that are all switched on at one place form as well" do
    assert_formed(run(%{seed: 1, start: :same}))
  end

  test "an e-stop of one reaches all by their heartbeats, and nothing moves before a reset and a new start" do
    {:ok, trial} = Trial.new(%{seed: 1, blobs: :direct})
    trial = Enum.reduce(1..120, trial, fn _, trial -> Trial.step(trial) end)
    trial = Trial.command(trial, :mag1, :estop)
    trial = Enum.reduce(1..40, trial, fn _, trial -> Trial.step(trial) end)
    before = poses(trial)
    trial = Enum.reduce(1..30, trial, fn _, trial -> Trial.step(trial) end)
    assert poses(trial) == before
    trial = Trial.command(trial, :all, :reset)
    trial = Enum.reduce(1..30, trial, fn _, trial -> Trial.step(trial) end)
    assert poses(trial) == before, "a reset alone moved a robot"
    trial = Trial.command(trial, :all, :start)
    trial = Enum.reduce(1..30, trial, fn _, trial -> Trial.step(trial) end)
    refute poses(trial) == before
  end

  defp poses(trial),
    do: for(id <- trial.options.robots, do: Sim.World.truth(trial.world, id))

  test "invalid options are refused in one line" do
    assert {:error, line} = Trial.new(%{map: "moon"})
    assert line =~ "moon" and line =~ "hall"
    assert {:error, line} = Trial.new(%{landmark: {1.0e6, 0.0}})
    refute line =~ "\n"
  end
end
