defmodule Lab.PatrolTest do
  @moduledoc "The patrol as a fleet carries it out, judged by true poses, which no robot sees."
  use ExUnit.Case, async: true
  alias Hal.{Options, Pose}
  alias Missions.Patrol
  alias Missions.Patrol.Motivation
  alias Lab.Trial
  alias Sim.World

  @fleet [:mag1, :mag2, :min1, :min2]

  defp trial(options) do
    all = %{robots: @fleet, landmark: :none, blobs: :direct, duration_s: 1_000, mission: :patrol}
    {:ok, trial} = Trial.new(Map.merge(all, Map.new(options)))
    trial
  end

  defp points, do: Patrol.Options.points(Options.defaults(Patrol.Options.table()))

  defp active(trial, id),
    do: Swarm.Member.runner(Trial.robot(trial, id)).mission.motivation.active

  # The longest time that each point was out of sight, and the run, after so many seconds. A robot that is less sure of its
  # pose than it is near the point sees it from a little farther.
  defp gaps(trial, seconds, from_m) do
    start = {trial, Map.new(points(), &{&1, {0, 0}})}

    Enum.reduce(1..(seconds * 10), start, fn tick, {trial, gaps} ->
      trial = Trial.step(trial)
      poses = for id <- Trial.living(trial), do: World.truth(trial.world, id)

      {trial,
       Map.new(gaps, fn {point, {last, worst}} ->
         seen? = Enum.any?(poses, &(Pose.distance(&1, point) < from_m))
         {point, {if(seen?, do: tick, else: last), max(worst, tick - last)}}
       end)}
    end)
  end

  test "its points stand in the scene with how long ago a robot saw them, and in recordings" do
    trial = Enum.reduce(1..50, trial(seed: 1), fn _tick, trial -> Trial.step(trial) end)
    scene = Trial.scene(trial)
    assert scene.mission == "patrol"
    assert [{:points, _name, drawn}] = scene.layer
    assert for({x, y, _label} <- drawn, do: {x, y}) == points()

    assert Enum.all?(drawn, fn {_x, _y, label} -> label =~ ~r/^\d+: (not seen yet|\d+ s ago)$/ end)

    json = 0 |> Lab.Recording.Drawing.scene(scene) |> IO.iodata_to_binary()
    for {_x, _y, label} <- drawn, do: assert(json =~ label)
  end

  for {map, noise, loss, seed, by} <- [
        {"hall", :off, 0.0, 1, :motivation},
        {"hall", :default, 0.0, 2, :motivation},
        {"arena", :default, 0.2, 3, :motivation},
        {"arena", :default, 0.2, 3, :auction},
        {"arena", :default, 0.2, 3, :rules}
      ] do
    test "4 robots see every point each 120 s in #{map}, seed #{seed}, noise #{noise}, loss #{loss}, by #{by}, also when one dies" do
      kills = [{:mag2, 125}]

      trial =
        trial(
          map: unquote(map),
          noise: unquote(noise),
          loss: unquote(loss),
          seed: unquote(seed),
          mission: {:patrol, by: unquote(by)},
          kills: kills
        )

      {trial, gaps} = gaps(trial, 260, if(unquote(noise) == :off, do: 0.6, else: 1.0))
      assert Trial.living(trial) == @fleet -- [:mag2]

      for {point, {_last, worst}} <- gaps,
          do: assert(worst <= 1_200, "#{inspect(point)}: #{worst / 10} s")

      assert Trial.result(trial).collisions == 0
    end
  end

  test "one robot alone, whom nobody hears, visits all points" do
    {_trial, gaps} = gaps(trial(robots: [:mag1], noise: :off), 240, 0.6)
    for {point, {last, _worst}} <- gaps, do: assert(last > 0, inspect(point))
  end

  # Of four robots at three points one is free.
  test "a dead robot's point is taken over within tau + theta/fast" do
    for seed <- 1..4 do
      three = [{-2.0, -2.0}, {2.0, -2.0}, {0.0, 2.0}]
      trial = trial(noise: :off, seed: seed, mission: {:patrol, points: three, period: 240})
      at = fn trial -> for id <- @fleet, point = active(trial, id), do: {point, id} end

      shared? = fn trial ->
        trial |> at.() |> Enum.uniq_by(&elem(&1, 0)) |> length() == 3 and length(at.(trial)) == 3
      end

      # A second after each of the three has told that it has a point of its own.
      trial = until(trial, shared?)
      trial = Enum.reduce(1..10, trial, fn _, trial -> Trial.step(trial) end)
      assert shared?.(trial)
      {point, dead} = Enum.at(at.(trial), rem(seed, 3))
      killed = trial |> Trial.kill(dead) |> Trial.step()
      others = @fleet -- [dead]
      over = until(killed, fn trial -> Enum.any?(others, &(active(trial, &1) == point)) end)
      assert over.at_ms - killed.at_ms <= Motivation.takeover_ms() + 100, "seed #{seed}"
      assert %{says: says} = Enum.find(Trial.stages(over), &(&1.stage == :taken_over))
      assert says == "takes point #{point + 1} over from #{dead}"
    end
  end

  defp until(trial, true?, left \\ 1_000) do
    cond do
      true?.(trial) -> trial
      left == 0 -> flunk("not within 100 s")
      true -> trial |> Trial.step() |> until(true?, left - 1)
    end
  end

  test "the same seed gives the same run, and a run by name ends when all was seen" do
    run = fn ->
      Enum.reduce(1..300, trial(seed: 5), fn _, trial -> Trial.step(trial) end) |> Trial.result()
    end

    assert run.() == run.()
    trial = trial(noise: :off) |> until(&Trial.done?/1)
    assert Trial.formed?(trial) and Trial.result(trial).mission == "patrol"
    assert {:error, line} = Trial.new(%{mission: :patorl})
    assert line =~ "did you mean :patrol?"
    assert {:error, line} = Trial.new(%{mission: {:patrol, period: 1}})
    assert line =~ "period: expected a number from 10 to 3600 s, got 1"
  end

  test "a text command starts it in the middle of a run of another mission" do
    script = [{5.0, {:tell, :all, "start:patrol:loop=line"}}]
    {:ok, trial} = Trial.new(%{robots: [:mag1, :mag2], blobs: :direct, script: script})
    trial = Enum.reduce(1..100, trial, fn _, trial -> Trial.step(trial) end)

    for id <- [:mag1, :mag2],
        do: assert(Swarm.Member.runner(Trial.robot(trial, id)).module == Patrol)

    assert {:error, line} = Trial.new(%{script: [{5.0, {:tell, :all, "start:patorl"}}]})
    assert line =~ "did you mean patrol?"
  end
end
