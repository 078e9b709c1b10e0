defmodule Missions.FoundMarksTest do
  use ExUnit.Case, async: true
  alias Hal.{Options, Pose, Profile}
  alias Missions.Explore.FoundMarks
  alias Robot.Percept
  alias Vision.{Detections, Mark}

  # A robot at this pose that reads a mark two metres ahead, in a frame of this time.
  defp percept(pose, at_ms, read) do
    marks =
      for {id, options} <- read do
        fields = %{
          family: :tag36h11,
          id: id,
          at_ms: at_ms,
          x: 0.0,
          y: 0.0,
          corners: [],
          width: 2,
          height: 2,
          range: 2.0,
          bearing: 0.0,
          range_sd: 0.1,
          bearing_sd: 0.02
        }

        struct!(Mark, Map.merge(fields, Map.new(options)))
      end

    %Percept{
      robot: :mag1,
      at_ms: at_ms,
      profile: Profile.magellan(),
      pose: pose,
      detections: %Detections{at_ms: at_ms, blobs: [], marks: marks, pose: pose},
      uncertainty: %{spread: {0.05, 0.05, 0.0}, heading: 0.01}
    }
  end

  defp looked(pose, read, frames \\ 3), do: looked(%FoundMarks{}, pose, read, frames, 0)

  defp looked(marks, pose, read, frames, from_ms) do
    Enum.reduce(1..frames, marks, fn n, marks ->
      FoundMarks.look(marks, percept(pose, from_ms + 100 * n, read))
    end)
  end

  defp told(marks) do
    {said, marks} = FoundMarks.tell(marks)
    {:ok, said} = Options.check(said, FoundMarks.table(), "mark")
    {Map.new(said), marks}
  end

  test "a mark is where it was read in three frames, and where it faces is known once one could tell" do
    assert FoundMarks.known(looked(Pose.new(0, 0), [{7, []}], 2)) == []
    marks = looked(Pose.new(0, 0), [{7, []}])
    assert [{7, {{{x, +0.0}, {xx, _xy, yy}}, nil}}] = FoundMarks.known(marks)
    assert_in_delta x, 2.0, 1.0e-9
    assert xx > yy and FoundMarks.hung(marks) == []

    marks = looked(marks, Pose.new(0, 0), [{7, yaw: 0.1, yaw_sd: 0.05}], 1, 300)
    assert [{7, {x, _y, turn, sd}}] = FoundMarks.hung(marks)
    assert sd > 0.05 and sd < 0.15
    assert_in_delta x, 2.0, 1.0e-9
    assert_in_delta turn, 0.1 - :math.pi(), 1.0e-9
    # Vaguer sightings from afar take nothing from it.
    [{7, {good, _turn}}] = FoundMarks.known(marks)
    far = looked(marks, Pose.new(0, 0), [{7, range_sd: 2.0, bearing_sd: 0.5}], 3, 400)
    assert [{7, {^good, _turn}}] = FoundMarks.known(far)
    # Two marks of one number in a picture are none.
    assert FoundMarks.known(looked(Pose.new(0, 0), [{7, []}, {7, []}])) == []
  end

  test "two robots that look from different sides know it better than each, and what they tell is what they mean" do
    ahead = looked(Pose.new(0, 0), [{7, yaw: 0.0, yaw_sd: 0.05}])
    aside = looked(Pose.new(2.05, -2, :math.pi() / 2), [{7, []}])
    {said, _marks} = told(aside)
    both = FoundMarks.hear(ahead, :mag2, said)
    assert [{7, {{{x, _y}, {xx, _xy, _yy}}, {turn, _sd}}}] = FoundMarks.known(both)
    [{7, {{_at, {alone, _, _}}, _turn}}] = FoundMarks.known(ahead)
    assert x > 2.0 and x < 2.05 and xx < alone
    assert_in_delta abs(turn), :math.pi(), 0.001
    # What is heard again counts once.
    assert FoundMarks.hear(both, :mag2, said) == both
    assert [{:points, "marks", [{_x, _y2, "mark 7 ±" <> _}]}] = FoundMarks.layer(both)
  end

  test "robots that contradict each other know no place, until one of them is surer" do
    here = looked(Pose.new(0, 0), [{7, []}])
    {said, _marks} = told(looked(Pose.new(0, 3), [{7, []}]))
    torn = FoundMarks.hear(here, :mag2, said)
    assert FoundMarks.known(torn) == [] and FoundMarks.layer(torn) == []
    {said, _marks} = told(here)
    assert [{7, _seen}] = FoundMarks.known(FoundMarks.hear(torn, :mag2, said))
  end

  test "what a lost robot reads counts for nothing, nor what is vague, nor what another robot may bear" do
    here = percept(Pose.new(0, 0), 0, [{7, []}])
    lost = &put_in(&1.uncertainty[:lost?], true)
    vague = &put_in(&1.uncertainty.spread, {12.0, 0.1, 0.0})
    beside = fn at -> &%{&1 | peers: %{mag2: %{pose: at, radius: 0.2}}} end

    known = fn change ->
      Enum.reduce(1..5, %FoundMarks{}, fn n, marks ->
        detections = put_in(here.detections.at_ms, 100 * n).detections
        marked = %{detections | marks: Enum.map(detections.marks, &%{&1 | at_ms: 100 * n})}
        FoundMarks.look(marks, change.(%{here | at_ms: 100 * n, detections: marked}))
      end)
      |> FoundMarks.known()
    end

    assert [{7, _seen}] = known.(& &1)
    assert [known.(lost), known.(vague), known.(beside.(Pose.new(2.3, 0.2)))] == [[], [], []]
    assert [{7, _seen}] = known.(beside.(Pose.new(2, 1)))
  end

  test "they are told in turn; what is no covariance is not heard, and memory has a bound" do
    marks = looked(Pose.new(0, 0), [{3, []}, {7, []}, {9, []}])

    {ids, _marks} =
      Enum.map_reduce(1..4, marks, fn _n, marks ->
        {said, marks} = told(marks)
        {said.id, marks}
      end)

    assert ids == [3, 7, 9, 3]
    assert FoundMarks.tell(%FoundMarks{}) == {nil, %FoundMarks{}}

    none = %{id: 1, at: {0, 0}, var: {4, 9, 4}, turn: nil}
    assert FoundMarks.hear(marks, :mag2, none) == marks
    {said, _marks} = told(marks)

    full =
      for n <- 1..1_000, robot <- [:a, :b], reduce: marks do
        marks -> FoundMarks.hear(marks, robot, %{said | id: n})
      end

    assert map_size(full.told) == 256
  end
end
