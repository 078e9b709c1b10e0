defmodule Robot.Behaviour.Avoid.RouteWallsTest do
  @moduledoc "Routes of a robot that knows walls."
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Robot.Behaviour.Avoid.Route
  alias Nav.{Grid, PathPlanner}
  alias Robot.Percept

  # 8 x 6 m, a wall at x = 0 with a door from y = 1 to 2.2.
  defp grid do
    for j <- 0..59, i <- 0..79, into: <<>> do
      wall? = i in [39, 40] and j not in 40..51
      <<if(wall? or i in [0, 79] or j in [0, 59], do: 1, else: 0)>>
    end
    |> Grid.new({80, 60}, 0.1, {-4.0, -3.0})
  end

  defp percept(grid, pose, at_ms \\ 0),
    do: %Percept{robot: :mag1, at_ms: at_ms, profile: Profile.magellan(), pose: pose, grid: grid}

  defp corners(percept, goal, discs \\ [], old \\ nil),
    do: Route.round(old, goal, percept, [], discs).corners

  test "without walls, or with none between, the goal is the only corner" do
    pose = Pose.new(-2, -1)
    assert corners(percept(nil, pose), {2.0, -1.0}) == [{2.0, -1.0}]
    assert corners(percept(grid(), pose), {-2.0, 1.0}) == [{-2.0, 1.0}]
  end

  test "a goal behind a wall is reached through the door" do
    corners = corners(percept(grid(), Pose.new(-2, -1)), {2.0, -1.0})
    assert List.last(corners) == {2.0, -1.0}
    assert Enum.any?(corners, fn {x, y} -> abs(x) < 0.7 and y > 1.2 and y < 2.0 end)
  end

  test "a body in the room is passed; one that closes the door leaves the way through it" do
    pose = Pose.new(-2, -1)
    beside = corners(percept(grid(), pose), {2.0, -1.0}, [{-1.0, 0.4, 0.3}])

    for {a, b} <- Enum.zip([Pose.point(pose) | beside], beside),
        do: assert(PathPlanner.blocker(a, b, [{-1.0, 0.4, 0.45}]) == nil)

    assert [_, _ | _] = corners(percept(grid(), pose), {2.0, -1.0}, [{0.0, 1.6, 0.5}])
  end

  test "an old route is not kept through a wall that has become known" do
    pose = Pose.new(-2, -1)
    old = Route.round(nil, {2.0, -1.0}, percept(nil, pose), [], [])
    assert [_] = old.corners
    assert [_, _ | _] = corners(percept(grid(), pose, 100), {2.0, -1.0}, [], old)
  end

  test "a goal in a wall has a route up to it" do
    assert [_ | _] = corners(percept(grid(), Pose.new(-2, -1)), {0.0, -1.0})
  end

  test "a place in a body, or beyond what is known of walls, has a route round them" do
    pose = Pose.new(-2, -1)
    assert [_, _ | _] = corners(percept(grid(), pose), {2.0, -1.0}, [{2.0, -1.0, 0.2}])

    open = %{grid() | closed?: false}
    assert [_, _ | _] = beyond = corners(percept(open, pose), {14.0, -1.0})
    assert List.last(beyond) == {14.0, -1.0}
  end

  test "a place without a way is looked for again after 2 s, and found when there is one" do
    pose = Pose.new(-2, -1)

    closed =
      Grid.new(for(_ <- 0..59, i <- 0..79, into: <<>>, do: cell(i)), {80, 60}, 0.1, {-4, -3})

    route = Route.round(nil, {2.0, -1.0}, percept(closed, pose), [], [])
    assert %Route{way?: false, corners: [{2.0, -1.0}]} = route

    assert Route.round(route, {2.0, -1.0}, percept(grid(), pose, 1_000), [], []) == route
    later = Route.round(route, {2.0, -1.0}, percept(grid(), pose, 2_000), [], [])
    assert %Route{way?: true, corners: [_, _ | _]} = later
  end

  defp cell(i), do: if(i in [39, 40], do: <<1>>, else: <<0>>)
end
