defmodule Bench.GotoTest do
  use ExUnit.Case, async: true
  alias Bench.Goto
  alias Hal.Pose
  alias Nav.Reach

  test "a draw follows from map and seed; a way leads to its goal, and none is shorter than the straight line" do
    for {map, seed} <- [{"doorway", 3}, {"offices", 8}] do
      kind = Enum.at([:mag1, :min1], rem(seed, 2))
      options = %{robots: [kind], map: map, seed: seed, landmark: :none, plan: :known}
      {:ok, setup} = Lab.Trial.setup(Map.put(options, :duration_s, 10))
      assert {:ok, {from, goal, way_m}} = draw = Goto.draw(setup, kind, seed)
      assert Goto.draw(setup, kind, seed) == draw

      radius = setup.options.bodies[kind].radius
      assert Reach.check(setup.plan, Pose.point(from), goal, radius) == :ok
      assert way_m >= Pose.distance(from, goal) - 0.3
    end
  end

  test "a run tells how it ended, and how far off the robot truly is" do
    assert {:ok, %{ended: :done, collisions: 0} = measured} = Goto.run("doorway", 2)
    assert Goto.arrived?(measured)
    assert measured.took_s >= 0.9 * measured.way_s

    refute Goto.arrived?(%{measured | ended: {:given_up, "mag2"}})
    refute Goto.arrived?(%{measured | off_m: 0.6})
  end

  test "wrong words are told with what is allowed" do
    assert {:error, [line]} = Bench.Goto.Main.run(["--maps", "mars"])
    assert line =~ "offices"
    assert {:error, [line]} = Bench.Goto.Main.run(["--seeds", "x"])
    assert line =~ "--seeds"
  end
end
