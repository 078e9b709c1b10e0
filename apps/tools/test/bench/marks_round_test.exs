defmodule Bench.Marks.RoundTest do
  @moduledoc "The round of `mix bench marks --round`, and its drawing."
  use ExUnit.Case, async: true
  alias Bench.Marks.{Plot, Round}
  alias Hal.Pose
  alias Sim.Floorplan

  test "twelve points that a robot gets to, each with a mark in sight that faces it" do
    {:ok, map} = Floorplan.open("hospital", 6)
    round = Round.round(map, 12)
    assert length(round) == 12 and round == Round.round(map, 12)

    for {{x, y} = at, {mx, my, degrees}} <- round do
      assert Floorplan.free?(map, at, 0.6)
      assert Pose.distance(at, {mx, my}) > 0.9 and Pose.distance(at, {mx, my}) < 3.5
      {nx, ny} = {:math.cos(degrees * :math.pi() / 180), :math.sin(degrees * :math.pi() / 180)}
      assert (x - mx) * nx + (y - my) * ny > 0.9
    end

    for {{at, _}, k} <- Enum.with_index(round),
        {{other, _}, l} <- Enum.with_index(round),
        k < l,
        do: assert(Pose.distance(at, other) > 2.0)
  end

  test "a drawing has a line for the mean and one for 95 % of each kind" do
    run = for s <- 1..60, do: {1_000 * s, [{0.01 * s, true}, {0.02 * s, false}]}
    svg = IO.iodata_to_binary(Plot.svg([{"without marks", [run]}, {"with twelve marks", [run]}]))
    assert svg |> String.split("<polyline") |> length() == 5
    assert svg =~ "without marks: mean, and 95 % (dashes)"
    assert Plot.share([3.0, 1.0, 2.0], 0.5) == 2.0
  end
end
