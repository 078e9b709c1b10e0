defmodule Missions.PushTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Missions.Push
  alias Missions.Push.{Box, Estimate, Places, Plan, Talk}
  doctest Box
  doctest Plan

  @size {1.2, 0.4}
  @box Pose.new(2.0, 1.0, 1.2)

  # What a robot at a place sees of the box, looking at its middle, with an error of each number.
  defp sighting({x, y} = at, options \\ []) do
    box = Keyword.get(options, :box, @box)
    axis = :math.atan2(box.y - y, box.x - x)
    {left, right, near} = Box.edges(box, @size, at, axis)
    bearing = fn {cx, cy} -> :math.atan2(cy - y, cx - x) end
    ahead = fn {cx, cy} -> (cx - x) * :math.cos(axis) + (cy - y) * :math.sin(axis) end

    seen = %{
      at: at,
      axis: axis,
      left: bearing.(left),
      right: bearing.(right),
      near: ahead.(near),
      sd: 0.03,
      sd_heading: 0.01
    }

    options[:without] |> List.wrap() |> Enum.reduce(seen, &Map.put(&2, &1, nil))
  end

  defp looked(places, times, estimate \\ nil) do
    for k <- 1..times, place <- places, reduce: estimate do
      estimate -> Estimate.note(estimate, sighting(place), @size, 100 * k)
    end
  end

  defp off(estimate) do
    {pose, _sd, _sd_heading} = Estimate.best(estimate)
    {Pose.distance(pose, @box), abs(Estimate.half(pose.heading - @box.heading))}
  end

  describe "the estimate" do
    test "finds the box, and how it lies, from two sides" do
      estimate = looked([{0.0, 0.0}, {2.0, -1.5}], 10)
      assert Estimate.sure?(estimate)
      {far, turned} = off(estimate)
      assert far < 0.05 and turned < 0.05
    end

    test "is not sure at once, and does not begin with a part of the box" do
      refute Estimate.sure?(looked([{0.0, 0.0}], 2))

      for edge <- [:left, :right, :near],
          do: assert(Estimate.note(nil, sighting({0.0, 0.0}, without: edge), @size, 0) == nil)
    end

    test "follows the robots that push it, and knows less then" do
      estimate = looked([{0.0, 0.0}, {2.0, -1.5}], 10)
      {before, sd, _sd_heading} = Estimate.best(estimate)
      # Two robots side by side at its long side, 5 cm too far ahead.
      frame = Pose.new(before.x, before.y, before.heading - :math.pi() / 2)

      discs = for side <- [0.4, -0.4], {x, y} = Pose.place(frame, {-0.35, side}), do: {x, y, 0.2}

      pushed = Estimate.push(estimate, discs, 1.0, 2_000)
      {pose, more, _sd_heading} = Estimate.best(pushed)
      assert_in_delta Pose.distance(pose, before), 0.05, 0.01
      assert_in_delta Estimate.half(pose.heading - before.heading), 0.0, 0.02
      assert more > sd and pushed.pushed_ms == 2_000
      # Robots elsewhere change nothing.
      assert Estimate.push(estimate, [{-3.0, 0.0, 0.2}], 1.0, 2_000).all == estimate.all
    end

    test "a single wrong sighting is nothing; a box that a person carried away is found anew" do
      estimate = looked([{0.0, 0.0}, {2.0, -1.5}], 10)
      away = Pose.new(-2.0, 3.0, 0.0)
      one = Estimate.note(estimate, sighting({0.0, 0.0}, box: away), @size, 2_000)
      assert off(one) == off(estimate)

      moved =
        for k <- 1..20, place <- [{0.0, 0.0}, {-4.0, 2.0}], reduce: estimate do
          estimate -> Estimate.note(estimate, sighting(place, box: away), @size, 2_000 + 100 * k)
        end

      {pose, _sd, _sd_heading} = Estimate.best(moved)
      assert Pose.distance(pose, away) < 0.1
    end

    test "is no surer of the box than the robots are of their own places" do
      seen = &Map.put(sighting(&1), :sd, 0.3)

      unsure =
        for k <- 1..50, place <- [{0.0, 0.0}, {2.0, -1.5}], reduce: nil do
          estimate -> Estimate.note(estimate, seen.(place), @size, 100 * k)
        end

      assert Estimate.margin(unsure) >= 0.6
      assert Estimate.margin(looked([{0.0, 0.0}, {2.0, -1.5}], 50)) < 0.15
    end
  end

  describe "what they tell" do
    test "is read as it was meant, and fits its table" do
      {:idle, mission, []} = Push.init(:mag1, options())
      box = Estimate.adopt(@box, 0.25, @size, 1_000)
      assert Estimate.margin(box) > 0.5
      seen = sighting({0.0, 0.5}, without: :right)
      mission = %{mission | box: box, now_ms: 1_200, sighting: seen, side: 1, direction: 0.5}
      body = Talk.body(mission, %{1 => 2.5})
      {_version, [box: table]} = Talk.table()
      assert {:ok, _body} = Hal.Options.check(body, table, "box")
      said = Map.new(body)
      assert %{side: 1, direction: 0.5, costs: %{1 => 2.5}} = Talk.peer(said, 1_300)
      assert %{right: nil, left: left} = Talk.sighting(said)
      assert_in_delta left, seen.left, 0.001
      assert {told, 0.25} = Talk.box(said)
      assert Pose.distance(told, @box) < 0.002
      # What is not known is not told.
      none = Map.new(Talk.body(%{mission | box: nil, sighting: nil, side: nil}, %{}))
      assert {Talk.sighting(none), Talk.box(none), Talk.peer(none, 0).costs} == {nil, nil, %{}}
    end
  end

  describe "the places" do
    defp options do
      {:ok, options} = Robot.Mission.check_options(Push, [goal: {6.0, 1.0}], 3)
      options
    end

    defp scene(options) do
      base = %{
        box: @box,
        size: @size,
        goal: {6.0, 1.0},
        speed: 0.15,
        radius: 0.2,
        broadest: 0.2,
        grid: nil,
        taken: []
      }

      Plan.choose(Map.merge(base, Map.new(options)), nil, nil)
    end

    test "are at the side from which the goal lies ahead, and both are free" do
      %{way: :pair, direction: direction} = scene = scene([])
      assert abs(Pose.wrap(direction - 0.0)) < :math.pi() / 2
      places = for side <- [1, -1], do: Plan.place(scene, side)
      for {x, _y} <- places, do: assert(x < @box.x)
      assert_in_delta Pose.distance(hd(places), List.last(places)), 0.8, 0.001
    end

    test "a wreck at one of them has one robot push alone, beside it" do
      {x, y} = Plan.place(scene([]), 1)
      assert %{way: :lone, aside: aside} = scene(taken: [{x, y, 0.2}])
      assert aside < 0.0
    end

    test "robots push side by side, wait for each other, and turn the box by pushing one side faster" do
      scene = scene([])
      frame = Pose.new(@box.x, @box.y, scene.direction)
      at = fn side, behind -> Pose.compose(frame, Pose.new(-0.4 - behind, side * 0.4)) end
      speed = fn {vx, vy} -> :math.sqrt(vx * vx + vy * vy) end
      # The goal is to the right, so the left one is faster.
      left = Plan.velocity(scene, 1, at.(1, 0.0), 0.0)
      right = Plan.velocity(scene, -1, at.(-1, 0.0), 0.0)
      assert Pose.wrap(:math.atan2(1.0 - @box.y, 6.0 - @box.x) - scene.direction) > 0.0
      assert speed.(right) > speed.(left)
      # Ahead of the other one it waits.
      assert speed.(Plan.velocity(scene, 1, at.(1, 0.1), 0.3)) == 0.0
      assert speed.(Plan.velocity(scene, 1, at.(1, 0.3), 0.3)) > 0.05
    end

    test "go to the robots with the shortest ways, which keep them" do
      {:idle, mission, []} = Push.init(:mag2, options())

      peer = %{
        at_ms: 1_000,
        side: nil,
        stage: :none,
        direction: nil,
        costs: %{1 => 1.0, -1 => 3.0}
      }

      mission = %{mission | now_ms: 1_000, heard: %{mag1: peer}, direction: 0.0}
      percept = %Robot.Percept{robot: :mag2, at_ms: 1_000, profile: Hal.Profile.magellan()}
      scene = scene([])
      near = %{percept | pose: Pose.new(1.0, 0.5)}
      assert %{side: -1, stage: :approach} = mission = Places.take(mission, scene, near)
      # Another one comes nearer by half a metre.
      closer = %{
        peer
        | costs: Map.new(Places.costs(mission, scene, near), fn {s, c} -> {s, c - 0.5} end)
      }

      heard = %{mag1: %{closer | side: 1}, mag3: closer}
      assert %{side: -1} = Places.take(%{mission | heard: heard}, scene, near)
    end
  end
end
