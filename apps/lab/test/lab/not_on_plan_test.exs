defmodule Lab.NotOnPlanTest do
  @moduledoc """
  Robots with a floor plan in a building that differs from it: `Nav.KnownWalls`. `FIGURES=1 mix test --only long`
  prints what is in docs/reports/avoidance.md.
  """
  use Lab.LockstepCase, async: true
  @moduletag :slow
  alias Hal.Pose
  alias Lab.Corridor
  alias Sim.Floorplan.{Drawing, Shape}

  @near {:free, {:box, -0.1, -1.5, 0.1, -0.5}}
  @far {:free, {:box, -0.1, 2.0, 0.1, 3.0}}
  @box {:wall, {:box, -0.5, -0.5, 0.5, 0.5}}

  # Two rooms of 5 m by 8 m and the doors between them.
  defp rooms(doors), do: draw([{:wall, {:box, -0.1, -4.0, 0.1, 4.0}} | doors])

  defp draw(shapes) do
    size = {10.0, 8.0}

    plan =
      Drawing.plan("rooms", size, {-5.0, -4.0, 5.0, 4.0}, shapes ++ Shape.frame(5.0, 4.0, 0.2))

    struct!(Sim.Floorplan, plan)
  end

  # How a goto along this line ends in the world, by the plan.
  defp goto(world, plan, y, seeds, id \\ :mag1) do
    for seed <- seeds do
      start = Pose.new(-3.0, y, 0.3 * seed - 1.0)
      run = Corridor.run(world, plan, seed, [{id, start, {3.0, y}}], 120)
      assert run.collisions == 0
      run.ended[id]
    end
  end

  defp arrive(ended, within_s) do
    for result <- ended do
      assert {:done, s} = result
      assert s < within_s
      s
    end
  end

  defp say(about, times) do
    if System.get_env("FIGURES"), do: IO.puts("#{about}: #{inspect(times, charlists: false)}")
  end

  test "a door that is shut is one way less" do
    arrive(goto(rooms([@far]), rooms([@near, @far]), -1.5, [1]), 45)
  end

  test "the only door, shut, is given up in words" do
    assert [{:given_up, "something unknown", s}] = goto(rooms([]), rooms([@near]), -1.5, [1])
    assert s < 40
  end

  test "furniture that nobody drew is driven round" do
    arrive(goto(draw([@box]), draw([]), 0.1, [1]), 35)
  end

  @tag long: true
  test "so it is with other seeds and robots" do
    for id <- [:mag1, :min1], plan = rooms([@near, @far]), far = rooms([@far]) do
      known = arrive(goto(far, far, -1.5, 1..5, id), 45)
      say("#{id}, nearer door not on the plan", known)
      say("#{id}, nearer door shut", arrive(goto(far, plan, -1.5, 1..5, id), 45))

      for doors <- [[@near], [@near, @far]] do
        ended = goto(rooms([]), rooms(doors), -1.5, 1..5, id)
        assert Enum.all?(ended, &match?({:given_up, "something unknown", s} when s < 60, &1))

        say(
          "#{id}, #{length(doors)} of #{length(doors)} doors shut",
          for({_, _, s} <- ended, do: s)
        )
      end

      say("#{id}, box on the plan", arrive(goto(draw([@box]), draw([@box]), 0.1, 1..5, id), 35))
      say("#{id}, box", arrive(goto(draw([@box]), draw([]), 0.1, 1..5, id), 45))
    end
  end
end
