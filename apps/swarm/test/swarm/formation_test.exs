defmodule Swarm.FormationTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Swarm.Formation

  test "every shape of every size keeps its robots a spacing apart" do
    for kind <- Formation.kinds(), n <- 1..50, spacing <- [0.8, 1.0, 2.5] do
      slots = Formation.slots({kind, spacing}, n, Formation.ring({:circle, spacing}, n))
      assert length(slots) == n - 1
      places = [Pose.new(0, 0) | slots]

      for {a, i} <- Enum.with_index(places), {b, j} <- Enum.with_index(places), i < j do
        assert Pose.distance(a, b) >= spacing - 1.0e-9, "#{kind} of #{n}: #{i} and #{j}"
      end
    end
  end

  test "the thesis's triangle of three has equal sides" do
    {:ok, formation} = Formation.new(:triangle, side: 2.0, robots: 3)
    [a, b] = Formation.slots(formation, 3)
    assert_in_delta Pose.distance(a, b), 2.0, 1.0e-9
    assert_in_delta Pose.distance(a, {0.0, 0.0}), 2.0, 1.0e-9
    assert_in_delta Pose.distance(b, {0.0, 0.0}), 2.0, 1.0e-9
  end

  test "a line of a given length has that length" do
    {:ok, formation} = Formation.new(:line, length: 6.0, robots: 5)
    ys = formation |> Formation.slots(5) |> Enum.map(& &1.y)
    assert Enum.max(ys) - Enum.min(ys) == 6.0
  end

  test "in a circle all face the landmark, and none stands on it" do
    formation = {:circle, 1.0}
    ring = Formation.ring(formation, 6)

    for slot <- Formation.slots(formation, 6, ring) do
      assert_in_delta Pose.distance(slot, {ring, 0.0}), ring, 1.0e-9
      assert_in_delta Pose.bearing(slot, {ring, 0.0}), 0.0, 1.0e-9
    end
  end

  test "nonsense is refused by name" do
    assert {:error, line} = Formation.new(:column, spacing: 1.0e308)
    assert line =~ "0.8 to 5.0"

    assert {:error, "column option length is not known: allowed are spacing, robots"} =
             Formation.new(:column, length: 3)
  end
end
