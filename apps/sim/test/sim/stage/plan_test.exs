defmodule Sim.Stage.PlanTest do
  @moduledoc "The walls of world files as floor plans."
  use ExUnit.Case, async: true
  alias Sim.Floorplan

  @moduletag :tmp_dir

  # A picture of 8 x 4 pixels: a frame, with a white edge round it, and a door to the right.
  @picture """
  P2 8 4 255
  255 255 255 255 255 255 255 255
  255 0 0 0 0 0 0 255
  255 0 255 255 255 255 255 255
  255 0 0 0 0 0 0 255
  """

  defp plan(folder, text) do
    File.write!(Path.join(folder, "a.pgm"), @picture)
    file = Path.join(folder, "a.world")
    File.write!(file, text)
    Floorplan.open(file, 1)
  end

  test "what is dark in a picture fills the size of its model, in the world's coordinates", %{
    tmp_dir: folder
  } do
    {:ok, map} =
      plan(
        folder,
        "model ( bitmap \"a.pgm\" size [6 3 1] pose [1 0 0 0] ) position ( pose [1.5 0 0 0] )"
      )

    # From -2 to 4 along x, so the plan is 8 m wide about 0,0, and 3 m high.
    assert Floorplan.size(map) == {8.0, 3.0}
    assert map.room == {-2.0, -1.5, 4.0, 1.5}

    for point <- [{-1.5, 0.0}, {0.0, 1.0}, {0.0, -1.0}, {3.9, 1.2}],
        do: assert(Floorplan.wall?(map, point))

    for point <- [{-0.9, 0.0}, {3.9, 0.0}, {0.0, 0.45}], do: refute(Floorplan.wall?(map, point))
    # Beside the model there is nothing to drive on.
    assert Floorplan.wall?(map, {-3.0, 0.0})
  end

  test "the first row of a picture is the highest, its first column that on the left", %{
    tmp_dir: folder
  } do
    File.write!(Path.join(folder, "l.pgm"), "P2 2 2 255 0 255 0 0")

    {:ok, map} =
      plan(folder, "model ( bitmap \"l.pgm\" size [4 4 1] ) position ( pose [1 1 0 0] )")

    walls = for x <- [-1.0, 1.0], y <- [-1.0, 1.0], Floorplan.wall?(map, {x, y}), do: {x, y}
    assert walls == [{-1.0, -1.0}, {-1.0, 1.0}, {1.0, -1.0}]
  end

  test "a boundary closes the door; a turned picture is turned", %{tmp_dir: folder} do
    {:ok, closed} = plan(folder, "model ( bitmap \"a.pgm\" size [6 3 1] boundary 1 ) position ()")

    assert Floorplan.wall?(closed, {2.99, 0.0})

    {:ok, turned} =
      plan(folder, "model ( bitmap \"a.pgm\" size [6 3 1] pose [0 0 0 90] ) position ()")

    assert Floorplan.size(turned) == {3.0, 6.0}
    assert Floorplan.wall?(turned, {0.0, -2.5})
    refute Floorplan.wall?(turned, {0.0, 2.9})
  end

  test "models without a picture are walls on a floor round what stands there", %{tmp_dir: folder} do
    {:ok, map} =
      plan(
        folder,
        "position () model ( size [1 0.02 1] pose [2 0 0 45] ) model ( size [1 1 1] pose [-3 0 0 0] )"
      )

    # A metre beyond the corners of both.
    assert Floorplan.size(map) == {9.0, 3.0}
    for k <- -4..4, do: assert(Floorplan.wall?(map, {2 + 0.08 * k, 0.08 * k}))
    refute Floorplan.wall?(map, {2.3, -0.3})
    assert Floorplan.free?(map, {0.0, 0.0}, 0.9)
    assert Floorplan.clearance(map, {-2.0, 0.0}, 1.0) == 0.5
  end

  test "what cannot be drawn is one line with its place", %{tmp_dir: folder} do
    {:error, line} = plan(folder, "position ()\nmodel ( bitmap \"no.png\" )")
    assert line =~ ~r/a\.world:2:9: bitmap .*no\.png: no such file or directory\z/
    {:error, line} = plan(folder, "position ( pose [1500 0 0 0] )")
    assert line =~ "reaches further than 1000 m from 0,0"
    {:error, line} = plan(folder, "position ( pose [900 900 0 0] )")
    assert line =~ "too large, at most 64 million cells"
  end
end
