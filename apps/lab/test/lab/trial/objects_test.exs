defmodule Lab.Trial.ObjectsTest do
  use ExUnit.Case, async: true
  alias Lab.Trial
  alias Sim.World.Object

  @options %{robots: [:mag1, :mag2], landmark: :none, duration_s: 20, plan: :known}

  test "balls and boxes are in the world of a run, and cameras see them" do
    {:ok, still} = Trial.setup(@options)
    %{x: x, y: y, heading: heading} = hd(still.robots).start
    {ahead, side} = {{1.5 * :math.cos(heading), 1.5 * :math.sin(heading)}, heading * 57.3 + 90}
    {dx, dy} = ahead

    for {objects, colour} <- [
          {[balls: [{x + dx, y + dy}]], "OrangeBall"},
          {[boxes: [{x + dx, y + dy, side}]], "BlueBox"}
        ],
        blobs <- [:direct, :painted] do
      {:ok, trial} = @options |> Map.merge(Map.new([blobs: blobs] ++ objects)) |> Trial.new()
      assert [%{velocity: {vx, vy}}] = trial.world.objects
      assert vx == 0.0 and vy == 0.0
      {%{blobs: seen}, _trial} = Trial.Mechanics.look(trial, :mag1)
      assert colour in Enum.map(seen, & &1.colour)
    end
  end

  test "objects in a wall are refused by name, with the path to the option" do
    assert Trial.new(Map.put(@options, :balls, [{1, 0}, {99, 0}])) ==
             {:error, "ball2 cannot be at 99.0,0.0 of map hall: there is a wall"}

    assert [{["boxes", "1"], _line}] =
             Trial.Setup.problems(Map.put(@options, :boxes, [{99, 0, 0}]))

    assert {:error, "trial option balls" <> _} = Trial.new(Map.put(@options, :balls, [{1, :a}]))
  end

  test "a person puts robots, balls and boxes elsewhere where there is room, and nothing moves where there is none" do
    {:ok, trial} =
      Trial.new(Map.merge(@options, %{balls: [{4, 4}], boxes: [{-4, 4, 30}], seed: 2}))

    heading = trial.world.robots.mag1.pose.heading

    {:ok, trial} = Trial.place(trial, :mag1, {-5.0, -5.0})
    {:ok, trial} = Trial.place(trial, "ball1", {5.0, 5.0})
    {:ok, trial} = Trial.place(trial, "box1", {-5.0, 3.0})
    trial = Trial.step(trial)
    assert Hal.Pose.distance(trial.world.robots.mag1.pose, {-5.0, -5.0}) < 0.1
    assert_in_delta trial.world.robots.mag1.pose.heading, heading, 0.2

    assert [%{pose: %{x: 5.0, y: 5.0}}, %{pose: %{x: -5.0, y: 3.0, heading: turned}}] =
             trial.world.objects

    assert_in_delta turned, :math.pi() / 6, 1.0e-9

    assert [:displaced, :placed, :placed] =
             for(%{stage: s} <- Trial.stages(trial), s in [:displaced, :placed], do: s)

    for {who, place} <- [
          {:mag1, {99.0, 0.0}},
          {:mag1, {5.1, 5.0}},
          {:mag2, {-5.0, -5.2}},
          {"ball1", {-5.0, 3.1}},
          {"box1", {-5.0, -5.0}}
        ] do
      {x, y} = place
      line = "#{who} cannot be put at #{x},#{y}: there is no room"
      assert {who, Trial.place(trial, who, place)} == {who, {:error, line}}
    end

    assert Trial.place(trial, "ball2", {0.0, 0.0}) == {:error, "there is no ball2"}
    trial = trial |> Trial.kill(:mag2) |> Trial.step()

    assert Trial.place(trial, :mag2, {0.0, 0.0}) ==
             {:error, "mag2 is dead, and stays where it is"}
  end

  test "a script puts objects elsewhere; what it names must be there, and have room" do
    options = Map.put(@options, :balls, [{4, 4}])
    script = &Map.put(options, :script, [{0.2, {:place, &1, &2}}])
    {:ok, trial} = Trial.new(script.("ball1", {-4, 4, 0}))
    trial = Enum.reduce(1..4, trial, fn _, trial -> Trial.step(trial) end)
    assert [%{pose: %{x: -4.0, y: 4.0}}] = trial.world.objects

    assert Trial.Setup.problems(script.("ball2", {0, 0, 0})) ==
             [{["script", "1"], "there is no ball2 in this run; did you mean ball1?"}]

    assert [{["script", "1"], "ball1 cannot be put at 99.0,0.0" <> _}] =
             Trial.Setup.problems(script.("ball1", {99, 0, 0}))

    # It comes to where a robot stands by then.
    {:ok, still} = Trial.setup(@options)
    %{x: x, y: y} = hd(still.robots).start
    {:ok, trial} = Trial.new(script.("ball1", {x, y, 0}))
    trial = Enum.reduce(1..4, trial, fn _, trial -> Trial.step(trial) end)
    assert [%{pose: %{x: 4.0, y: 4.0}}] = trial.world.objects
    assert Enum.any?(Trial.stages(trial), &(&1.stage == :not_placed))
  end

  test "no robot starts on an object, and a run without objects starts as before" do
    for seed <- 1..30 do
      {:ok, before} = Trial.setup(Map.put(@options, :seed, seed))
      assert before.world.objects == []
      starts = for robot <- before.robots, do: robot.start
      %{x: x, y: y} = hd(starts)
      {:ok, setup} = Trial.setup(Map.merge(@options, %{seed: seed, balls: [{x, y}]}))
      [ball] = setup.world.objects

      for %{start: start, profile: profile} <- setup.robots,
          do: assert(elem(Object.gap(ball, {start.x, start.y, profile.radius}), 0) > 0.05)
    end
  end

  test "the lowest row of a ball's blob tells how far it is" do
    options = Map.put(@options, :seed, 2)
    {:ok, still} = Trial.setup(options)
    %{start: %{x: x, y: y, heading: heading}, profile: profile} = hd(still.robots)

    for metres <- [1.7, 2.5, 4.0], blobs <- [:direct, :painted] do
      place = {x + metres * :math.cos(heading), y + metres * :math.sin(heading)}
      {:ok, trial} = options |> Map.merge(%{blobs: blobs, balls: [place]}) |> Trial.new()
      {%{blobs: seen}, _trial} = Trial.Mechanics.look(trial, :mag1)
      blob = Enum.find(seen, &(&1.colour == "OrangeBall"))
      {range, sd} = Robot.Percept.Ground.range(blob, profile.camera, profile.camera.field_of_view)
      assert_in_delta range + 0.11, metres, 2.5 * sd
    end
  end
end
