defmodule Swarm.Formation.LadderTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Nav.Grid
  alias Swarm.Formation.{Ladder, Space}
  doctest Swarm.Formation.Ladder
  doctest Swarm.Formation.Space

  @radius 0.25

  # 12 x 12 m round the origin; walls are rectangles `{left, low, right, high}`.
  defp space(walls, bodies \\ []) do
    cells =
      for j <- 0..119, i <- 0..119, into: <<>> do
        {x, y} = {(i + 0.5) * 0.1 - 6, (j + 0.5) * 0.1 - 6}

        <<if(Enum.any?(walls, fn {l, b, r, t} -> x >= l and x < r and y >= b and y < t end),
            do: 1,
            else: 0
          )>>
      end

    %Space{radius: @radius, bodies: bodies, grid: Grid.new(cells, {120, 120}, 0.1, {-6.0, -6.0})}
  end

  # It looks along x, with the landmark 1.6 m ahead.
  defp here(pose \\ Pose.new(0, 0), trail \\ []), do: %{pose: pose, distance: 1.6, trail: trail}

  defp choose(asked, followers, here, space),
    do: Ladder.choose(Ladder.rungs(), asked, followers, here, space)

  defp poses(%{spots: [_ | _] = spots}, _here), do: spots

  defp poses(%{formation: formation, room: {size, places}}, here) do
    slots = Swarm.Formation.slots(formation, size, here.distance)
    for place <- places, do: Pose.compose(here.pose, Enum.at(slots, place - 1))
  end

  test "where there is room the shape is as asked" do
    for kind <- [:column, :line, :wedge, :triangle, :diamond, :circle] do
      assert %{rung: :asked, formation: {^kind, 1.0}, spots: nil} =
               choose({kind, 1.0}, 3, here(), space([]))
    end
  end

  test "a cluster has no place that no way leads to, and takes those where robots stand if there are too few" do
    # A room of 2.6 x 2 m, closed.
    walls = [
      {-2.1, -1.1, 0.7, -1.0},
      {-2.1, 1.0, 0.7, 1.1},
      {-2.1, -1.1, -2.0, 1.1},
      {0.6, -1.1, 0.7, 1.1}
    ]

    space = space(walls)
    inside? = &(&1.x > -2.0 and &1.x < 0.6 and abs(&1.y) < 1.0)
    cluster = &Ladder.choose([:cluster], {:column, 1.0}, &1, &2, space)

    %{spots: spots} = cluster.(1, here())
    assert Enum.all?(spots, inside?)
    assert cluster.(9, here()) == nil

    # Those beside others, and in a wall, are none.
    stand = [{3.0, 3.0}, {-3.0, 3.0}, {-3.0, 3.1}, {-1.0, 3.0}, {0.65, 0.0}]
    most = Enum.find(9..1//-1, &cluster.(&1, here()))
    assert %{rung: :cluster, spots: spots} = cluster.(most + 3, Map.put(here(), :stand, stand))
    assert spots |> Enum.reject(inside?) |> Enum.map(&Pose.point/1) |> length() == 3
    assert cluster.(most + 4, Map.put(here(), :stand, stand)) == nil
  end

  test "a wall behind the leader turns the column, by as little as it needs" do
    space = space([{-2.0, -6.0, -1.8, 1.0}])

    assert %{rung: :turned, formation: {:column, 1.0}, spots: spots} =
             choose({:column, 1.0}, 4, here(), space)

    {x, y} = Pose.point(List.last(spots))
    assert x < 0 and y > 1.0
    assert Enum.all?(spots, &(&1.heading == 0.0))
  end

  test "in a small room it comes closer, in a corridor it is a column along the way that the leader came" do
    # Open on the left only, for 3.4 m.
    niche = [{-6.0, -6.0, -0.6, 6.0}, {0.6, 1.5, 6.0, 6.0}, {-6.0, -6.0, 6.0, -0.6}]

    assert %{rung: :closer, formation: {:column, closer}} =
             choose({:column, 1.6}, 3, here(), space(niche ++ [{-6.0, 3.4, 6.0, 6.0}]))

    assert closer < 1.6

    # A corridor 1.2 m wide with a bend, and a leader at its end that looks at a wall.
    bent = [
      {-6.0, 0.6, 0.6, 6.0},
      {-6.0, -6.0, -0.6, -0.6},
      {0.6, -6.0, 6.0, 6.0},
      {-0.6, -6.0, 0.6, -4.0},
      {-6.0, -0.6, -5.0, 0.6}
    ]

    trail = for k <- 0..40, do: {-k * 0.1, 0.0}

    here =
      here(
        Pose.new(0.0, -2.6, -:math.pi() / 2),
        for(k <- 25..0//-1, do: {0.0, -k * 0.1}) ++ trail
      )

    assert %{rung: :column, spots: spots} = choose({:line, 1.0}, 4, here, space(bent))
    assert length(spots) == 4
    assert List.last(spots).x < -0.5
  end

  test "where nothing else fits they stand where there is room, and where there is none it says so" do
    cell = [
      {-6.0, -6.0, -1.4, 6.0},
      {1.4, -6.0, 6.0, 6.0},
      {-6.0, 1.4, 6.0, 6.0},
      {-6.0, -6.0, 6.0, -1.4}
    ]

    assert %{rung: :cluster, spots: [_, _, _]} =
             choose({:line, 2.0}, 3, here(Pose.new(0.9, 0.9)), space(cell))

    assert choose({:line, 2.0}, 19, here(Pose.new(0.9, 0.9)), space(cell)) == nil
  end

  test "in a corridor hardly wider than a robot they stand behind one another, wherever its leader looks" do
    corridor = [
      {-6.0, 0.5, 6.0, 6.0},
      {-6.0, -6.0, 6.0, -0.5},
      {-6.0, -0.5, -5.5, 0.5},
      {2.5, -0.5, 6.0, 0.5}
    ]

    for heading <- [0.4, 1.9, 2.8] do
      assert %{rung: :cluster, spots: spots} =
               choose({:line, 2.0}, 4, here(Pose.new(2.0, 0.0, heading)), space(corridor))

      xs = spots |> Enum.map(& &1.x) |> Enum.sort()
      for {a, b} <- Enum.zip(xs, tl(xs) ++ [2.0]), do: assert(b - a > 0.85)
    end
  end

  test "whatever is chosen in random rooms, all have room, apart, on the leader's side of the walls" do
    rungs =
      for _ <- 1..150 do
        walls =
          for _ <- 1..6 do
            {x, y} = {:rand.uniform() * 11 - 6, :rand.uniform() * 11 - 6}
            if :rand.uniform(2) == 1, do: {x, y, x + 0.2, y + 3.0}, else: {x, y, x + 3.0, y + 0.2}
          end

        space = space(walls, [{1.6, 0.0, 0.15}])
        kind = Enum.random([:column, :line, :wedge, :triangle, :diamond])
        followers = :rand.uniform(6)
        here = here()

        with true <- Space.free?(space, here.pose),
             %{} = choice <- choose({kind, Enum.random([1.0, 1.6])}, followers, here, space) do
          poses = poses(choice, here)
          assert length(poses) == followers
          for pose <- poses, do: assert(Space.free?(space, pose))

          for {a, k} <- Enum.with_index([here.pose | poses]), b <- Enum.drop(poses, k) do
            assert Pose.distance(a, b) >= 2 * @radius + 0.2
          end

          # A robot gets there, if not straight then round what stands between.
          for pose <- poses,
              do: assert(Grid.Way.find(space.grid, {0.0, 0.0}, Pose.point(pose), @radius) != nil)

          choice.rung
        end
      end

    for rung <- [:asked, :turned], do: assert(rung in rungs)
  end
end
