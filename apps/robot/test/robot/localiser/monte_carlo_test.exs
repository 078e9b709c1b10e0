defmodule Robot.Localiser.MonteCarloTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Robot.{Localiser, Percept, Room}
  alias Robot.Localiser.MonteCarlo
  alias Robot.Localiser.MonteCarlo.{Modes, Population, Readings, Sampling}
  alias Nav.Grid

  @size {6.0, 4.0}
  @start Pose.new(1.0, 1.0)
  @here Pose.new(0, 0)

  # Rooms of which no corner is like another one: a wall from below, and a pillar.
  @walls [{2.6, 0.0, 2.8, 1.6}, {4.4, 2.4, 4.9, 2.9}]
  @cell 0.05
  @border 4

  defp wall?({x, y}) do
    {width, height} = @size

    x < 0 or y < 0 or x >= width or y >= height or
      Enum.any?(@walls, fn {left, low, right, high} ->
        x >= left and x < right and y >= low and y < high
      end)
  end

  defp plan do
    {width, height} = @size
    {columns, rows} = {round(width / @cell), round(height / @cell)}
    at = &((&1 + 0.5) * @cell)

    cells =
      for j <- -@border..(rows + @border - 1),
          i <- -@border..(columns + @border - 1),
          into: <<>>,
          do: if(wall?({at.(i), at.(j)}), do: <<1>>, else: <<0>>)

    corner = {-@border * @cell, -@border * @cell}
    Grid.plan(cells, {columns + 2 * @border, rows + 2 * @border}, @cell, corner)
  end

  defp hear(%Pose{x: x, y: y, heading: heading}, cone) do
    for(k <- -2..2, do: ray(x, y, heading + k * cone / 4, 0.0)) |> Enum.min()
  end

  defp ray(x, y, angle, way) do
    at = {x + way * :math.cos(angle), y + way * :math.sin(angle)}
    if wall?(at) or way > 5.0, do: min(way, 5.1), else: ray(x, y, angle, way + 0.03)
  end

  defp percept(plan, truth, odometry, at_ms) do
    percept = Room.percept(@size, truth, odometry, at_ms, plan)

    ranges =
      for mount <- percept.profile.sonars,
          do: hear(Pose.compose(truth, mount), percept.profile.sonar_cone)

    %{percept | sonar: ranges}
  end

  # Drives in circles of 0.7 m; `lift` takes it to another place at a step, which its wheels do not count.
  defp drive(plan, localiser, from, steps, lift \\ nil) do
    step = Pose.new(0.05, 0.0, 0.07)

    Enum.reduce(1..steps, {from, @here, localiser, []}, fn k,
                                                           {truth, odometry, localiser, seen} ->
      truth = if lift && elem(lift, 0) == k, do: elem(lift, 1), else: Pose.compose(truth, step)
      odometry = Pose.compose(odometry, step)
      {percept, localiser} = Localiser.update(localiser, percept(plan, truth, odometry, 100 * k))
      {truth, odometry, localiser, [{k, truth, percept} | seen]}
    end)
    |> elem(3)
    |> Enum.reverse()
  end

  defp off({_k, truth, percept}), do: Pose.distance(percept.pose, Pose.point(truth))

  test "a robot that is lifted says that it is lost, and finds itself, with the same steps for the same seed" do
    plan = plan()
    elsewhere = Pose.new(3.6, 2.2, 2.0)

    run = fn seed ->
      drive(plan, Localiser.new(@start, nil, seed), @start, 360, {80, elsewhere})
    end

    for seed <- [1] do
      seen = run.(seed)
      {before, later} = Enum.split(seen, 79)
      assert Enum.all?(before, &(Percept.astray(elem(&1, 2)) == nil and off(&1) < 0.2))
      {lost_at, _truth, lost} = Enum.find(later, &(Percept.astray(elem(&1, 2)) != nil))
      assert lost_at < 130
      assert lost.uncertainty.lost? and lost.uncertainty.radius > 5.0
      assert Percept.astray(lost) =~ ~r/^lost: .* of what it hears fits the plan$/
      last = List.last(seen)
      assert elem(last, 2).uncertainty.place == :tracking
      refute elem(last, 2).uncertainty.lost?
      assert off(last) < 0.2
      # Never sure and wrong for longer than it takes to notice.
      after_lost = Enum.drop_while(later, &(elem(&1, 0) < lost_at))
      wrong = Enum.filter(after_lost, &(Percept.astray(elem(&1, 2)) == nil and off(&1) > 0.5))
      assert wrong == []
      assert seen == run.(seed)
    end
  end

  test "where two places fit it says so, and which, and does not choose" do
    plan = Room.plan(@size)
    step = Pose.new(0.05, 0.0, 0.07)

    run = fn ->
      Enum.reduce(1..330, {@start, @here, Localiser.new(@start), []}, fn k,
                                                                         {truth, odometry,
                                                                          localiser, seen} ->
        truth = if k == 80, do: Pose.new(4.4, 1.5, 1.0), else: Pose.compose(truth, step)
        odometry = Pose.compose(odometry, step)

        {percept, localiser} =
          Localiser.update(localiser, Room.percept(@size, truth, odometry, 100 * k, plan))

        {truth, odometry, localiser, [{k, truth, percept} | seen]}
      end)
    end

    {_truth, _odometry, _localiser, [{_k, _at, last} | _] = seen} = run.()
    # A rectangle is the same turned by half.
    assert {:ambiguous, "two places fit: here, or " <> _place} = last.uncertainty.place
    assert last.uncertainty.lost?
    lost_at = seen |> Enum.filter(&(Percept.astray(elem(&1, 2)) != nil)) |> List.last() |> elem(0)

    assert for({k, _truth, percept} <- seen, k > lost_at, Percept.astray(percept) == nil, do: k) ==
             []
  end

  test "a plan that once fitted for 3 m need not do so again when the corrections by walls have found it wrong" do
    plan = plan()
    step = Pose.new(0.05, 0.0, 0.07)

    {_truth, _odometry, %{monte_carlo: filter}} =
      Enum.reduce(1..90, {@start, @here, Localiser.new(@start)}, fn k,
                                                                    {truth, odometry, before} ->
        {truth, odometry} = {Pose.compose(truth, step), Pose.compose(odometry, step)}
        {_percept, now} = Localiser.update(before, percept(plan, truth, odometry, 100 * k))
        {truth, odometry, now}
      end)

    assert filter.fitted > 3.0
    assert {_pose, _variance} = MonteCarlo.estimate(%{filter | way: 0.0}, false)
    assert MonteCarlo.estimate(%{filter | way: 0.0, fitted: 0.0}, false) == nil
    assert {_pose, _variance} = MonteCarlo.estimate(%{filter | way: 0.0, fitted: 0.0}, true)
  end

  test "on a plan of another building it says nothing of itself" do
    seen = drive(Room.plan({12.0, 9.0}), Localiser.new(@start), @start, 200)
    assert Enum.uniq(for {_k, _truth, percept} <- seen, do: percept.uncertainty.place) == [nil]
  end

  test "without a plan it has no filter" do
    percept = %{Room.percept(@size, @start, @here, 0, nil) | grid: nil}
    {percept, localiser} = Localiser.update(Localiser.new(@start), percept)
    assert {percept.uncertainty.place, localiser.monte_carlo} == {nil, nil}
  end

  test "each pose is drawn as often as its weight says, up to one" do
    for _ <- 1..200 do
      weights = for _ <- 1..:rand.uniform(12), do: :rand.uniform(100) - 1
      weights = [1 + :rand.uniform(50) | weights]
      total = Enum.sum(weights)
      count = :rand.uniform(300)
      poses = Enum.to_list(1..length(weights))
      drawn = Sampling.draw(poses, weights, count, :rand.uniform(1_000_000))
      assert drawn |> Enum.map(&elem(&1, 1)) |> Enum.sum() == count

      for {pose, weight} <- Enum.zip(poses, weights) do
        copies = for {^pose, copies} <- drawn, do: copies
        assert abs(Enum.sum(copies) - count * weight / total) < 1
      end
    end
  end

  test "the mean heading of particles on both sides of half a turn is there" do
    poses = for h <- [3.1, -3.1, 3.05, -3.05], do: {{1.0, 1.0, h, 0.0}, 1}
    assert [%{share: 1.0, pose: pose, variance: {_, _, _, heading}}] = Modes.find(poses)
    assert abs(Pose.wrap(pose.heading - :math.pi())) < 1.0e-9
    assert heading < 0.01
  end

  test "with one range it is where all poses of a grid are by their likelihoods" do
    plan = Room.plan(@size)
    percept = Room.percept(@size, Pose.new(1.5, 2.0, 0.0), @here, 0, plan)
    # The sonar to the rear alone: how far the left wall is.
    rear = Enum.find_index(percept.profile.sonars, &(abs(abs(&1.heading) - :math.pi()) < 0.01))
    only = for {range, k} <- Enum.with_index(percept.sonar), do: if(k == rear, do: range)
    {readings, 1} = Readings.pack(%{percept | sonar: only}, @start)
    look = %{grid: plan, readings: readings, counting: 1, draw: 11}

    xs = for k <- 0..400, do: 0.5 + k * 0.005
    packed = for x <- xs, into: <<>>, do: MonteCarlo.Reference.pack({x, 2.0, 0.0, 0.0})
    likely = for {sum, _} <- Population.weigh(packed, look), do: :math.exp(sum / 1_024)
    mean = Enum.sum(for {x, w} <- Enum.zip(xs, likely), do: x * w) / Enum.sum(likely)

    start = %{Population.near(@start, {0.1, 0.1}, 1, 1) | poses: packed}
    drawn = Population.drawn(start, <<>>, look, {4_000, 4_000})
    places = for {x, _, _, _} <- MonteCarlo.Reference.unpack(drawn.poses), do: x
    assert abs(Enum.sum(places) / length(places) - mean) < 0.03
  end
end
