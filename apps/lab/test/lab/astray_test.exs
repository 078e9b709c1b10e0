defmodule Lab.AstrayTest do
  @moduledoc """
  Six robots that drive across each other's ways, each 0.7 to 1.4 m beside where it believes to be, which they know:
  `Robot.Behaviour.Avoid`, where walls are that nobody has told of, and the gate. `FIGURES=1 mix test --only long` prints what is in
  docs/reports/recordings-and-chaos.md.
  """
  use Lab.LockstepCase, async: true
  @moduletag :slow
  alias Hal.{Pose, Twist}
  alias Robot.Percept
  alias Robot.Behaviour.{Avoid, Goto}
  alias Robot.Safety.Reflex
  alias Sim.World

  @robots ~w(mag1 mag2 mag3 min1 min2 min3)a
  @tick_ms 100

  # Collisions, and the mean speed (m/s), in so many seconds.
  defp run(seed, seconds) do
    {:ok, map} = Sim.Floorplan.open("hall", length(@robots))
    {:ok, profiles} = Lab.Trial.Options.bodies(@robots, [])

    bodies =
      for {id, k} <- Enum.with_index(@robots) do
        pose = Pose.new(-2.0 + 0.8 * k, rem(k, 2) * 0.9, 0.7 * k)
        %{id: id, profile: profiles[id], pose: pose}
      end

    {minds, random} = Enum.map_reduce(bodies, :rand.seed_s(:exsss, seed), &mind/2)
    world = World.new!(map: map, robots: bodies, seed: seed)
    s = %{world: world, minds: Map.new(minds), random: random, way: 0.0}
    s = Enum.reduce(1..(seconds * 10), s, &step(&2, &1))
    {s.world.collisions, s.way / length(@robots) / seconds}
  end

  defp mind(body, random) do
    {angle, random} = :rand.uniform_s(random)
    {far, random} = :rand.uniform_s(random)
    {angle, far} = {2 * :math.pi() * angle, 0.7 + 0.7 * far}

    mind = %{
      profile: body.profile,
      reflex: Reflex.new(body.profile),
      beside: {far * :math.cos(angle), far * :math.sin(angle)},
      goal: {0.0, 0.0},
      avoid: nil
    }

    {{body.id, mind}, random}
  end

  defp step(s, n) do
    s = Enum.reduce(@robots, s, &drive(&2, &1, n * @tick_ms))
    before = Map.new(@robots, &{&1, World.truth(s.world, &1)})
    world = s.world |> World.step(50) |> World.step(50)
    ways = for id <- @robots, do: Pose.distance(before[id], World.truth(world, id))
    %{s | world: world, way: s.way + Enum.sum(ways)}
  end

  defp drive(s, id, at_ms) do
    readings = Map.new(World.readings(s.world, id))
    {goal, random} = goal(s.minds[id].goal, World.truth(s.world, id), s.random)
    mind = aim(s.minds[id], goal)

    percept = %Percept{
      robot: id,
      at_ms: at_ms,
      profile: mind.profile,
      pose: believed(s, id),
      odometry: readings.odometry,
      sonar: readings.sonar,
      uncertainty: %{radius: 10.0, lost?: false},
      peers: for(other <- @robots, other != id, into: %{}, do: {other, peer(s, other, at_ms)})
    }

    {wish, avoid} =
      case Robot.Behaviour.tick(mind.avoid, percept) do
        {:running, wish, avoid} -> {if(wish, do: wish.twist, else: Twist.zero()), avoid}
        _done -> {Twist.zero(), nil}
      end

    {reflex, _urgency} = Reflex.sense(mind.reflex, {:sonar, readings.sonar}, at_ms)
    {twist, _limits, reflex} = reflex |> Reflex.wish(wish, at_ms) |> Reflex.step(at_ms)
    minds = Map.put(s.minds, id, %{mind | reflex: reflex, avoid: avoid})
    %{s | world: World.drive(s.world, id, twist), minds: minds, random: random}
  end

  defp aim(%{goal: goal, avoid: avoid} = mind, goal) when avoid != nil, do: mind

  defp aim(%{beside: {dx, dy}} = mind, {x, y} = goal) do
    inner = Goto.new(x: x + dx, y: y + dy)
    %{mind | goal: goal, avoid: Avoid.new(inner: inner, unmapped: true)}
  end

  defp peer(s, id, at_ms) do
    %{
      pose: believed(s, id),
      twist: Map.new(World.readings(s.world, id)).odometry.twist,
      radius: s.minds[id].profile.radius,
      at_ms: at_ms,
      mode: :moving
    }
  end

  defp believed(s, id) do
    {dx, dy} = s.minds[id].beside
    pose = World.truth(s.world, id)
    %{pose | x: pose.x + dx, y: pose.y + dy}
  end

  # Another place once it is there, and now and then before.
  defp goal(goal, pose, random) do
    {chance, random} = :rand.uniform_s(random)

    if chance < 0.005 or Pose.distance(pose, goal) < 0.4 do
      {x, random} = :rand.uniform_s(random)
      {y, random} = :rand.uniform_s(random)
      {{6 * x - 3, 6 * y - 3}, random}
    else
      {goal, random}
    end
  end

  test "robots that are not where they believe to be do not touch" do
    assert {0, speed} = run(1, 60)
    assert speed > 0.05
  end

  @tag :long
  @tag timeout: 1_800_000
  test "so it is over many seeds" do
    for seed <- 1..12 do
      {collisions, speed} = run(seed, 400)

      if System.get_env("FIGURES"),
        do: IO.puts("seed #{seed}: #{collisions} touches, #{Float.round(speed, 3)} m/s")

      assert collisions == 0
    end
  end
end
