defmodule Robot.Behaviour.AvoidTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Twist}
  alias Robot.Body
  alias Nav.{Orca, PathPlanner}
  alias Robot.Behaviour.{Avoid, Follow, Goto, Move}
  doctest Nav.Orca
  doctest Nav.PathPlanner

  defp any(size), do: {size * (2 * :rand.uniform() - 1), size * (2 * :rand.uniform() - 1)}

  describe "Orca" do
    test "a velocity that a plane allows leads to no contact within the horizon" do
      for _ <- 1..2000 do
        {to, own, other, wished} = {any(4.0), any(0.5), any(0.5), any(0.5)}
        radius = 0.3 + 0.4 * :rand.uniform()
        distance = Pose.distance({0.0, 0.0}, to)

        if distance > radius + 0.05 do
          plane = Orca.half_plane({0.0, 0.0}, own, to, other, radius, 2.0, 1.0)
          {vx, vy} = velocity = Orca.solve([plane], wished, 2.0)
          {ox, oy} = other
          {px, py} = to

          for k <- 0..40 do
            t = k * 0.05
            at = {px + (ox - vx) * t, py + (oy - vy) * t}

            assert Pose.distance({0.0, 0.0}, at) > radius - 0.01,
                   inspect({to, own, other, velocity})
          end
        end
      end
    end

    test "the solution is the best of a grid of velocities" do
      for _ <- 1..150 do
        planes =
          for _ <- 1..:rand.uniform(6) do
            angle = 6.3 * :rand.uniform()
            {{:math.cos(angle), :math.sin(angle)}, 0.4 * :rand.uniform() - 0.35}
          end

        wished = any(0.5)
        solved = Orca.solve(planes, wished, 0.5)
        assert Pose.distance({0.0, 0.0}, solved) < 0.5 + 1.0e-6

        worst = fn {x, y} ->
          planes |> Enum.map(fn {{nx, ny}, o} -> o - nx * x - ny * y end) |> Enum.max()
        end

        grid =
          for i <- -25..25,
              j <- -25..25,
              v = {i / 50, j / 50},
              Pose.distance({0.0, 0.0}, v) <= 0.5,
              do: v

        case Enum.filter(grid, &(worst.(&1) <= 0)) do
          [] ->
            assert worst.(solved) <= (grid |> Enum.map(worst) |> Enum.min()) + 0.001

          allowed ->
            assert worst.(solved) < 1.0e-6
            best = allowed |> Enum.map(&Pose.distance(&1, wished)) |> Enum.min()
            assert Pose.distance(solved, wished) <= best + 1.0e-6
        end
      end
    end

    test "those who overlap part" do
      plane = Orca.half_plane({0.0, 0.0}, {0.0, 0.0}, {0.3, 0.0}, {0.0, 0.0}, 0.5, 2.0, 0.5)
      {vx, _} = Orca.solve([plane], {0.0, 0.0}, 0.5)
      assert vx < -0.1
    end
  end

  describe "Detour" do
    test "round one disc it is nearly the shortest way" do
      for _ <- 1..300 do
        {from, to} = {{-3.0, elem(any(1.0), 0)}, {3.0, elem(any(1.0), 0)}}
        {x, y} = any(0.8)
        way = PathPlanner.way(from, to, [{x, y, 0.6}])
        assert length_of(from, way) < 1.03 * shortest(from, to, {x, y, 0.6})
      end
    end

    test "any way it gives is free, and it finds one wherever discs leave room" do
      for _ <- 1..200 do
        discs = for _ <- 1..20, {x, y} = any(3.0), do: {x, y, 0.35}
        way = PathPlanner.way({-4.0, 0.0}, {4.0, 0.3}, discs)
        assert way != nil
        assert List.last(way) == {4.0, 0.3}

        Enum.reduce(way, {-4.0, 0.0}, fn place, from ->
          assert PathPlanner.blocker(from, place, discs) == nil
          place
        end)
      end
    end

    test "where there is no way it says so" do
      ring = for k <- 0..15, do: {2 * :math.cos(k * 0.3927), 2 * :math.sin(k * 0.3927), 0.45}
      assert PathPlanner.way({0.0, 0.0}, {5.0, 0.0}, ring) == nil
    end
  end

  defp length_of(from, way) do
    {length, _} = Enum.reduce(way, {0.0, from}, fn p, {l, a} -> {l + Pose.distance(a, p), p} end)
    length
  end

  # Two tangents and the arc between, on the better side; the straight line where it is free.
  defp shortest(from, to, {x, y, r} = disc) do
    if PathPlanner.blocker(from, to, [disc]) do
      {a, b} = {Pose.distance(from, {x, y}), Pose.distance(to, {x, y})}
      angle = fn {px, py} -> :math.atan2(py - y, px - x) end
      between = abs(Pose.wrap(angle.(from) - angle.(to)))
      arc = between - :math.acos(r / a) - :math.acos(r / b)
      :math.sqrt(a * a - r * r) + :math.sqrt(b * b - r * r) + r * max(arc, 0.0)
    else
      Pose.distance(from, to)
    end
  end

  defp peer(pose, linear \\ 0.0, mode \\ :moving),
    do: %{pose: pose, twist: Twist.new(linear, 0), radius: 0.2, at_ms: 0, mode: mode}

  describe "Avoid" do
    defp tick(inner, pose, change \\ & &1, discs \\ []) do
      percept = pose |> Body.new() |> Body.percept() |> change.()
      {:running, wish, _} = Robot.Behaviour.tick(Avoid.new(inner: inner, discs: discs), percept)
      wish
    end

    test "with nobody about, or nobody in the way, a wish stays as it is" do
      for _ <- 1..100 do
        {x, y} = any(3.0)
        pose = Pose.new(x, y, 6.3 * :rand.uniform())
        inner = Follow.new(target: Pose.new(1, 1))
        {:running, alone, _} = Robot.Behaviour.tick(inner, Body.percept(Body.new(pose)))
        assert tick(inner, pose) == alone
        far = &%{&1 | peers: %{a: peer(Pose.new(20, 20))}}
        assert tick(inner, pose, far) == alone
      end
    end

    test "without a velocity to bend it slows down and stops" do
      move = Move.new(linear: 0.5, turn: 0.0)
      ahead = fn x -> &%{&1 | peers: %{a: peer(Pose.new(x, 0), 0.0, :holding)}} end
      assert tick(move, Pose.new(0, 0), ahead.(2.0)).twist.linear == 0.5
      assert tick(move, Pose.new(0, 0), ahead.(0.46)).twist.linear == 0.0
      # Away from it, it may go.
      assert tick(move, Pose.new(0, 0, 3.14), ahead.(0.46)).twist.linear == 0.5
    end

    test "goes round a standing robot, a disc, and what only the sonars see" do
      goto = {Goto, x: 4.0, y: 0.0}

      changes = [
        {[], &%{&1 | peers: %{a: %{peer(Pose.new(2, 0.05), 0.0, :dead) | at_ms: &1.at_ms}}}},
        {[discs: [{2.0, 0.05, 0.2}]], & &1},
        {[], &%{&1 | sonar: echo(&1.pose, {2.0, 0.1}, 0.2)}}
      ]

      for {extra, change} <- changes do
        body = Body.new(Pose.new(0, 0))
        {module, options} = goto

        controller =
          Robot.Control.Controller.goal(body.controller, :go, {module, options ++ extra})

        {nearest, outcome} =
          Enum.reduce_while(1..400, {%{body | controller: controller}, 9.0}, fn _,
                                                                                {body, nearest} ->
            case Body.run(body, 1, change) do
              {nil, body} -> {:cont, {body, min(nearest, Pose.distance(body.pose, {2.0, 0.05}))}}
              {outcome, _} -> {:halt, {nearest, outcome}}
            end
          end)

        assert outcome == {:go, 1}
        assert nearest > 0.41
      end
    end
  end

  test "where a wreck stands in its place, a robot stands beside it and says so" do
    wreck = &%{&1 | peers: %{a: %{peer(Pose.new(3, 0), 0.0, :dead) | at_ms: &1.at_ms}}}

    for place <- [Pose.new(3, 0), Pose.new(3.2, 0.2)] do
      body = Body.new(Pose.new(0, 0.5, 2.0))
      controller = Robot.Control.Controller.goal(body.controller, :slot, {Follow, target: place})
      {nil, body} = Body.run(%{body | controller: controller}, 250, wreck)
      assert body.controller.last_by == :blocked
      assert Twist.zero?(body.twist)
      distance = Pose.distance(body.pose, {3.0, 0.0})
      assert distance > 0.42 and distance < 0.62
      # It goes in when the place becomes free.
      {nil, body} = Body.run(body, 100)
      assert Pose.distance(body.pose, place) < 0.05
    end
  end

  # What a ring of sonars sees of a disc.
  defp echo(pose, {cx, cy}, r) do
    for sonar <- Hal.Profile.magellan().sonars do
      at = Pose.compose(pose, sonar)
      {dx, dy} = {cx - at.x, cy - at.y}

      Enum.min(
        for turn <- [-0.2, 0.0, 0.2] do
          {c, s} = {:math.cos(at.heading + turn), :math.sin(at.heading + turn)}
          along = dx * c + dy * s
          off = dx * dx + dy * dy - along * along
          if along > 0 and off < r * r, do: along - :math.sqrt(r * r - off), else: 5.1
        end
      )
    end
  end
end
