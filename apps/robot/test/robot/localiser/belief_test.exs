defmodule Robot.Localiser.BeliefTest do
  use ExUnit.Case, async: true
  doctest Robot.Localiser.Anchors
  doctest Robot.Localiser.Belief
  doctest Robot.Localiser.Covariance
  doctest Robot.Localiser.History
  alias Hal.Pose
  alias Robot.Localiser.{Anchors, Belief, Covariance, Frame}
  alias Robot.Localiser.Belief.Marks

  # Numbers that look random, and are the same in every run.
  defp draws(seed), do: :rand.seed_s(:exsss, seed)

  defp normal(state, sd) do
    {x, state} = :rand.normal_s(state)
    {sd * x, state}
  end

  defp all_round(sd), do: {sd, sd, 0.0}

  test "the radius holds 95 of 100 errors, whether they lie along a line or all round" do
    for least <- [0.0, 0.3, 0.6, 1.0] do
      belief = %{
        Belief.new(Pose.new(0, 0))
        | covariance: Covariance.diagonal([1.0, least, 0.1, 0.0, 0.0, 0.0, 0.0])
      }

      radius = Anchors.radius(Belief.spread(belief))

      {within, _state} =
        Enum.reduce(1..20_000, {0, draws(7)}, fn _, {within, state} ->
          {x, state} = normal(state, 1.0)
          {y, state} = normal(state, least)
          {if(x * x + y * y <= radius * radius, do: within + 1, else: within), state}
        end)

      assert_in_delta within / 20_000, 0.95, 0.006
    end
  end

  test "one that knows all is within no radius at all" do
    sure = %{Belief.new(Pose.new(0, 0)) | covariance: Covariance.diagonal(List.duplicate(0.0, 7))}
    assert Anchors.radius(Belief.spread(sure)) == 0.0
  end

  test "what it is unsure of grows with the way and the turns, and is carried along by them" do
    start = Belief.new(Pose.new(0, 0))
    {standing, _, _} = Belief.sd(start)
    assert Belief.move(start, Pose.new(0, 0)) == start

    straight =
      Enum.reduce(1..100, start, fn _, belief -> Belief.move(belief, Pose.new(0.1, 0)) end)

    # However many steps it is told in.
    long = Enum.reduce(1..10, start, fn _, belief -> Belief.move(belief, Pose.new(1.0, 0)) end)

    for {a, b} <- Enum.zip(Tuple.to_list(Belief.sd(straight)), Tuple.to_list(Belief.sd(long))),
        do: assert_in_delta(a, b, 0.005)

    # 10 m by 0.02 rad of heading, and what the way adds.
    {worst, least, _} = Belief.sd(straight)
    assert worst > 0.2 and worst < 0.5
    assert least > standing and least < 0.06

    turned =
      Enum.reduce(1..63, start, fn _, belief -> Belief.move(belief, Pose.new(0, 0, 0.1)) end)

    # A whole turn, of which nobody knows by how many hundredths the wheels slip.
    {_, _, heading} = Belief.sd(turned)
    assert_in_delta heading, 0.055 * 6.3, 0.05
  end

  test "a mark that was told to be elsewhere is less sure, one far off is another one" do
    {belief, at} = Marks.meet(Belief.new(Pose.new(0, 0)), :mag2, {2.0, 0.0}, all_round(0.1))
    assert at == {2.0, 0.0}
    variance = fn belief -> belief.covariance |> List.last() |> List.last() end
    assert_in_delta variance.(belief), 0.01, 1.0e-9
    {belief, _} = Marks.meet(belief, :mag2, {2.0, 0.1}, all_round(0.1))
    assert_in_delta variance.(belief), 0.02, 1.0e-9
    {less, _} = Marks.meet(belief, :mag2, {2.0, 0.1}, all_round(0.3))
    assert_in_delta variance.(less), 0.02 + 0.08, 1.0e-9
    {surer, _} = Marks.meet(belief, :mag2, {2.0, 0.1}, all_round(0.05))
    assert_in_delta variance.(surer), 0.0025, 1.0e-9
    {other, at} = Marks.meet(belief, :mag2, {5.0, 0.0}, all_round(0.1))
    assert at == {5.0, 0.0}
    assert [%{told: ^at}] = other.marks
    assert_in_delta variance.(other), 0.01, 1.0e-9
  end

  test "there are never more marks than a filter can carry; the one seen least lately goes" do
    belief =
      Enum.reduce(1..20, Belief.new(Pose.new(0, 0)), fn k, belief ->
        {belief, _} = Marks.meet(belief, :first, {1.0, 0.0}, all_round(0.1))
        {belief, _} = Marks.meet(belief, k, {1.0 * k, 1.0}, all_round(0.1))
        belief
      end)

    assert Enum.map(belief.marks, & &1.key) |> Enum.sort() == [16, 17, 18, 19, 20, :first]
    assert length(belief.covariance) == 8 + 2 * 6
    assert Enum.all?(belief.covariance, &(length(&1) == 20))
    assert Marks.forget(belief).marks == []
    assert length(Marks.forget(belief).covariance) == 8
  end

  test "robots that are wrong alike are no independent witnesses, however many are seen" do
    start =
      Enum.reduce(1..9, Belief.new(Pose.new(0, 0)), fn _, belief -> Belief.doubt(belief) end)

    # Twenty robots, so that each is forgotten and told anew many times, seen ten times each.
    see = fn common ->
      Enum.reduce(1..200, start, fn k, belief ->
        {belief, _} = Marks.meet(belief, rem(k, 20), {2.0, 0.0}, all_round(0.1), common)
        Belief.correct(belief, rem(k, 20), 0.0, {{0.0, 1.0, 0.0}, {0.0, 0.0}}, 1.0e-4)
      end)
    end

    sd = fn belief -> :math.sqrt(Belief.variance(belief, {0.0, 1.0, 0.0})) end
    assert sd.(see.({0.0, 0.0})) < 0.03
    assert sd.(see.({0.0, 0.08})) > 0.08
    assert sd.(see.({0.0, 0.08})) < 0.1
    # Along x they may be wrong alike as they like: across, they are independent.
    assert sd.(see.({0.08, 0.0})) < 0.03

    # Where it stands beside them is known as well as if they were right.
    mark = %{sd: all_round(0.1), common: {0.0, 0.08}}
    between = Belief.variance(see.({0.0, 0.08}), {0.0, 1.0, 0.0}, mark)
    assert :math.sqrt(between) < 0.08
    # A heading alone is as unsure as it is.
    assert_in_delta Belief.variance(start, {0.0, 0.0, 1.0}, mark),
                    Belief.variance(start, {0.0, 0.0, 1.0}),
                    1.0e-9

    # In another frame it has nothing in common with anybody.
    apart = Belief.variance(Marks.forget(see.({0.0, 0.08})), {0.0, 1.0, 0.0}, mark)
    assert :math.sqrt(apart) > 0.12
  end

  test "a frame that is turned is turned for all who come into it: their places do not correct each other's" do
    leader = {6.0, 0.0}
    # Two robots beside each other, of which one has told its place; each knows its own as badly.
    join = &Frame.joined(Belief.new(Pose.new(0, 0)), leader, 0.0, &1 * &1)
    told = Belief.spread(join.(0.1))
    alike = Anchors.common(told, {0.0, 0.5}, leader)

    see = fn belief, common ->
      {belief, _} = Marks.meet(belief, :other, {0.0, 0.5}, told, common)
      Belief.correct(belief, :other, 0.0, {{0.0, 1.0, 0.0}, {0.0, 0.0}}, 1.0e-4)
    end

    sd = fn belief -> :math.sqrt(Belief.variance(belief, {0.0, 1.0, 0.0})) end
    independent = Frame.reframe(Belief.new(Pose.new(0, 0)), leader, 0.0, 0.01)
    assert_in_delta sd.(independent), sd.(join.(0.1)), 1.0e-9
    assert sd.(see.(independent, {0.0, 0.0})) < 0.75 * sd.(independent)
    assert sd.(see.(join.(0.1), alike)) > 0.85 * sd.(independent)
  end

  test "what turns about somebody moves on an arc: that is unsure towards it, too" do
    turned = Frame.reframe(Belief.new(Pose.new(0, 0)), {6.0, 0.0}, 0.0, 0.09)
    {across, along, direction} = Belief.spread(turned)
    assert_in_delta across, :math.sqrt(1.8 * 1.8 + 0.0009 + 0.75 * 0.09 * 0.09 * 36), 0.001
    assert_in_delta along, :math.sqrt(0.0009 + 0.75 * 0.09 * 0.09 * 36), 0.001
    assert_in_delta abs(direction), :math.pi() / 2, 0.001
  end

  test "nothing makes it lose itself in numbers, however unsure another is" do
    belief = Frame.reframe(Belief.new(Pose.new(0, 0)), {1.0e3, 0.0}, 1.0e12, 1.0e12)
    {worst, _, heading} = Belief.sd(belief)
    assert heading <= 1.01
    # 100 m by 1 rad, and by how much that arc bends.
    assert worst <= 1.01 * :math.sqrt(1.75) * 100
  end

  # Robots that drive about and see things at places which were told wrongly by as much as was said: the squares of
  # their errors, each in its own standard deviations, are 2 on average where x and y are as unsure as they say.
  test "it is as wrong as it says" do
    errors =
      for seed <- 1..100 do
        {errors, _state} = errors(seed)
        errors
      end

    mean = Enum.sum(errors) / 100
    assert mean > 1.0 and mean < 3.0
  end

  @places [a: {4.0, 0.0}, b: {0.0, 4.0}, c: {-3.0, -2.0}]

  defp errors(seed) do
    state = draws(seed)

    {told, state} =
      Enum.map_reduce(@places, state, fn {key, {x, y}}, state ->
        {dx, state} = normal(state, 0.1)
        {dy, state} = normal(state, 0.1)
        {{key, {x + dx, y + dy}}, state}
      end)

    {dx, state} = normal(state, 0.03)
    {dy, state} = normal(state, 0.03)
    {dh, state} = normal(state, 0.02)
    {slip, state} = normal(state, 0.055)
    run = {Pose.new(dx, dy, dh), Belief.new(Pose.new(0, 0)), state}

    {truth, belief, state} =
      Enum.reduce(1..150, run, fn k, {truth, belief, state} ->
        turn = 0.06 * :math.sin(k / 10)
        {noise, state} = normal(state, 0.05 * abs(turn))
        {way, state} = normal(state, 0.0005)
        truth = Pose.compose(truth, Pose.new(0.05 + way, 0, turn + slip * abs(turn) + noise))
        belief = Belief.move(belief, Pose.new(0.05, 0, turn))
        see(truth, belief, told, Enum.at([:a, :b, :c], rem(k, 3)), state)
      end)

    {square(truth, belief), state}
  end

  defp see(truth, belief, told, key, state) do
    {noise, state} = normal(state, 0.015)
    seen = Pose.bearing(truth, @places[key]) + noise
    {belief, {x, y}} = Marks.meet(belief, key, told[key], all_round(0.1))
    {dx, dy} = {x - belief.pose.x, y - belief.pose.y}
    square = dx * dx + dy * dy
    error = Pose.wrap(seen - Pose.bearing(belief.pose, {x, y}))
    slope = {{dy / square, -dx / square, -1.0}, {0.0, 0.0}}
    {truth, Belief.correct(belief, key, error, slope, 0.015 * 0.015), state}
  end

  # (x, y) P^-1 (x, y)'.
  defp square(truth, %{pose: pose, covariance: [[xx, xy | _], [_, yy | _] | _]}) do
    {x, y} = {truth.x - pose.x, truth.y - pose.y}
    (yy * x * x - 2 * xy * x * y + xx * y * y) / (xx * yy - xy * xy)
  end
end
