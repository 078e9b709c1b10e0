defmodule Sim.World.ObjectTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Twist}
  alias Sim.{Floorplan, World}
  alias Sim.World.{Bodies, Object, Pushing, Snapshot}

  doctest Object

  defp world(poses, objects, options \\ []) do
    {:ok, map} = Floorplan.open("hall", 6)

    robots =
      for {pose, k} <- Enum.with_index(poses, 1),
          do: %{id: :"mag#{k}", profile: Profile.magellan(), pose: pose}

    World.new!([map: map, robots: robots, objects: objects, seed: 3] ++ options)
  end

  defp ball(x, y), do: Object.new!(id: "ball1", kind: :ball, pose: Pose.new(x, y))

  defp box(x, y, heading),
    do: Object.new!(id: "box1", kind: :box, pose: Pose.new(x, y, heading))

  defp steps(world, count), do: Enum.reduce(1..count, world, fn _, world -> World.step(world) end)

  defp drive(world, id, speed, turn \\ 0.0),
    do: World.drive(world, id, %Twist{linear: speed, turn: turn})

  # What must hold after each step.
  defp whole(world, count) do
    Enum.reduce(1..count, world, fn _, world ->
      world = World.step(world)

      for object <- world.objects do
        assert Object.free?(object, world.map)

        for body <- Bodies.all(world),
            do: assert(elem(Object.gap(object, Bodies.disc(body)), 0) > -1.0e-5)
      end

      world
    end)
  end

  defp roll(world, velocity),
    do: %{world | objects: Enum.map(world.objects, &%{&1 | velocity: velocity})}

  test "a ball rolls until friction has stopped it" do
    world = [Pose.new(-3, 0)] |> world([ball(0, 0)]) |> roll({0.6, 0.0}) |> steps(100)
    assert [%{velocity: {vx, vy}, pose: pose}] = world.objects
    assert {vx, vy} == {0.0, 0.0}
    # v^2 / 2a
    assert_in_delta pose.x, 0.9, 0.05
    assert pose.y == 0.0
  end

  test "a ball bounces from walls, from the landmark and from a robot, slower than before" do
    for {start, velocity} <- [
          {{8.4, 0.3}, {1.0, 0.2}},
          {{-1.6, 0.0}, {1.0, 0.0}},
          {{-4.4, 0.0}, {-1.0, 0.0}}
        ] do
      world =
        world([Pose.new(-5.0, 0)], [ball(elem(start, 0), elem(start, 1))], landmark: {-1, 0})

      world = world |> roll(velocity) |> whole(12)
      assert [%{velocity: {vx, _vy}}] = world.objects
      assert vx * elem(velocity, 0) < 0
      assert abs(vx) < 0.6
    end
  end

  test "a robot pushes a ball before it, feels nothing, and collides with nothing" do
    world = [Pose.new(-1, 0)] |> world([ball(0, 0.03)], noise: :off) |> drive(:mag1, 0.3)
    alone = [Pose.new(-1, 0)] |> world([], noise: :off) |> drive(:mag1, 0.3)
    {world, alone} = {whole(world, 100), whole(alone, 100)}
    assert [%{pose: %{x: x}}] = world.objects
    assert x > 0.5
    assert World.truth(world, :mag1) == World.truth(alone, :mag1)
    assert World.readings(world, :mag1) == World.readings(alone, :mag1)
    assert world.collisions == 0
  end

  test "a ball between a robot and a wall slips aside or stops the robot, and is never in either" do
    for y <- [0.0, 0.02, 0.1, 0.2] do
      world = [Pose.new(8.0, 0)] |> world([ball(8.6, y)], noise: :off) |> drive(:mag1, 0.5)
      world = whole(world, 120)
      assert World.truth(world, :mag1).x < 9.0 - 0.2
    end
  end

  test "a box pushed at its middle goes straight, and one pushed at its end turns" do
    straight = [Pose.new(-1, 0)] |> world([box(0, 0, :math.pi() / 2)], noise: :off)
    straight = straight |> drive(:mag1, 0.2) |> whole(150)
    assert [%{pose: pose}] = straight.objects
    assert pose.x > 0.3
    assert_in_delta pose.y, 0.0, 1.0e-6
    assert_in_delta pose.heading, :math.pi() / 2, 1.0e-6

    turned = [Pose.new(-1, 0.45)] |> world([box(0, 0, :math.pi() / 2)], noise: :off)
    turned = turned |> drive(:mag1, 0.2) |> whole(110)
    assert [%{pose: pose}] = turned.objects
    assert pose.heading < :math.pi() / 2 - 0.2
    assert pose.x > 0.03

    # It does not slide on.
    stands = turned |> drive(:mag1, 0.0) |> steps(60)
    assert steps(stands, 20).objects == stands.objects
  end

  test "two robots push a box further than its ends let one push it" do
    poses = [Pose.new(-1, 0.4), Pose.new(-1, -0.4)]
    world = world(poses, [box(0, 0, :math.pi() / 2)], noise: :off)
    world = world |> drive(:mag1, 0.2) |> drive(:mag2, 0.2) |> whole(200)
    assert [%{pose: pose}] = world.objects
    assert pose.x > 0.6
    assert_in_delta pose.heading, :math.pi() / 2, 0.02
  end

  test "a box at a wall, at the landmark or before another robot stops the robot that pushes it" do
    wall = [Pose.new(7.5, 0)] |> world([box(8.5, 0, :math.pi() / 2)], noise: :off)
    assert_in_delta x(wall |> drive(:mag1, 0.3) |> whole(200)), 8.8, 0.03

    pole =
      [Pose.new(-1, 0)] |> world([box(0, 0, :math.pi() / 2)], noise: :off, landmark: {0.5, 0})

    assert_in_delta x(pole |> drive(:mag1, 0.3) |> whole(200)), 0.15, 0.03

    poses = [Pose.new(-1, 0), Pose.new(1, 0)]
    robot = world(poses, [box(0, 0, :math.pi() / 2)], noise: :off)
    robot = robot |> drive(:mag1, 0.3) |> whole(200)
    assert World.truth(robot, :mag2) == Pose.new(1, 0)
    assert robot.collisions == 0
  end

  defp x(%{objects: [%{pose: pose}]}), do: pose.x

  test "cameras see a ball and a box by geometry and in painted pictures, each in its colour" do
    for {object, colour} <- [
          {ball(1.5, 0.2), "OrangeBall"},
          {box(1.8, -0.1, 1.2), "BlueBox"},
          {box(2.0, 0.1, 0.3), "BlueBox"}
        ] do
      world = world([Pose.new(0, 0)], [object], noise: :off)
      {:ok, painted} = Vision.blobs(World.frame(world, :mag1), World.colours())
      assert [%{colour: ^colour} = seen] = painted
      assert [%{colour: ^colour} = direct] = World.blobs(world, :mag1)
      assert_in_delta direct.area, seen.area, 0.05 * seen.area
      assert_in_delta direct.x, seen.x, 1.5
      assert_in_delta direct.bottom, seen.bottom, 1
    end
  end

  test "an object at rest is where a camera's view and a snapshot say it is" do
    begun = world([Pose.new(-1, 0), Pose.new(-3, 1)], [ball(0, 0), box(2, 2, 0)])
    world = begun |> drive(:mag1, 0.3) |> steps(80)
    assert Snapshot.onto(begun, Snapshot.of(world)).objects == world.objects
    ground = World.CameraView.ground(begun, :mag2)
    moving = World.CameraView.moving(world, World.CameraView.poses(world), :mag2)
    assert World.CameraView.world(ground, moving, :mag2).objects == world.objects
  end

  test "objects are put where there is room, and nowhere else" do
    world = world([Pose.new(-1, 0)], [ball(0, 0), box(2, 2, 0)])

    assert {:ok, %{objects: [%{pose: pose}, _box]}} =
             Pushing.place(world, "ball1", Pose.new(1, 1))

    assert pose == Pose.new(1, 1)

    for place <- [Pose.new(-1, 0.2), Pose.new(2.3, 2), Pose.new(8.95, 0)],
        do: assert({:error, "ball1 cannot" <> _} = Pushing.place(world, "ball1", place))

    assert Pushing.place(world, "ball9", Pose.new(1, 1)) == {:error, "there is no ball9"}
  end
end
