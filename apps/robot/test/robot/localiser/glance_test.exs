defmodule Robot.Localiser.GlanceTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief, Columns, Frame, Glance}
  alias Robot.Localiser.Belief.Marks

  @view :math.pi() / 3

  defp any(least, most), do: least + (most - least) * :rand.uniform()
  defp place, do: {any(-6, 6), any(-6, 6)}

  defp mark do
    {spread, at} = {{any(0.1, 1.0), any(0.02, 0.1), any(-3, 3)}, place()}
    %{at: at, sd: spread, common: Anchors.common(spread, at, place())}
  end

  # A robot that drove, joined a frame, and saw others, whose common error is one of its own.
  defp belief do
    belief =
      Enum.reduce(1..20, Belief.new(Pose.new(0, 0)), fn _, belief ->
        Belief.move(belief, Pose.new(any(0, 0.3), 0, any(-0.5, 0.5)))
      end)

    belief = Frame.joined(belief, place(), any(0, 0.2), any(0, 0.02))

    Enum.reduce(1..3, belief, fn key, belief ->
      mark = mark()
      {belief, _at} = Marks.meet(belief, key, mark.at, mark.sd, mark.common)
      slope = {{any(-1, 1), any(-1, 1), -1.0}, {0.0, any(0, 3)}}
      Belief.correct(belief, key, any(-0.05, 0.05), slope, 0.001)
    end)
  end

  test "a direction is never more uncertain than the bound says" do
    for _ <- 1..300 do
      belief = belief()
      mark = %{at: {x, y}} = mark()
      {dx, dy} = {x - belief.pose.x, y - belief.pose.y}
      square = max(dx * dx + dy * dy, 0.09)
      exact = :math.sqrt(Belief.variance(belief, {dy / square, -dx / square, -1.0}, mark))
      glance = Glance.new(belief, belief.pose, 0.0, @view)
      assert Glance.most_sd(glance, mark, Pose.distance(belief.pose, mark.at)) >= exact - 1.0e-9
    end
  end

  test "what is beside the picture by more than its breadth fills no column" do
    for _ <- 1..2_000 do
      {pose, at} = {Pose.new(any(-1, 1), any(-1, 1), any(-3.1, 3.1)), place()}
      {pan, half} = {any(-1, 1), any(0, 0.6)}
      glance = Glance.new(Belief.new(pose), pose, pan, @view)
      camera = {pan, 59 / 2 / :math.tan(@view / 2)}
      filled = Columns.span(Pose.bearing(pose, at), half, camera)
      if Glance.aside(glance, at) > half, do: assert(Columns.empty?(filled))
    end
  end

  test "columns are counted one by one" do
    for _ <- 1..1_000 do
      set = :rand.uniform(0x7FFFFFFFFFFFFFF)
      assert Columns.count(set) == set |> Integer.digits(2) |> Enum.sum()
    end

    assert {Columns.count(0), Columns.count(0x7FFFFFFFFFFFFFF)} == {0, 59}
  end
end
