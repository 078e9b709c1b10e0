defmodule Robot.Localiser.PrintedMarksTest do
  @moduledoc "A robot corrects its pose by marks whose places it knows, and finds itself by them."
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.{Localiser, Percept}
  alias Robot.Localiser.{Belief, Frame, PrintedMarks}
  alias Vision.{Detections, Mark}

  @known [{1, {4.0, 0.0, :math.pi()}}, {2, {0.0, 4.0, -:math.pi() / 2}}, {3, {4.0, 4.0, -2.4}}]

  # A localiser that believes to be at the origin, and is told of these marks.
  defp localiser(known \\ @known) do
    localiser = %{Localiser.new(Pose.new(0, 0)) | printed: PrintedMarks.new(known: known)}
    {_percept, localiser} = Localiser.update(localiser, percept(0, Pose.new(0, 0), []))
    localiser
  end

  defp percept(at_ms, odometry, marks) do
    %Percept{
      robot: :mag1,
      at_ms: at_ms,
      profile: Profile.magellan(),
      odometry: %Odometry{pose: odometry, twist: Twist.zero()},
      detections: %Detections{at_ms: at_ms, blobs: [], marks: marks, field_of_view: 1.0}
    }
  end

  # What a robot that truly is at a pose reads of a mark that hangs there.
  defp reading(id, truth, {x, y, heading}, yaw? \\ true) do
    {dx, dy} = {x - truth.x, y - truth.y}
    range = :math.sqrt(dx * dx + dy * dy)

    %Mark{
      family: :tag36h11,
      id: id,
      at_ms: 0,
      x: 9.0,
      y: 9.0,
      corners: [],
      width: 320,
      height: 240,
      range: range,
      bearing: Pose.wrap(:math.atan2(dy, dx) - truth.heading),
      yaw: if(yaw?, do: Pose.wrap(heading + :math.pi() - truth.heading)),
      range_sd: 0.01 * range,
      bearing_sd: 0.002,
      yaw_sd: if(yaw?, do: 0.02)
    }
  end

  # A walk of steps of odometry; at each the marks `see` are read from the true pose, which moves along.
  defp walk(localiser, truth, steps, see) do
    first = (localiser.history |> hd() |> elem(0)) + 100

    steps
    |> Enum.with_index()
    |> Enum.reduce({localiser, truth}, fn {step, n}, {localiser, truth} ->
      {odometry, truth} = {Pose.compose(localiser.odometry, step), Pose.compose(truth, step)}
      at_ms = first + 100 * n
      marks = for mark <- see.(truth), do: %{mark | at_ms: at_ms}
      {_percept, localiser} = Localiser.update(localiser, percept(at_ms, odometry, marks))
      {localiser, truth}
    end)
  end

  defp off({localiser, truth}), do: Pose.distance(localiser.belief.pose, Pose.point(truth))
  defp still(count), do: List.duplicate(Pose.new(0, 0), count)

  defp sees(ids, yaw? \\ true),
    do: fn truth -> for id <- ids, do: reading(id, truth, place(id), yaw?) end

  defp place(id), do: @known |> List.keyfind(id, 0) |> elem(1)

  test "three frames of a mark correct a pose, two do not" do
    truth = Pose.new(0.2, -0.1, 0.03)
    localiser = localiser()
    unsure = %{localiser | belief: Belief.doubt(localiser.belief)}
    assert off(walk(unsure, truth, still(2), sees([1, 2]))) == Pose.distance(truth, {0.0, 0.0})
    {localiser, _} = known = walk(unsure, truth, still(8), sees([1, 2]))
    assert off(known) < 0.04
    assert abs(localiser.belief.pose.heading - 0.03) < 0.015
  end

  test "a thousand readings make no pose surer than the place of a mark is" do
    {localiser, _} = walk(localiser(), Pose.new(0, 0), still(1_000), sees([1, 2]))
    {worst, least, heading} = Belief.sd(localiser.belief)
    assert worst > 0.01 and least > 0.01 and heading > 0.003
  end

  test "a mark that hangs elsewhere than it was told does not move a robot that knows its place" do
    wrong = fn truth -> [reading(1, truth, {6.0, 1.0, 2.5})] end
    {localiser, _} = walk(localiser(), Pose.new(0, 0), still(50), wrong)
    assert localiser.belief.pose == Pose.new(0, 0)
    assert localiser.printed.hypotheses != nil
    # A mark that is where it should be ends the doubt.
    {localiser, _} = walk(localiser, Pose.new(0, 0), still(3), sees([2]))
    assert localiser.printed.hypotheses == nil
  end

  test "a lost robot takes its place from one mark that tells where it faces" do
    localiser = localiser()
    lost = %{localiser | lost?: true, belief: Frame.lost(localiser.belief)}
    {found, _} = known = walk(lost, Pose.new(2.5, 2.0, -2.0), still(3), sees([1]))
    assert off(known) < 0.1 and not found.lost?
    assert found.frame_no > lost.frame_no
    assert abs(Pose.wrap(found.belief.pose.heading + 2.0)) < 0.05
  end

  test "by marks that do not tell that, a lost robot needs two" do
    localiser = localiser()
    lost = %{localiser | lost?: true, belief: Frame.lost(localiser.belief)}
    truth = Pose.new(1.5, 1.0, 0.3)
    {still_lost, _} = walk(lost, truth, still(10), sees([1], false))
    assert still_lost.lost?

    {found, _} = known = walk(lost, truth, still(4), sees([1, 2], false))
    assert off(known) < 0.3 and not found.lost?

    # All that it reads of one fits as well from anywhere on a circle round it.
    aside = List.duplicate(Pose.new(0.1, 0, 0.08), 40)
    {still_lost, _} = walk(lost, Pose.new(1.0, -1.0, 1.2), aside, sees([1], false))
    assert still_lost.lost?
  end

  test "two marks bring back one that was carried away and does not know it" do
    carried = Pose.new(2.0, 1.5, 2.0)
    {alone, _} = walk(localiser(), carried, still(20), sees([3]))
    assert alone.belief.pose == Pose.new(0, 0)
    assert off(walk(alone, carried, still(6), sees([1]))) < 0.15
  end

  test "one wrong mark that took a lost robot away does not keep it" do
    localiser = localiser()
    lost = %{localiser | lost?: true, belief: Frame.lost(localiser.belief)}
    truth = Pose.new(1.0, 1.0, 0.5)
    wrong = fn truth -> [reading(3, truth, {1.0, 3.0, -1.2})] end
    {astray, _} = known = walk(lost, truth, still(5), wrong)
    assert off(known) > 1.0
    back = walk(astray, truth, still(5), sees([1]))
    assert off(walk(elem(back, 0), truth, still(5), sees([2]))) < 0.15
  end

  test "marks that were not told, or tell no range, do nothing" do
    {localiser, _} = walk(localiser([]), Pose.new(0.1, 0, 0), still(5), sees([1]))
    assert localiser.belief.pose == Pose.new(0, 0)
    blind = fn truth -> for mark <- sees([1]).(truth), do: %{mark | range: nil, bearing: nil} end
    {localiser, _} = walk(localiser(), Pose.new(0.1, 0, 0), still(5), blind)
    assert localiser.belief.pose == Pose.new(0, 0)
  end
end
