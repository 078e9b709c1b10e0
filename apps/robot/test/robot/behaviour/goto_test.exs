defmodule Robot.Behaviour.GotoTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Twist}
  alias Robot.Body
  alias Robot.Behaviour.{Blocker, Goto, Patience}
  alias Robot.Control.Controller
  alias Nav.{Grid, Reach}
  doctest Patience
  doctest Reach
  doctest Blocker

  # 6 x 4 m in cells of 0.1 m, with a wall at x from 3.0 to 3.2, and a door in it or none.
  defp grid(door) do
    cells =
      for j <- 0..39, i <- 0..59, into: <<>> do
        edge? = i in [0, 59] or j in [0, 39]
        if edge? or (i in 30..31 and (door == :closed or j not in door)), do: <<1>>, else: <<0>>
      end

    Grid.new(cells, {60, 40}, 0.1, {0.0, 0.0})
  end

  defp sent({x, y}) do
    body = Body.new(Pose.new(1.0, 2.0))
    %{body | controller: Controller.goal(body.controller, 1, {Goto, x: x, y: y})}
  end

  defp knowing(grid), do: &%{&1 | grid: grid}

  defp peer(at),
    do: %{pose: at, twist: Twist.zero(), radius: 0.2, at_ms: 0, mode: :holding}

  test "a goal in a wall, outside, or behind one without a door is given up at once" do
    for {goal, grid} <- [
          {{3.1, 2.0}, grid(10..20)},
          {{9.0, 2.0}, grid(10..20)},
          {{0.15, 2.0}, grid(10..20)},
          {{5.0, 2.0}, grid(:closed)}
        ] do
      assert {{1, 0}, %{at_ms: at_ms}} = goal |> sent() |> Body.run(50, knowing(grid))
      assert at_ms <= 300
    end

    assert {{1, 1}, body} = {5.0, 2.0} |> sent() |> Body.run(300, knowing(grid(10..20)))
    assert Pose.distance(body.pose, {5.0, 2.0}) < 0.12
  end

  test "a plan that is replaced by one without a way ends it within a second" do
    {nil, body} = {5.0, 2.0} |> sent() |> Body.run(20, knowing(grid(10..20)))
    begun = body.at_ms
    assert {{1, 0}, body} = Body.run(body, 50, knowing(grid(:closed)))
    assert body.at_ms - begun <= 1_000
  end

  test "walls that sonars have seen end it when they have had no gap for 5 s, and within 2 s of that" do
    seen =
      &fn percept ->
        %{percept | grid: %{grid(&1) | closed?: false}, pose: Pose.new(1.0, 2.0)}
      end

    {nil, body} = {5.0, 2.0} |> sent() |> Body.run(10, seen.(10..20))
    # Somebody passes the door; and a gap that is too narrow is one, as sonars draw doors.
    {nil, body} = Body.run(body, 30, seen.(:closed))
    {nil, body} = Body.run(body, 30, seen.(18..21))
    assert {{1, 0}, ended} = Body.run(body, 75, seen.(:closed))
    assert (ended.at_ms - body.at_ms) in 5_000..7_000
  end

  test "what stands in the only door ends it after 15 s without progress, with or without a plan" do
    for grid <- [grid(17..23), nil] do
      # A body that fills the door.
      stands = fn percept ->
        peers = %{mag2: %{peer(Pose.new(3.1, 2.05)) | radius: 0.4, at_ms: percept.at_ms}}
        %{percept | grid: grid, peers: peers}
      end

      # Without a plan nothing says that there is no way round it but the walls that are not drawn here.
      goal = if grid, do: {5.0, 2.0}, else: {3.1, 2.05}
      assert {{1, 2}, body} = goal |> sent() |> Body.run(600, stands)
      assert body.at_ms in 15_000..30_000
      assert Blocker.find(stands.(Body.percept(body)), {3.1, 2.05}) == {:robot, :mag2}
      assert body.twist.linear < 0.3
    end
  end

  test "a robot that turns slowly to its heading has the time for it, and one that cannot ends" do
    slow = %{Profile.magellan() | max_turn: 0.05}
    body = Body.new(Pose.new(0, 0), slow)
    goal = {Goto, x: 0.0, y: 0.0, heading: 3.0}
    body = %{body | controller: Controller.goal(body.controller, 1, goal)}
    assert {{1, 1}, %{at_ms: at_ms}} = Body.run(body, 900)
    assert at_ms > 50_000

    body = sent({1.0, 2.0})
    goal = {Goto, x: 1.0, y: 2.0, heading: 3.0}
    body = %{body | controller: Controller.goal(body.controller, 2, goal)}
    held = &%{&1 | pose: Pose.new(1.0, 2.0)}
    assert {{2, 2}, %{at_ms: at_ms}} = Body.run(body, 300, held)
    assert at_ms in 15_000..16_000
  end

  test "time in which a robot was frozen is not time without progress; ways that close end it, too" do
    patience = Patience.note(nil, 5.0, 0)
    refute patience |> Patience.note(5.0, 60_000) |> Patience.late?(1.0)

    # Each second another way, longer than the last.
    late = Enum.reduce(1..60, patience, fn s, p -> Patience.note(p, 5.0 + 2.0 * s, 1_000 * s) end)

    assert Patience.late?(late, 1.0)
  end

  test "a sequence hands on what it is told of the way" do
    steps = [steps: [Goto.new(x: 1.0, y: 0.0), Goto.new(x: 2.0, y: 0.0)]]
    percept = Body.percept(Body.new(Pose.new(0, 0)))

    assert {_, %{steps: [{Goto, %{way?: false}}, {Goto, %{way?: true}}]}} =
             steps |> Robot.Behaviour.Sequence.new() |> Robot.Behaviour.routed(:no_way, percept)
  end

  test "an echo of a wall that the map shows is nothing unknown" do
    body = Body.new(Pose.new(2.5, 2.0))
    ahead = Enum.find_index(body.profile.sonars, &(abs(&1.heading) < 0.2))
    near = List.replace_at(Body.silence(body.profile), ahead, 0.3)
    percept = %{Body.percept(body) | sonar: near}
    assert Blocker.find(percept, {5.0, 2.0}) == :unknown
    assert Blocker.find(%{percept | grid: grid(:closed)}, {5.0, 2.0}) == :no_way
  end
end
