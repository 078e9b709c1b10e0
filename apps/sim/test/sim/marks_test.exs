defmodule Sim.MarksTest do
  @moduledoc "Marks that hang in a world, painted into pictures and found in them again."
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Sim.{Floorplan, World}
  alias Vision.Marks
  @moduletag skip: with({:error, line} <- Marks.available(), do: line, else: (:ok -> false))

  # A robot in the origin that looks along x.
  defp world(marks, options \\ []) do
    {:ok, map} = Floorplan.open("hall", 12)
    robots = [%{id: :mag1, profile: Profile.magellan(), pose: Pose.new(0, 0)}]
    World.new!([map: map, robots: robots, marks: marks, seed: 5] ++ options)
  end

  defp seen(world, family \\ :tag36h11, size \\ 0.3) do
    {:ok, marks} = Marks.new(family: family, size: size)
    {:ok, detector} = Marks.detector(marks)
    {:ok, seen} = Marks.find(marks, detector, World.frame(world, :mag1))
    seen
  end

  # Turned so that its yaw, seen from the robot, is this.
  defp hung(id, {x, y}, yaw, more \\ []),
    do: [id: id, size: 0.3, pose: Pose.new(x, y, Pose.wrap(yaw + :math.pi()))] ++ more

  test "a mark of either family is found with its id, and stands where it hangs" do
    for family <- Marks.families(), yaw <- [-0.6, 0.5], height <- [0.3, 0.9] do
      place = {1.5, 0.2}
      mark = hung(7, place, yaw, height: height, family: family)
      assert [found] = seen(world([mark]), family)
      assert %{id: 7, family: ^family, at_ms: 0} = found
      assert_in_delta found.range, 1.513, 0.03
      assert_in_delta found.bearing, :math.atan2(0.2, 1.5), 0.005
      assert_in_delta found.yaw, yaw, 0.1
      assert seen(world([mark]), hd(Marks.families() -- [family])) == []
    end
  end

  test "a self-similar mark is not read where the last cells of its barcode are too narrow" do
    # 1.3 to 1.5 pixels at 60 degrees, with the barcode behind; 2.1 at 35.
    for id <- 0..15, {yaw, read?} <- [{1.33, false}, {1.35, false}, {1.37, false}, {0.9, true}] do
      mark = Keyword.merge(hung(id, {1.45, 0.46}, yaw), family: :similar, size: 0.2)
      read = for found <- seen(world([mark]), :similar, 0.2), do: found.id
      assert {id, yaw, read} == {id, yaw, if(read?, do: [id], else: [])}
    end
  end

  test "where the camera looks counts" do
    world = [hung(3, {0.3, 2.0}, 1.4)] |> world() |> World.look(:mag1, 1.3, 0.1)
    assert seen(world) == []
    world = Enum.reduce(1..40, world, fn _, world -> World.step(world) end)
    assert [%{id: 3} = found] = seen(world)
    assert_in_delta found.bearing, :math.atan2(2.0, 0.3), 0.01
    assert_in_delta found.range, 2.02, 0.05
  end

  test "two marks of one id are both told; what is hidden, seen from behind, or half outside is not" do
    pair = [hung(1, {2.0, 0.5}, 0.3), hung(1, {2.0, -0.5}, -0.3)]
    assert [%{id: 1, x: x1}, %{id: 1, x: x2}] = seen(world(pair))
    assert x1 < x2
    # The pole hides the one to the right, and is hidden by the one to the left.
    assert [%{x: ^x1}] = seen(world(pair, landmark: {1.5, -0.375}, noise: :default))
    assert [_, _] = seen(world(pair, landmark: {2.6, 0.65}))
    assert seen(world([hung(1, {2.0, 0.0}, :math.pi())])) == []
    assert seen(world([hung(1, {2.0, 1.13}, 0.0)])) == []
    assert seen(world([hung(1, {500.0, 0.0}, 0.0)])) == []
  end

  test "a mark that no world can have is refused" do
    assert_raise ArgumentError, ~r/tag36h11 has no mark 587/, fn ->
      world([hung(587, {1.0, 0.0}, 0.0)])
    end

    assert_raise ArgumentError, ~r/mark option sise is not known/, fn -> world([[sise: 1]]) end
  end
end
