defmodule Sim.WorldTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Twist}
  alias Sim.{Floorplan, World}
  alias Sim.World.Contact

  defp hall(fleet \\ 6) do
    {:ok, map} = Floorplan.open("hall", fleet)
    map
  end

  defp robot(id, x, y, heading \\ 0.0),
    do: %{id: id, profile: Profile.magellan(), pose: Pose.new(x, y, heading)}

  defp world(robots, options \\ []),
    do: World.new!(Keyword.merge([map: hall(), robots: robots, noise: :off, seed: 1], options))

  defp steps(world, n), do: Enum.reduce(1..n//1, world, fn _, world -> World.step(world) end)
  defp reading(world, id, key), do: world |> World.readings(id) |> Keyword.fetch!(key)

  # At every step, every body is outside every wall and every other body.
  defp outside!(world) do
    bodies = Enum.map(world.order, &world.robots[&1])

    discs =
      for body <- bodies do
        assert Floorplan.free?(world.map, Pose.point(body.pose), body.profile.radius)
        {body.pose.x, body.pose.y, body.profile.radius}
      end

    pole = for {x, y} <- List.wrap(world.landmark), do: {x, y, 0.15}

    for {a, i} <- Enum.with_index(discs),
        b <- Enum.drop(discs, i + 1) ++ pole,
        do: assert(Contact.gap(a, b) >= 0.0)

    world
  end

  defp wander(world, n, draw) do
    Enum.reduce(1..n, world, fn step, world ->
      world =
        if rem(step, 20) == 1,
          do: Enum.reduce(world.order, world, &World.drive(&2, &1, draw.())),
          else: world

      world |> World.step() |> outside!()
    end)
  end

  test "a robot drives as fast as its limits allow, and its wheels know where it is" do
    world = world([robot(:mag1, 0, 0)]) |> World.drive(:mag1, Twist.new(2.0, 0.0)) |> steps(40)
    truth = World.truth(world, :mag1)
    odometry = reading(world, :mag1, :odometry)
    assert odometry.pose == truth
    assert_in_delta odometry.twist.linear, 0.5, 0.001
    # 2 s at 0.5 m/s, minus the second of acceleration and the lag.
    assert_in_delta truth.x, 0.70, 0.03
    world = world |> World.drive(:mag1, Twist.zero()) |> steps(60)
    assert World.truth(world, :mag1) == World.truth(steps(world, 20), :mag1)
  end

  test "a robot turns left on the spot" do
    world = world([robot(:mag1, 0, 0)]) |> World.drive(:mag1, Twist.new(0.0, 1.0)) |> steps(20)
    assert World.truth(world, :mag1).heading > 0.3
    assert Pose.point(World.truth(world, :mag1)) == {0.0, 0.0}
  end

  test "a robot stops at a wall, presses the bumper in front, and counts one collision" do
    world = world([robot(:mag1, 8, 0)]) |> World.drive(:mag1, Twist.new(0.5, 0.0)) |> steps(100)
    assert_in_delta World.truth(world, :mag1).x, 8.8, 0.001
    assert reading(world, :mag1, :bumpers) == [0]
    assert world.collisions == 1
    assert steps(world, 50).collisions == 1
    away = world |> World.drive(:mag1, Twist.new(-0.5, 0.0)) |> steps(40)
    assert reading(away, :mag1, :bumpers) == []
    again = away |> World.drive(:mag1, Twist.new(0.5, 0.0)) |> steps(100)
    assert again.collisions == 2
  end

  test "a robot stops at another one, dead or alive; the least gap is recorded" do
    world =
      world([robot(:mag1, 0, 0), robot(:mag2, 1, 0)])
      |> World.kill(:mag2)
      |> World.drive(:mag1, Twist.new(0.5, 0.0))
      |> World.drive(:mag2, Twist.new(-0.5, 0.0))
      |> steps(100)

    assert world.collisions == 1
    assert_in_delta World.truth(world, :mag1).x, 0.6, 0.001
    assert World.truth(world, :mag2).x == 1.0
    assert world.min_separation >= 0.0 and world.min_separation < 0.001
    assert World.readings(world, :mag2) == []
    assert reading(world, :mag1, :bumpers) == [0]
  end

  test "the landmark is solid, and touching it is not a collision" do
    world =
      world([robot(:mag1, 0, 0)], landmark: {1.0, 0.0})
      |> World.drive(:mag1, Twist.new(0.5, 0.0))
      |> steps(100)

    assert_in_delta World.truth(world, :mag1).x, 0.65, 0.001
    assert world.collisions == 0
    assert reading(world, :mag1, :bumpers) == [0]
  end

  test "the sonar sees walls, robots and the landmark" do
    world = world([robot(:mag1, 5, 0), robot(:mag2, 5, 2)], landmark: {3.0, 0.0})
    sonar = reading(world, :mag1, :sonar)
    assert length(sonar) == 16
    # Sensor 11 looks ahead, 7 to the left, 3 back; sensors are on the edge of the body.
    assert_in_delta Enum.at(sonar, 11), 3.8, 0.001
    assert_in_delta Enum.at(sonar, 7), 1.6, 0.001
    assert_in_delta Enum.at(sonar, 3), 1.65, 0.001
    assert Enum.at(sonar, 15) == 5.1
  end

  test "a lidar sees all around at the end of each of its turns" do
    scan = %{Profile.scan() | period: 0.2, max: 3.5, pose: Pose.new(0.1, 0)}
    body = %{Profile.magellan() | sonars: [], scan: scan}

    world =
      World.new!(
        map: hall(2),
        robots: [
          %{id: :a, profile: body, pose: Pose.new(0, 0, 0)},
          %{id: :b, profile: Profile.magellan(), pose: Pose.new(0, 1.5)}
        ],
        noise: :off
      )

    scans = fn world -> for {:scan, scan} <- World.readings(world, :a), do: scan end
    assert [%Hal.Scan{ranges: ranges, start: start, step: step}] = scans.(world)
    assert byte_size(ranges) == 720
    refute List.keymember?(World.readings(world, :a), :sonar, 0)

    # The other robot is to the left, and 10 cm behind the lidar.
    {direction, nearest} =
      %Hal.Scan{ranges: ranges, start: start, step: step}
      |> Hal.Scan.echoes(3.5)
      |> Enum.min_by(&elem(&1, 1))

    assert_in_delta direction, :math.atan2(1.5, -0.1), 0.02
    assert_in_delta nearest, :math.sqrt(1.5 * 1.5 + 0.01) - 0.2, 0.002

    turns =
      for k <- 1..12, reduce: {world, []} do
        {world, turns} ->
          world = World.step(world, 50)
          {world, if(scans.(world) == [], do: turns, else: [50 * k | turns])}
      end

    assert elem(turns, 1) == [600, 400, 200]
  end

  test "the camera pans at its rate and its picture knows where it looked" do
    world =
      world([robot(:mag1, 0, 0)], landmark: {0.0, 3.0})
      |> World.look(:mag1, 3.0, 0.0)
      |> steps(10)

    assert_in_delta reading(world, :mag1, :ptz).pan, 0.698, 0.001
    assert_in_delta reading(steps(world, 30), :mag1, :ptz).pan, 1.745, 0.001
    assert World.blobs(world([robot(:mag1, 0, 0)], landmark: {0.0, 3.0}), :mag1) == []
    assert [%{colour: "YellowLandmark"}] = World.blobs(steps(world, 30), :mag1)
  end

  test "the landmark's blob is where the landmark is, a nearer robot hides its foot" do
    alone = world([robot(:mag1, 0, 0)], landmark: {4.0, 0.5})
    assert [blob] = World.blobs(alone, :mag1)
    assert_in_delta blob.distance, 4.0, 0.4
    focal = 160 / :math.tan(:math.pi() / 6)
    assert_in_delta :math.atan((159.5 - blob.x) / focal), :math.atan(0.5 / 4), 0.01
    hidden = world([robot(:mag1, 0, 0), robot(:mag2, 2, 0.25)], landmark: {4.0, 0.5})
    assert [behind, %{colour: "RedRobot"}] = World.blobs(hidden, :mag1)
    assert behind.area < 0.7 * blob.area
    assert behind.top == blob.top and behind.bottom < blob.bottom
  end

  test "the landmark glides, waits in front of a robot, and goes on" do
    world = world([robot(:mag1, 0, 0)], landmark: {-2.0, 0.0}) |> World.move_landmark({2.0, 0.0})
    assert_in_delta elem(steps(world, 20).landmark, 0), -1.7, 1.0e-6
    world = steps(world, 200)
    assert_in_delta elem(world.landmark, 0), -0.85, 0.02
    world = world |> World.displace(:mag1, Pose.new(0, 3)) |> steps(300)
    assert world.landmark == {2.0, 0.0}
  end

  test "noise is 0.3 % by default, and with slip a turn goes wrong as in R74" do
    far = fn noise ->
      world([robot(:mag1, 0, 0)], noise: noise)
      |> World.drive(:mag1, Twist.new(0.5, 0.0))
      |> steps(200)
    end

    world = far.(:default)
    way = reading(world, :mag1, :odometry).pose.x / World.truth(world, :mag1).x
    assert abs(way - 1) > 0.001 and abs(way - 1) < 0.005

    offsets =
      for seed <- 1..20 do
        world =
          Enum.reduce([1.0, -1.0], world([robot(:mag1, 0, 0)], noise: :slip, seed: seed), fn side,
                                                                                             world ->
            goal = reading(world, :mag1, :odometry).pose.heading + side * :math.pi() / 2
            turn(world, goal)
          end)

        odometry = reading(world, :mag1, :odometry).pose.heading
        (World.truth(world, :mag1).heading - odometry) * 180 / :math.pi()
      end

    assert_in_delta Enum.sum(offsets) / 20, 10.0, 1.0
  end

  defp turn(world, goal) do
    left = goal - reading(world, :mag1, :odometry).pose.heading

    if abs(left) < 0.002,
      do: world |> World.drive(:mag1, Twist.zero()) |> steps(20),
      else: world |> World.drive(:mag1, Twist.new(0.0, left)) |> World.step() |> turn(goal)
  end

  test "robots are never inside a wall or another body, however wildly they drive" do
    for seed <- 1..3 do
      landmark = {0.0, 0.0}
      robots = for k <- 1..6, do: {:"mag#{k}", 0.2}
      {:ok, poses} = Floorplan.starts(hall(2), robots, seed, landmark)

      world =
        World.new!(
          map: hall(2),
          seed: seed,
          noise: :slip,
          landmark: landmark,
          robots:
            for(
              {{id, _}, pose} <- Enum.zip(robots, poses),
              do: %{id: id, profile: Profile.atrv_mini(), pose: pose}
            )
        )

      draw = fn -> Twist.new(:rand.uniform() * 1.4 - 0.4, :rand.uniform() * 4 - 2) end
      wander(outside!(world), 500, draw)
    end
  end

  test "robots are never inside the walls of a hospital, nor jump through them" do
    {:ok, map} = Floorplan.open("hospital", 1)
    # In the corridors and doors, where walls are near.
    poses = for k <- 0..5, do: Pose.new(9.5, k * 2.0 - 5.0, k)

    robots =
      for {pose, k} <- Enum.with_index(poses),
          do: %{
            id: :"min#{k}",
            profile: %{Profile.atrv_mini() | max_linear: 2.0, max_acceleration: 4.0},
            pose: pose
          }

    world = World.new!(map: map, robots: robots, seed: 2)
    draw = fn -> Twist.new(:rand.uniform() * 3.0 - 1.0, :rand.uniform() * 1.6 - 0.8) end
    world = wander(outside!(world), 1_000, draw)
    assert world.collisions > 5
  end

  test "no robot jumps through a thin wall, however fast it is" do
    {:ok, map} = Floorplan.open("hospital", 1)

    fast = %{
      Profile.magellan()
      | radius: 0.05,
        max_linear: 30.0,
        max_acceleration: 300.0,
        sonars: []
    }

    world =
      World.new!(
        map: map,
        robots: [%{id: :mag1, profile: fast, pose: Pose.new(0, 3)}],
        noise: :off
      )

    world =
      Enum.reduce(1..100, World.drive(world, :mag1, Twist.new(30.0, 0.0)), fn _, w ->
        w |> World.step(100) |> outside!()
      end)

    assert_in_delta World.truth(world, :mag1).x, 7.95, 0.001
  end

  test "bodies put into each other come apart again" do
    world =
      world([robot(:mag1, 0, 0), robot(:mag2, 0.3, 0)])
      |> World.drive(:mag1, Twist.new(0.3, 0.0))
      |> steps(20)

    assert World.truth(world, :mag1).x == 0.0
    away = world |> World.drive(:mag1, Twist.new(-0.3, 0.0)) |> steps(60)
    assert World.truth(away, :mag1).x < -0.3
    assert away.collisions == 1
  end

  test "the same seed gives the same world" do
    run = fn seed ->
      world([robot(:mag1, 0, 0), robot(:mag2, 2, 1)], noise: :slip, seed: seed)
      |> World.drive(:mag1, Twist.new(0.4, 0.3))
      |> steps(50)
    end

    assert run.(7) == run.(7)
    refute run.(7) == run.(8)
  end

  test "wrong options are named" do
    assert_raise ArgumentError,
                 ~r/option noise: expected :off, :default or :slip, got :loud/,
                 fn -> world([], noise: :loud) end

    assert_raise ArgumentError, ~r/there is a wall/, fn ->
      World.displace(world([robot(:mag1, 0, 0)]), :mag1, Pose.new(50, 0))
    end
  end
end
