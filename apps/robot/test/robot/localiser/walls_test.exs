defmodule Robot.Localiser.WallsTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Robot.{Localiser, Room}
  alias Robot.Localiser.{Anchors, Covariance, PlanFilter}

  setup do
    :rand.seed(:exsss, 1)
    :ok
  end

  @size {6.0, 4.0}
  @start Pose.new(1.0, 1.0)
  @corners [{5.0, 1.0}, {5.0, 3.0}, {1.0, 3.0}, {1.0, 1.0}]

  # Drives round the room on wheels that slip as those of a skid-steered base do (R74): true poses, and those of odometry.
  defp drive(rounds) do
    List.duplicate(@corners, rounds)
    |> Enum.concat()
    |> Enum.reduce({@start, Pose.new(0, 0), []}, &leg/2)
    |> elem(2)
    |> Enum.reverse()
  end

  defp leg(corner, {pose, odometry, track}) do
    bearing = Pose.bearing(pose, corner)

    cond do
      Pose.distance(pose, corner) < 0.05 -> {pose, odometry, track}
      abs(bearing) > 0.05 -> leg(corner, step(pose, odometry, track, 0.0, bearing))
      true -> leg(corner, step(pose, odometry, track, 0.05, 0.0))
    end
  end

  defp step(pose, odometry, track, way, bearing) do
    turn = bearing |> max(-0.1) |> min(0.1)
    slip = if turn > 0.0, do: 1.055, else: 0.945
    pose = Pose.compose(pose, Pose.new(way, 0.0, turn))
    odometry = Pose.compose(odometry, Pose.new(way, 0.0, turn / slip + 0.003 * :rand.normal()))
    {pose, odometry, [{pose, odometry} | track]}
  end

  # How far the estimate is from the truth at the end, and whether it says so.
  defp follow(track, plan, localiser \\ Localiser.new(@start)) do
    {percept, localiser} =
      track
      |> Enum.with_index()
      |> Enum.reduce({nil, localiser}, fn {{pose, odometry}, k}, {_percept, localiser} ->
        Localiser.update(localiser, Room.percept(@size, pose, odometry, 100 * k, plan))
      end)

    {pose, _odometry} = List.last(track)
    {Pose.distance(percept.pose, pose), percept.uncertainty.radius, localiser}
  end

  test "stays within 15 cm past known walls where dead reckoning is off by metres" do
    for _ <- 1..3 do
      track = drive(2)
      {off, radius, localiser} = follow(track, Room.plan(@size))
      {dead, _radius, _localiser} = follow(track, nil)
      assert dead > 0.5
      assert off < 0.15
      assert radius < 0.3
      assert localiser.walls.trust.trusted?
    end
  end

  # With seed 13 two walls of the larger plan fit for a metre at the end.
  test "with a wrong plan it finds out, and says how far off it may be" do
    for seed <- [1, 7, 11, 13], size <- [{9.0, 4.6}, {4.8, 7.0}] do
      :rand.seed(:exsss, seed)
      track = drive(2)
      {off, radius, localiser} = follow(track, Room.plan(size))
      {dead, dead_radius, _localiser} = follow(track, nil)

      # A plan that was right for a while may be that of another building, or the robot may have been carried away.
      assert localiser.lost? or not localiser.walls.trust.trusted?
      assert off < radius
      assert radius > 0.8 * dead_radius
      # Without the plan it goes on by dead reckoning.
      if not localiser.lost?, do: assert(off < dead + 0.2)
    end
  end

  test "a pose that has become vague is corrected again once readings show that it was right, and no other" do
    {once, again} = Enum.split(drive(2), length(drive(1)))
    {_off, _radius, localiser} = follow(once, Room.plan(@size))

    vague = fn pose, belief ->
      covariance = Covariance.add(belief.covariance, [9.0, 9.0, 0.01])
      %{belief | pose: pose, covariance: covariance}
    end

    right = update_in(localiser.belief, &vague.(&1.pose, &1))
    {off, radius, _localiser} = follow(again, Room.plan(@size), right)
    assert off < 0.2 and radius < 0.5

    # It may find its place, or know that it has not.
    wrong =
      update_in(
        localiser.belief,
        &vague.(Pose.new(&1.pose.x + 1.3, &1.pose.y + 0.9, &1.pose.heading), &1)
      )

    {off, radius, _localiser} = follow(again, Room.plan(@size), wrong)
    assert off < radius
  end

  test "who knows its place by the plan is not turned into the frame of a leader that does, too" do
    {_off, _radius, localiser} = follow(drive(1), Room.plan(@size))
    zeros = %{base: nil, at: {25.0, 1.0}, drift: {0.0, 0.0, 0.0}, slip: 0.0, key: {:mag1, 1, 1}}

    worst = fn localiser, heading ->
      sure = %{position: 1.0e-4, heading: heading, start: {1.0e-4, heading}}
      led = Localiser.anchors(localiser, %Anchors{frame: Map.merge(zeros, sure)})
      led.belief |> Localiser.Belief.sd() |> elem(0)
    end

    assert worst.(localiser, 0.01) < 0.2
    assert worst.(localiser, 0.04) > 2.0
    assert worst.(%{localiser | plan?: false}, 0.01) > 2.0
  end

  test "corrects a follower of a leader that knows its place by the plan, and of no other" do
    track = drive(2)

    frame = fn sd ->
      zeros = %{base: nil, at: {1.0, 2.0}, drift: {0.0, 0.0, 0.0}, slip: 0.0}
      sure = %{position: sd * sd, heading: 1.0e-4, start: {sd * sd, 1.0e-4}}
      Map.merge(zeros, Map.put(sure, :key, {:mag1, 1, 1}))
    end

    [near, far] =
      for sd <- [0.05, 0.4] do
        {_first, localiser} =
          Localiser.update(
            Localiser.new(@start),
            Room.percept(@size, @start, Pose.new(0, 0), 0, nil)
          )

        localiser = Localiser.anchors(localiser, %Anchors{frame: frame.(sd)})
        {_off, radius, localiser} = follow(track, Room.plan(@size), localiser)
        {radius, localiser.walls}
      end

    assert {radius, %{at: %Pose{}}} = near
    assert radius < 0.3
    # It is as vague as the leader is.
    assert {radius, %{at: nil}} = far
    assert radius > 0.8
  end

  test "one that knows its place by the plan is as sure of it among robots that know theirs less" do
    {_off, radius, localiser} = follow(drive(1), Room.plan(@size))
    at = {localiser.belief.pose.x - 4.0, localiser.belief.pose.y}
    sure = %{position: 1.0e-4, heading: 1.0e-4, start: {1.0e-4, 1.0e-4}}
    zeros = %{base: nil, at: at, drift: {0.0, 0.0, 0.0}, slip: 0.0, key: {:mag1, 1, 1}}
    {x, y} = at
    ahead = %{kind: :robot, reference?: true, at: {x + 2.0, y}, sd: {1.5, 1.5, 0.0}}
    anchors = %Anchors{frame: Map.merge(zeros, sure), marks: [ahead]}
    {by_plan, _, _} = PlanFilter.spread(%{localiser | anchors: anchors})
    {swung, _, _} = PlanFilter.spread(%{localiser | anchors: anchors, monte_carlo: nil})
    assert radius < 0.3 and by_plan < 0.2
    assert swung > 1.0
  end

  test "one that leads is set right by the filter of the plan, seldom and at once, not by each wall" do
    track = drive(1)
    leads = Localiser.anchors(Localiser.new(@start), %Anchors{walls?: false})
    {off, radius, localiser} = follow(track, Room.plan(@size), leads)
    {dead, vague, _localiser} = follow(track, nil)
    assert dead > 0.5 and vague > 1.0
    assert off < 0.1 and radius < 0.3
    assert localiser.walls.at == nil
    # Those that follow turn with it each time.
    assert localiser.frame_no in 1..5
  end
end
