defmodule Sim.FlockTest do
  @moduledoc "The flock as a fleet carries it out, judged by true poses, which no robot sees."
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Missions.Flock.{Field, Members}
  alias Sim.{Trial, World}

  @spacing 1.2

  defp fleet(count),
    do:
      for(
        k <- 1..count,
        do: if(rem(k, 2) == 1, do: :"mag#{div(k + 1, 2)}", else: :"min#{div(k, 2)}")
      )

  defp trial(count, options) do
    all = %{robots: fleet(count), landmark: :none, blobs: :direct, duration_s: 1_000}
    {:ok, trial} = Trial.new(Map.merge(all, Map.new(options)))
    trial
  end

  # Until all say that they have arrived, at most so many seconds: the ticks since it had gathered, in how many of them the
  # flock truly hung together, and the least true distance between two robots.
  defp run(trial, seconds) do
    Enum.reduce_while(1..(seconds * 10), {trial, %{ticks: 0, together: 0}}, fn _n,
                                                                               {trial, seen} ->
      trial = Trial.step(trial)
      points = for id <- Trial.living(trial), do: Pose.point(World.truth(trial.world, id))
      gathered? = Enum.any?(Trial.stages(trial), &(&1.stage == :gathered))
      together = if Members.together?(points, Field.reach(@spacing)), do: 1, else: 0

      seen =
        if gathered?,
          do: %{ticks: seen.ticks + 1, together: seen.together + together},
          else: seen

      over? = Enum.all?(Trial.claims(trial), fn {_id, claim} -> claim[:formed] == true end)
      {if(over?, do: :halt, else: :cont), {trial, seen}}
    end)
  end

  defp judge(trial, seconds) do
    {trial, seen} = run(trial, seconds)
    assert for({_id, claim} <- Trial.claims(trial), uniq: true, do: claim.phase) == [:arrived]
    assert seen.together >= 0.95 * seen.ticks, inspect(seen)
    assert Trial.result(trial).collisions == 0
    trial
  end

  for {map, noise, loss, seed} <- [
        {"hall", :default, 0.0, 1},
        {"hall", :off, 0.2, 2},
        {"openplan", :default, 0.1, 3}
      ] do
    test "6 robots keep together on their way in #{map}, seed #{seed}, noise #{noise}, loss #{loss}" do
      course = [{0.0, 0.0}, {3.0, 0.0}]

      trial =
        6
        |> trial(
          map: unquote(map),
          noise: unquote(noise),
          loss: unquote(loss),
          seed: unquote(seed),
          mission: {:flock, course: course}
        )
        |> judge(150)

      points = for id <- Trial.living(trial), do: World.truth(trial.world, id)
      middle = {mean(points, & &1.x), mean(points, & &1.y)}
      assert Pose.distance(middle, {3.0, 0.0}) < 1.0
    end
  end

  defp mean(points, of), do: Enum.sum(Enum.map(points, of)) / length(points)

  test "a robot that dies does not stop the others" do
    trial(6, seed: 4, kills: [{:mag2, 30}], mission: {:flock, course: [{0.0, 0.0}, {3.0, 0.0}]})
    |> judge(150)
  end

  @tag :long
  @tag timeout: 600_000
  test "30 robots keep together" do
    for {map, course} <- [{"hall", [{0, 0}, {8, 0}]}, {"openplan", [{-4, 0}, {4, 0}]}] do
      trial(30, map: map, seed: 1, mission: {:flock, course: course}) |> judge(200)
    end
  end

  test "what holds for every mission holds" do
    assert Robot.MissionCase.problems({:flock, course: [{0, 0}, {2, 0}]}, seeds: 1..2, seconds: 30) ==
             []
  end

  test "a wrong option is one line" do
    assert {:error, "flock option spacing cannot be 0.1: a number from 0.9 to 5 m is allowed"} =
             Swarm.Missions.choose({:flock, spacing: 0.1}, 4)

    assert {:error, line} = Swarm.Missions.Text.read("flock:sped=1", 4)
    assert line =~ "did you mean speed?"
  end
end
