defmodule Lab.GateAloneTest do
  @moduledoc """
  Six robots that drive across each other's ways without looking, with nothing but the gate's limits
  (`Robot.Safety.Reflex`) between their wishes and their wheels. `FIGURES=1 mix test --only long` prints what is in
  docs/reports/avoidance.md.
  """
  use Lab.LockstepCase, async: true
  @moduletag :slow
  alias Hal.{Pose, Twist}
  alias Robot.Safety.Reflex
  alias Sim.World

  @robots ~w(mag1 mag2 mag3 min1 min2 min3)a
  @step_ms 50
  # 200 s.
  @steps 4_000
  # The sonars that fire in five steps if they do so one after the other, every 31.25 ms.
  @echoes 8

  # `round_s` is what the gate allows for; `at_once?` how the sonars fire.
  defp collisions(seed, speed, round_s, at_once?) do
    {:ok, map} = Sim.Floorplan.open("hall", length(@robots))
    {:ok, profiles} = Lab.Trial.Options.bodies(@robots, [])

    bodies =
      for {id, k} <- Enum.with_index(@robots) do
        pose = Pose.new(-2.0 + 0.8 * k, rem(k, 2) * 0.9, 0.7 * k)
        %{id: id, profile: profiles[id], pose: pose}
      end

    world = World.new!(map: map, robots: bodies, seed: seed)

    minds =
      for body <- bodies, into: %{} do
        reflex = Reflex.new(%{body.profile | sonar_round_s: round_s})
        {body.id, %{reflex: reflex, goal: {0.0, 0.0}, heard: nil}}
      end

    s = %{world: world, minds: minds, random: :rand.seed_s(:exsss, seed)}
    Enum.reduce(1..@steps, s, &step(&2, &1, speed, at_once?)).world.collisions
  end

  defp step(s, n, speed, at_once?) do
    s = Enum.reduce(@robots, s, &drive(&2, &1, n, speed, at_once?))
    %{s | world: World.step(s.world, @step_ms)}
  end

  defp drive(s, id, n, speed, at_once?) do
    at_ms = n * @step_ms
    mind = s.minds[id]
    readings = Map.new(World.readings(s.world, id))
    heard = heard(mind.heard, readings.sonar, n, at_once?)
    pose = World.truth(s.world, id)
    {goal, random} = goal(mind.goal, pose, s.random)

    {reflex, _urgency} = Reflex.sense(mind.reflex, {:sonar, heard}, at_ms)

    {twist, _limits, reflex} =
      reflex |> Reflex.wish(wish(pose, goal, speed), at_ms) |> Reflex.step(at_ms)

    mind = %{mind | reflex: reflex, goal: goal, heard: heard}

    %{
      s
      | world: World.drive(s.world, id, twist),
        minds: Map.put(s.minds, id, mind),
        random: random
    }
  end

  defp heard(before, fresh, _n, at_once?) when at_once? or before == nil, do: fresh

  defp heard(before, fresh, n, false) do
    count = length(fresh)
    now = for k <- div(n * @echoes, 5)..(div((n + 1) * @echoes, 5) - 1), do: rem(k, count)

    for {{old, new}, k} <- Enum.with_index(Enum.zip(before, fresh)),
        do: if(k in now, do: new, else: old)
  end

  # Another place once it is there, and now and then before.
  defp goal(goal, pose, random) do
    {chance, random} = :rand.uniform_s(random)

    if chance < 0.01 or Pose.distance(pose, goal) < 0.4 do
      {x, random} = :rand.uniform_s(random)
      {y, random} = :rand.uniform_s(random)
      {{4 * x - 2, 4 * y - 2}, random}
    else
      {goal, random}
    end
  end

  defp wish(pose, goal, speed) do
    bearing = Pose.bearing(pose, goal)
    linear = if abs(bearing) > 1.0, do: 0.0, else: speed * :math.cos(bearing)
    Twist.new(linear, (2.0 * bearing) |> max(-1.0) |> min(1.0))
  end

  test "at 0.2 m/s that is enough, also for sonars that fire one after the other, if it allows for them" do
    assert collisions(5, 0.2, 0.5, false) == 0
    # Without that they touch, and so they do at full speed: this test can fail.
    assert collisions(5, 0.2, 0.0, false) > 0
    assert collisions(5, 0.5, 0.5, false) > 0
  end

  @tag :long
  # It shares two processors with a hundred random missions and their replays, and goes last.
  @tag timeout: 1_800_000
  test "so it is over many seeds" do
    figures =
      for {at_once?, round_s} <- [{true, 0.0}, {false, 0.0}, {false, 0.5}],
          speed <- [0.5, 0.3, 0.2] do
        found = Enum.sum(for seed <- 1..8, do: collisions(seed, speed, round_s, at_once?))
        {at_once?, round_s, speed, found}
      end

    if System.get_env("FIGURES") do
      for {at_once?, round_s, speed, found} <- figures,
          do:
            IO.puts(
              "all sonars at once: #{at_once?}, allowed: #{round_s} s, #{speed} m/s: #{found} touches"
            )
    end

    for {at_once?, round_s, 0.2, found} <- figures,
        at_once? or round_s > 0,
        do: assert(found == 0)
  end
end
