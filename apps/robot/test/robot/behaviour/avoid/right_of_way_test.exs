defmodule Robot.Behaviour.Avoid.RightOfWayTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile, Twist}
  alias Robot.Behaviour.Avoid.{Ahead, Neighbours, RightOfWay}
  alias Nav.{Grid, PassingPlace}
  alias Robot.Percept
  doctest Ahead
  doctest PassingPlace
  doctest RightOfWay

  # Two rooms of 4 m and between them a corridor 1 m by 6 m along x, its middle at the origin, with a niche of 1 m if asked for.
  defp grid(niche? \\ false) do
    cells =
      for j <- 0..49, i <- 0..139, into: <<>> do
        {x, y} = {(i + 0.5) * 0.1 - 7.0, (j + 0.5) * 0.1 - 2.5}

        free? =
          abs(x) > 3 or abs(y) < 0.5 or (niche? and abs(x - 1.5) < 0.5 and y > 0 and y < 1.5)

        if free?, do: <<0>>, else: <<1>>
      end

    Grid.new(cells, {140, 50}, 0.1, {-7.0, -2.5})
  end

  # What each of two robots at these x, the left one on its way to the right, knows of the other.
  defp percepts(grid, {left, right}, speed \\ 0.3, profile \\ Profile.magellan()) do
    poses = %{mag1: Pose.new(left, 0.0), mag2: Pose.new(right, 0.0, :math.pi())}

    for {me, it} <- [mag1: :mag2, mag2: :mag1], into: %{} do
      peer = %{
        pose: poses[it],
        twist: Twist.new(speed, 0),
        radius: profile.radius,
        at_ms: 0,
        mode: :moving
      }

      {me,
       %Percept{
         robot: me,
         at_ms: 0,
         profile: profile,
         pose: poses[me],
         grid: grid,
         peers: %{it => peer}
       }}
    end
  end

  defp decide(percept, right \\ %RightOfWay{}) do
    goal = if percept.robot == :mag1, do: {6.0, 0.0}, else: {-6.0, 0.0}
    RightOfWay.note(right, [goal], percept, Neighbours.robots(percept))
  end

  defp who_waits(percepts),
    do: for({id, percept} <- percepts, match?({{:wait, _}, _}, decide(percept)), do: id)

  test "of two in a corridor for one exactly one waits, whoever is nearer to its end, and where the other gets past" do
    grid = grid()

    for _ <- 1..60 do
      left = -2.9 + 3.0 * :rand.uniform()
      # Not so far apart that they need not think of each other yet.
      right = left + 0.6 + (min(2.9, left + 5.0) - left - 0.6) * :rand.uniform()
      percepts = percepts(grid, {left, right})
      assert [waits] = who_waits(percepts)

      back = [mag1: left + 3.0, mag2: 3.0 - right]
      assert back[waits] < Enum.max(Keyword.values(back)) + 0.5
      assert {{:wait, place}, _right} = decide(percepts[waits])
      assert PassingPlace.passes?(grid, place, 0.2, 0.2)
    end
  end

  test "the rule is the same from both sides, and one goes on where one can wait" do
    some = fn -> if :rand.uniform(6) > 1, do: 4 * :rand.uniform() end

    for _ <- 1..2_000, how <- [[], [:by_name]] do
      {a, b} = {{:mag1, some.()}, {:min1, some.()}}
      assert RightOfWay.first(a, b, how) == RightOfWay.first(b, a, how)

      case {a, b} do
        {{_, nil}, {_, nil}} -> assert RightOfWay.first(a, b, how) == nil
        {{_, nil}, _} -> assert RightOfWay.first(a, b, how) == :mag1
        {_, {_, nil}} -> assert RightOfWay.first(a, b, how) == :min1
        _both when how == [:by_name] -> assert RightOfWay.first(a, b, how) == :mag1
        {{_, x}, {_, y}} -> assert RightOfWay.first(a, b, how) != nil or max(x, y) < 0.5
      end
    end
  end

  test "a niche is nearer than the end of the corridor" do
    percepts = percepts(grid(true), {-0.5, 2.1})
    assert who_waits(percepts) == [:mag2]
    assert {{:wait, {x, y}}, _right} = decide(percepts.mag2)
    assert abs(x - 1.5) < 0.3 and y > 0.6
  end

  test "in a room, alone, before one that stands, drives ahead or will not move, or without a map none waits" do
    assert who_waits(percepts(grid(), {-6.0, -4.0})) == []
    assert who_waits(percepts(grid(), {-1.0, 2.0}, 0.0)) == []
    assert who_waits(percepts(nil, {-1.0, 2.0})) == []

    for {id, percept} <- percepts(grid(), {-1.0, 2.0}),
        change <- [
          &put_in(&1.mode, :holding),
          &put_in(&1.mode, :dead),
          &put_in(&1.twist, Twist.new(-0.3, 0))
        ] do
      peers = Map.new(percept.peers, fn {it, peer} -> {it, change.(peer)} end)
      assert {:go, %{now: nil}} = decide(%{percept | peers: peers}), "#{id}"
    end
  end

  test "it waits until the other is past, or has not moved for 6 s" do
    %{mag2: percept} = percepts(grid(), {-1.0, 2.0})
    assert {{:wait, place}, right} = decide(percept)
    wait = fn percept, right, at_ms -> decide(%{percept | at_ms: at_ms}, right) end

    {x, y} = place
    there = %{percept | pose: Pose.new(x, y)}
    past = put_in(there.peers.mag1.pose, Pose.new(5.5, -1.5))
    assert {{:wait, ^place}, right} = wait.(there, right, 5_000)
    assert {{:wait, ^place}, _right} = wait.(past, right, 5_600)
    assert {:go, %{now: nil, vain: vain}} = wait.(past, right, 5_800)
    assert vain == %{}

    still = put_in(there.peers.mag1.twist, Twist.zero())
    assert {{:wait, ^place}, _right} = wait.(still, right, 10_900)
    assert {:go, %{now: nil, vain: %{mag1: 1}}} = wait.(still, right, 11_000)
  end

  test "two that both go on, or both stood, let names decide" do
    percepts = percepts(grid(), {0.0, 0.6}, 0.0)
    later = &%{&1 | at_ms: 3_000}

    for {id, percept} <- percepts, go_on? <- [true, false] do
      now = %{
        id: if(id == :mag1, do: :mag2, else: :mag1),
        place: nil,
        line: [],
        since_ms: 0,
        moved_ms: 0,
        on_ms: 0
      }

      right = if go_on?, do: %RightOfWay{now: now}, else: %RightOfWay{}
      assert {:go, right} = decide(percept, right)
      assert {what, _right} = decide(later.(percept), right)
      assert match?({:wait, _place}, what) == (id == :mag2)
    end
  end
end
