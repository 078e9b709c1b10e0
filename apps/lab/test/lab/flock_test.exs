defmodule Lab.FlockTest do
  @moduledoc """
  The flock as a fleet carries it out, judged by true poses, which no robot sees. `FIGURES=1 mix test --only long` prints what
  is in docs/reports/flock.md.
  """
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Missions.Flock.{Field, Members}
  alias Lab.Trial
  alias Sim.World

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

  # Until `rest` ticks after all say that they have arrived, at most so many seconds: the ticks since it had gathered, in how
  # many of them the flock truly hung together at its reach and at 1.2 spacings, and the least distance of two robots.
  defp run(trial, seconds, rest) do
    seen = %{ticks: 0, together: 0, close: 0, least: 99.0, gathered_s: nil, arrived_s: nil}

    Enum.reduce_while(1..(seconds * 10), {trial, seen}, fn n, {trial, seen} ->
      trial = Trial.step(trial)
      points = for id <- Trial.living(trial), do: Pose.point(World.truth(trial.world, id))
      seen = see(%{seen | least: min(seen.least, least(points))}, trial, points)
      over? = seen.arrived_s != nil and n >= 10 * seen.arrived_s + rest
      {if(over?, do: :halt, else: :cont), {trial, seen}}
    end)
  end

  defp see(%{gathered_s: nil} = seen, trial, points) do
    if Enum.any?(Trial.stages(trial), &(&1.stage == :gathered)),
      do: see(%{seen | gathered_s: trial.at_ms / 1_000}, trial, points),
      else: seen
  end

  defp see(seen, trial, points) do
    arrived? = Enum.all?(Trial.claims(trial), fn {_id, claim} -> claim[:formed] == true end)

    %{
      seen
      | ticks: seen.ticks + 1,
        together: seen.together + together(points, Field.reach(@spacing)),
        close: seen.close + together(points, 1.2 * @spacing),
        arrived_s: seen.arrived_s || if(arrived?, do: trial.at_ms / 1_000)
    }
  end

  defp together(points, far), do: if(Members.together?(points, far), do: 1, else: 0)

  defp least([_last]), do: 99.0

  defp least([point | rest]),
    do: rest |> Enum.map(&Pose.distance(point, &1)) |> Enum.min() |> min(least(rest))

  defp judge(trial, seconds, rest \\ 0) do
    {trial, seen} = run(trial, seconds, rest)
    assert for({_id, claim} <- Trial.claims(trial), uniq: true, do: claim.phase) == [:arrived]
    assert seen.together >= 0.95 * seen.ticks, inspect(seen)
    assert Trial.result(trial).collisions == 0

    if System.get_env("FIGURES"),
      do: IO.puts("#{trial.map.name} seed #{trial.options.seed}: #{inspect(Enum.sort(seen))}")

    trial
  end

  for {map, noise, loss, seed} <- [
        {"hall", :default, 0.0, 1},
        {"hall", :off, 0.2, 2},
        {"openplan", :default, 0.1, 3}
      ] do
    @tag :slow
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

  @tag :slow
  test "robots of several rooms come together through doors, and go on through doors" do
    course = [{-5.6, -0.1}, {5.5, -0.1}]

    trial =
      trial(6,
        map: "rooms:91",
        seed: 901,
        plan: :known,
        duration_s: 360,
        mission: {:flock, course: course}
      )

    trial =
      Enum.reduce_while(1..3_600, trial, fn _n, trial ->
        trial = Trial.step(trial)
        {if(Trial.done?(trial), do: :halt, else: :cont), trial}
      end)

    assert Trial.formed?(trial)
    assert Trial.result(trial).collisions == 0
  end

  test "a robot that dies does not stop the others" do
    trial(6, seed: 4, kills: [{:mag2, 30}], mission: {:flock, course: [{0.0, 0.0}, {3.0, 0.0}]})
    |> judge(150)
  end

  @tag :long
  @tag timeout: 1_800_000
  test "30 robots keep together" do
    seeds = if System.get_env("FIGURES"), do: 1..5, else: 1..1

    for {map, course} <- [
          {"hall", [{0, 0}, {8, 0}, {8, 8}]},
          {"openplan", [{-4, 0}, {4, 0}]}
        ],
        seed <- seeds,
        do: trial(30, map: map, seed: seed, mission: {:flock, course: course}) |> judge(200, 100)
  end

  test "what holds for every mission holds" do
    flock = {:flock, course: [{0, 0}, {2, 0}]}
    assert Lab.MissionCase.problems(flock, seeds: 1..2, seconds: 30) == []
  end

  test "a wrong option is one line" do
    assert {:error, "flock option spacing: expected a number from 0.9 to 5 m, got 0.1"} =
             Swarm.MissionRegistry.choose({:flock, spacing: 0.1}, 4)

    assert {:error, line} = Swarm.MissionRegistry.Text.read("flock:sped=1", 4)
    assert line =~ "did you mean speed?"
  end
end
