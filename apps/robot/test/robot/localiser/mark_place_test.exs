defmodule Robot.Localiser.MarkPlaceTest do
  @moduledoc "Where a mark is, by one robot and by several."
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Robot.Percept
  alias Robot.Localiser.MarkPlace
  alias Vision.{Detections, Mark}
  doctest MarkPlace

  @mark {3.0, 1.0}
  @sd %{place: 0.08, heading: 0.04, range: 0.03, bearing: 0.005}

  # What a robot says of the mark that truly is at `pose`; all errors are drawn, that of its place is `common` to all.
  defp say(pose, {cx, cy}, random) do
    {[x, y, turn, r, f], random} =
      Enum.map_reduce(1..5, random, fn _, random -> :rand.normal_s(random) end)

    {mx, my} = @mark
    {dx, dy} = {mx - pose.x, my - pose.y}

    believed =
      Pose.new(
        pose.x + 0.6 * @sd.place * x + 0.8 * @sd.place * cx,
        pose.y + 0.6 * @sd.place * y + 0.8 * @sd.place * cy,
        pose.heading + @sd.heading * turn
      )

    mark = %{
      mark()
      | range: :math.sqrt(dx * dx + dy * dy) + @sd.range * r,
        bearing: Pose.wrap(:math.atan2(dy, dx) - pose.heading + @sd.bearing * f),
        range_sd: @sd.range,
        bearing_sd: @sd.bearing
    }

    {MarkPlace.of(percept(believed), mark), random}
  end

  defp percept(pose) do
    %Percept{
      robot: :mag1,
      at_ms: 0,
      profile: Profile.magellan(),
      pose: pose,
      uncertainty: %{spread: {@sd.place, @sd.place, 0.0}, heading: @sd.heading},
      detections: %Detections{at_ms: 0, blobs: [], pose: pose}
    }
  end

  # The squared distance from the mark in standard deviations: 2 in the mean if these are right.
  defp off({{x, y}, {xx, xy, yy}}) do
    {mx, my} = @mark
    {dx, dy} = {x - mx, y - my}
    (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / (xx * yy - xy * xy)
  end

  defp off_m({{x, y}, _covariance}), do: Pose.distance({x, y}, @mark)
  defp mean(numbers), do: Enum.sum(numbers) / length(numbers)

  test "three robots from three sides know it better than one, and none is too sure of it" do
    poses = [Pose.new(0, 1, 0.3), Pose.new(3, -2, 1.2), Pose.new(6, 3, -2.5)]

    {draws, _random} =
      Enum.map_reduce(1..1_000, :rand.seed_s(:exsss, {7, 1, 1}), fn _, random ->
        {common, random} =
          Enum.map_reduce(1..2, random, fn _, random -> :rand.normal_s(random) end)

        Enum.map_reduce(poses, random, &say(&1, List.to_tuple(common), &2))
      end)

    fused = for said <- draws, place = MarkPlace.fuse(said), do: place
    assert length(fused) > 990
    alone = for [first | _] <- draws, do: first
    assert_in_delta mean(Enum.map(alone, &off/1)), 2.0, 0.3
    assert mean(Enum.map(fused, &off/1)) < 2.0
    assert mean(Enum.map(fused, &off_m/1)) < 0.8 * mean(Enum.map(alone, &off_m/1))
  end

  test "one sighting is itself, and the same twice is no surer than once" do
    place = {{1.0, 2.0}, {0.04, 0.01, 0.02}}

    for said <- [[place], [place, place]] do
      {{x, y}, {xx, xy, yy}} = MarkPlace.fuse(said)

      for {a, b} <- [{x, 1.0}, {y, 2.0}, {xx, 0.04}, {xy, 0.01}, {yy, 0.02}],
          do: assert_in_delta(a, b, 1.0e-12)
    end
  end

  test "none without a pose or a range" do
    {{_x, _y}, _covariance} = MarkPlace.of(percept(Pose.new(0, 0)), mark = mark())
    assert MarkPlace.of(%{percept(Pose.new(0, 0)) | uncertainty: nil}, mark) == nil
    assert MarkPlace.of(percept(nil), mark) == nil
    assert MarkPlace.of(percept(Pose.new(0, 0)), %{mark | range: nil}) == nil
    assert MarkPlace.fuse([]) == nil
  end

  defp mark do
    %Mark{
      family: :tag36h11,
      id: 1,
      at_ms: 0,
      x: 0.0,
      y: 0.0,
      corners: [],
      width: 2,
      height: 2,
      range: 2.0,
      bearing: 0.1,
      range_sd: 0.1,
      bearing_sd: 0.01
    }
  end
end
