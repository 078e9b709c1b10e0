defmodule Robot.Localiser.MatchingTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Robot.Localiser.{Belief, Frame, InSight, Matching}
  alias Robot.Percept.Sighting
  alias Vision.Blob

  @view :math.pi() / 3
  @here Pose.new(0, 0)

  defp robot(key, at, options \\ []),
    do:
      Map.merge(
        %{
          key: key,
          kind: :robot,
          colour: "R",
          at: at,
          sd: {0.05, 0.05, 0.0},
          common: {0.0, 0.0},
          reference?: true,
          radius: 0.2
        },
        Map.new(options)
      )

  # A cylinder in the picture, `share` times as wide as it is.
  defp blob({x, y}, radius \\ 0.2, share \\ 1.0) do
    focal = 160 / :math.tan(@view / 2)
    column = 159.5 - focal * y / x
    half = share * Sighting.width(radius, :math.sqrt(x * x + y * y), 320, @view) / 2

    %Blob{
      colour: "R",
      area: 500,
      share: 0.0065,
      x: column,
      y: 120.0,
      left: max(round(column - half), 0),
      right: min(round(column + half) - 1, 319),
      top: 60,
      bottom: 180,
      width: 320,
      height: 240
    }
  end

  defp pairs(robots, blobs, belief \\ Belief.new(@here)) do
    for %{mark: mark, blob: blob, whole?: whole?} <-
          matched(robots, blobs, belief),
        do: {mark.key, Enum.find_index(blobs, &(&1 == blob)), whole?}
  end

  # Without a plan, or by one.
  defp matched(robots, blobs, belief, plan \\ nil) do
    in_sight = InSight.new(plan, belief, @here)
    Matching.pairs(robots, blobs, belief, @here, 0.0, @view, in_sight)
  end

  test "a blob that shows the mark of a robot is that one, and no other is" do
    # So near to each other that either could be the blob.
    [one, two] =
      for {id, y} <- [mag2: 0.1, mag3: -0.1], do: robot({:robot, id}, {3.0, y}, reference?: true)

    blob = blob({3.0, 0.0})

    seen = %Vision.Mark{
      family: :tag36h11,
      id: 12,
      at_ms: 0,
      x: blob.x,
      y: 150.0,
      corners: [],
      width: 320,
      height: 240
    }

    named = fn names ->
      in_sight = InSight.new(nil, Belief.new(@here), @here)
      belief = Belief.new(@here)
      pairs = Matching.pairs([one, two], [blob], belief, @here, 0.0, @view, in_sight, names)
      for %{mark: mark} <- pairs, do: mark.key
    end

    assert named.(%{}) == []
    assert named.(%{mag3: seen}) == [{:robot, :mag3}]
    assert named.(%{mag3: %{seen | x: 10.0}}) == []
    # Two marks in one blob do not tell which of the two robots it is.
    assert named.(%{mag2: seen, mag3: seen}) == []
    # It is another one, which none of the two is.
    assert named.(%{mag9: seen}) == []
  end

  test "a robot behind a wall of the plan is no blob, and no rival of another one" do
    # A wall at x = 2.5, from y = -2 to 0.4.
    cells =
      for j <- 0..79,
          i <- 0..79,
          into: <<>>,
          do: if(i == 65 and j in 20..43, do: <<1>>, else: <<0>>)

    plan = Nav.Grid.new(cells, {80, 80}, 0.1, {-4.0, -4.0}, closed?: false)
    hidden = robot(:mag2, {3.2, 0.0}, reference?: true)
    near = robot(:mag3, {3.0, 0.1}, reference?: true)
    blob = blob({3.0, 0.1})
    assert pairs([hidden, near], [blob]) == []
    assert [%{mark: %{key: :mag2}}] = matched([hidden], [blob], Belief.new(@here))
    assert matched([hidden], [blob], Belief.new(@here), plan) == []

    seen = robot(:mag3, {2.2, 0.1})
    belief = Belief.new(@here)
    assert [%{mark: %{key: :mag3}}] = matched([hidden, seen], [blob({2.2, 0.1})], belief, plan)
  end

  test "each robot is the blob where it is expected and as wide as it is" do
    robots = [robot(:mag2, {2.0, 0.6}), robot(:mag3, {3.0, -0.9})]
    blobs = [blob({3.0, -0.9}), blob({2.0, 0.6})]
    assert pairs(robots, blobs) == [{:mag2, 1, true}, {:mag3, 0, true}]
  end

  test "of two that stand in line the near one is seen" do
    robots = [robot(:mag2, {1.0, 0.0}), robot(:mag3, {2.0, 0.0})]
    assert pairs(robots, [blob({1.0, 0.0})]) == [{:mag2, 0, true}]
  end

  test "what may be either of two is neither, and so is what may be one that nothing is measured by" do
    assert pairs([robot(:mag2, {2.0, 0.1}), robot(:mag3, {2.2, -0.1})], [blob({2.0, 0.0})]) == []
    moving = robot(:mag3, {2.2, -0.1}, reference?: false)
    assert pairs([robot(:mag2, {2.0, 0.1}), moving], [blob({2.0, 0.0})]) == []
    assert pairs([robot(:mag2, {2.0, 0.1})], [blob({2.0, 0.0})]) == [{:mag2, 0, true}]
  end

  test "one of which nobody knows where it is may be anybody" do
    blobs = [blob({2.0, 0.0})]
    known = robot(:mag3, {3.0, 0.8}, reference?: false)
    assert pairs([robot(:mag2, {2.0, 0.1}), known], blobs) == [{:mag2, 0, true}]
    assert pairs([robot(:mag2, {2.0, 0.1}), %{known | sd: {1.0, 1.0, 0.0}}], blobs) == []
  end

  test "who is unsure of its place still sees nothing before it that stands behind it" do
    unsure = Frame.reframe(Belief.new(@here), {7.0, 0.0}, 0.0, 0.05)
    robots = [robot(:mag2, {1.0, 0.0}), robot(:mag3, {-1.0, 0.0})]
    assert pairs(robots, [blob({1.0, 0.1})], unsure) == [{:mag2, 0, true}]
  end

  test "a robot that may be either of two blobs is neither" do
    robots = [robot(:mag2, {2.0, 0.0})]
    assert pairs(robots, [blob({2.0, 0.1}), blob({2.0, -0.15})]) == []
  end

  test "what is half hidden, or several in one, tells a direction less surely, and no distance" do
    robots = [robot(:mag2, {1.0, 0.0})]
    whole = blob({1.0, 0.0})
    [%{slack: slack}] = matched(robots, [whole], Belief.new(@here))
    assert slack < 0.01

    for share <- [0.75, 1.3] do
      part = blob({1.0, 0.0}, 0.2, share)
      assert pairs(robots, [part]) == [{:mag2, 0, false}]
      [%{slack: slack}] = matched(robots, [part], Belief.new(@here))
      assert_in_delta slack, abs(share - 1) * :math.asin(0.2), 0.01
    end

    assert pairs(robots, [blob({1.0, 0.0}, 0.2, 0.5)]) == []
    assert pairs(robots, [blob({1.0, 0.0}, 0.2, 1.8)]) == []
  end

  test "a blob at the border, of another colour, or elsewhere is none" do
    robots = [robot(:mag2, {2.0, 0.0})]
    assert pairs(robots, [%{blob({2.0, 0.0}) | left: 0}]) == []
    assert pairs(robots, [%{blob({2.0, 0.0}) | right: 319}]) == []
    assert pairs(robots, [%{blob({2.0, 0.0}) | colour: "Y"}]) == []
    assert pairs(robots, [blob({2.0, 0.8})]) == []
    # Above and below it may be cut.
    assert pairs(robots, [%{blob({2.0, 0.0}) | bottom: 239, clipped?: true}]) != []
  end

  test "one that is unsure of itself looks farther" do
    robots = [robot(:mag2, {2.0, 0.0})]
    blobs = [blob({2.0, 0.8})]
    unsure = Frame.reframe(Belief.new(@here), {2.0, 5.0}, 0.2, 0.0)
    assert pairs(robots, blobs) == []
    assert pairs(robots, blobs, unsure) == [{:mag2, 0, true}]
  end
end
