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
