defmodule Robot.Localiser.InSightTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Robot.Localiser.{Belief, Frame, InSight}
  alias Nav.Grid

  # A wall along x = 2 with a door of 1 m about y = 0.
  defp plan do
    cells =
      for j <- 0..79, i <- 0..79, into: <<>> do
        if i == 60 and abs(j - 39.5) > 5, do: <<1>>, else: <<0>>
      end

    Grid.new(cells, {80, 80}, 0.1, {-4.0, -4.0}, closed?: false)
  end

  defp mark(key, at), do: %{key: key, at: at, radius: 0.2}

  defp seen(marks, plan, belief) do
    in_sight = InSight.new(plan, belief, belief.pose)
    Enum.filter(marks, &InSight.seen?(in_sight, &1))
  end

  defp keys(marks), do: Enum.map(marks, & &1.key)

  @marks [ahead: {3.0, 0.0}, beside: {3.0, 1.3}, here: {1.0, 2.0}, edge: {3.0, 0.9}]

  test "a wall hides what is behind it, a door does not, nor what stands out beside it" do
    marks = for {key, at} <- @marks, do: mark(key, at)
    sure = Belief.new(Pose.new(0, 0))
    assert keys(seen(marks, plan(), sure)) == [:ahead, :here, :edge]
    assert keys(InSight.from(marks, plan(), {0.0, 0.0})) == [:ahead, :here, :edge]
    assert seen(marks, nil, sure) == marks
    assert InSight.from(marks, nil, {0.0, 0.0}) == marks
  end

  test "whoever may stand elsewhere may see others" do
    marks = for {key, at} <- @marks, do: mark(key, at)
    # 1.2 m to either side, by one standard deviation.
    unsure = Frame.reframe(Belief.new(Pose.new(0, 0)), {4.0, 0.0}, 0.0, 0.09)
    assert :beside in keys(seen(marks, plan(), unsure))
  end

  test "what is partly hidden, or may be, is not in sight as a whole" do
    marks = for {key, at} <- @marks, do: mark(key, at)

    whole = fn belief ->
      Enum.filter(marks, &InSight.whole?(InSight.new(plan(), belief, belief.pose), &1))
    end

    assert keys(whole.(Belief.new(Pose.new(0, 0)))) == [:ahead, :here]
    unsure = Frame.reframe(Belief.new(Pose.new(0, 0)), {4.0, 0.0}, 0.0, 0.09)
    assert keys(whole.(unsure)) == [:here]
    without = InSight.new(nil, unsure, unsure.pose)
    assert Enum.all?(marks, &InSight.whole?(without, &1))
  end

  test "places farther off, as many standard deviations as are asked for" do
    # Half a metre to either side by one of them.
    unsure = Frame.reframe(Belief.new(Pose.new(0, 0)), {4.0, 0.0}, 0.0, 0.0156)
    beside = mark(:beside, {3.0, 1.3})
    seen? = fn sds -> InSight.seen?(InSight.new(plan(), unsure, unsure.pose, sds), beside) end
    assert for(sds <- [[1.0], [1.25, 2.5]], do: seen?.(sds)) == [false, true]
    # What one of them does not reach, many may.
    sure = Frame.reframe(Belief.new(Pose.new(0, 0)), {4.0, 0.0}, 0.0, 0.0004)
    assert InSight.seen?(InSight.new(plan(), sure, sure.pose, [1.0, 12.0]), beside)
  end

  test "a place behind a wall is not one where the robot may be" do
    # In front of the wall and 3 m beside its door; one standard deviation of 1.2 m across it.
    unsure = Frame.reframe(Belief.new(Pose.new(1, 3)), {1.0, 7.0}, 0.0, 0.09)
    {_worst, _least, direction} = Belief.spread(unsure)
    assert abs(:math.cos(direction)) > 0.99
    behind = [mark(:behind, {3.5, 3.0})]
    assert seen(behind, plan(), unsure) == []
    assert seen(behind, plan(), %{unsure | pose: Pose.new(2.5, 3)}) == behind
    assert keys(seen([mark(:before, {0.0, 3.0})], plan(), unsure)) == [:before]
  end

  test "a robot at the same place, or in a wall, is an answer too" do
    for at <- [{0.0, 0.0}, {2.05, 3.0}, {9.0, 9.0}],
        do: assert(is_list(InSight.from([mark(:one, at)], plan(), {0.0, 0.0})))
  end
end
