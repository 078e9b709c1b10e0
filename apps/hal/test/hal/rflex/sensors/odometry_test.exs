defmodule Hal.RFlex.Sensors.OdometryTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Hal.RFlex.Sensors.Odometry

  @distance 31_387.0
  @angle 4654.2

  defp new, do: Odometry.new(@distance, @angle, 0.5, 1.0)

  defp axis(t, n, position, at_ms, options \\ []) do
    report = %{
      axis: n,
      timestamp: Keyword.get(options, :timestamp, at_ms),
      position: wrap(position),
      velocity: options[:velocity] || 0
    }

    Odometry.report(t, report, at_ms)
  end

  defp wrap(count) do
    <<count::signed-32>> = <<count::32>>
    count
  end

  defp both(t, way, bearing, at_ms, options \\ []) do
    {nil, t} = axis(t, 0, way, at_ms, options)
    axis(t, 1, bearing, at_ms, options)
  end

  # Drives `n` periods of 100 ms with these steps of the counters.
  defp drive(t, {way, bearing}, {dw, db}, n, from_ms) do
    Enum.reduce(1..n, {t, {way, bearing}, from_ms}, fn _, {t, {way, bearing}, at_ms} ->
      {odometry, t} = both(t, way + dw, bearing + db, at_ms)
      assert odometry
      {t, {way + dw, bearing + db}, at_ms + 100}
    end)
  end

  defp near(pose, x, y, heading, slack \\ 1.0e-3) do
    assert_in_delta pose.x, x, slack
    assert_in_delta pose.y, y, slack
    assert_in_delta Pose.wrap(pose.heading - heading), 0.0, slack
  end

  test "the first pair is the origin; the counters are nothing by themselves" do
    {odometry, _} = both(new(), -123_456, 7_890, 0)
    assert odometry == %Hal.Odometry{pose: Pose.new(0, 0), twist: Hal.Twist.zero()}
  end

  test "a metre ahead, and the speeds of the sheet" do
    {_, t} = both(new(), 0, 0, 0)
    {t, _, _} = drive(t, {0, 0}, {1569, 0}, 20, 100)
    near(t.pose, 20 * 1569 / @distance, 0, 0)
    {odometry, _} = both(t, 31_380, 0, 2200, velocity: 465)
    assert_in_delta odometry.twist.turn, 465 / @angle, 1.0e-9
    assert_in_delta odometry.twist.linear, 465 / @distance, 1.0e-9
  end

  test "a circle closes, by the heading halfway" do
    {_, t} = both(new(), 0, 0, 0)
    # 2 pi in 100 steps; a radius of 0.5 m.
    way = round(2 * :math.pi() * 0.5 * @distance / 100)
    turn = 2 * :math.pi() * @angle / 100

    {t, _} =
      Enum.reduce(1..100, {t, 0}, fn k, {t, driven} ->
        {odometry, t} = both(t, driven + way, round(k * turn), k * 100)
        if k == 50, do: near(odometry.pose, 0.0, 1.0, :math.pi(), 2.0e-3)
        {t, driven + way}
      end)

    near(t.pose, 0, 0, 0)
  end

  test "counters wrap at 32 bits, both ways" do
    for direction <- [1, -1], start <- [0x7FFF_FF00, -0x7FFF_FF00] do
      {_, t} = both(new(), start, start, 0)
      {t, _, _} = drive(t, {start, start}, {direction * 1000, 0}, 20, 100)
      near(t.pose, direction * 20_000 / @distance, 0, 0)
      {_, t} = both(new(), start, start, 0)
      {t, _, _} = drive(t, {start, start}, {0, direction * 300}, 20, 100)
      near(t.pose, 0, 0, direction * 6000 / @angle)
    end
  end

  test "lost frames cost nothing but the shape of that piece" do
    :rand.seed(:exsss, {5, 6, 7})
    {_, t} = both(new(), 0, 0, 0)

    t =
      Enum.reduce(1..300, t, fn k, t ->
        # The last is heard.
        heard = fn -> k == 300 or :rand.uniform() > 0.5 end
        t = if heard.(), do: elem(axis(t, 0, 500 * k, 100 * k), 1), else: t
        if heard.(), do: elem(axis(t, 1, 20 * k, 100 * k), 1), else: t
      end)

    whole = Enum.reduce(0..300, new(), fn k, t -> elem(both(t, 500 * k, 20 * k, 100 * k), 1) end)

    assert t.dropped == 0 and t.jumps == 0
    near(t.pose, whole.pose.x, whole.pose.y, whole.pose.heading, 0.02)
    assert_in_delta t.pose.heading, whole.pose.heading, 1.0e-9
  end

  test "whichever axis comes first: pairs are of one period" do
    {nil, t} = axis(new(), 1, 0, 50)
    {%{}, t} = axis(t, 0, 0, 50)
    {nil, t} = axis(t, 1, 10, 100)
    # Axis 0 of this period is lost; the next axis 0 belongs to the next period.
    {nil, t} = axis(t, 0, 1000, 200)
    {%{}, t} = axis(t, 1, 20, 200)
    {nil, t} = axis(t, 0, 1500, 300)
    {%{}, _} = axis(t, 1, 30, 300)
  end

  test "a jump that no limit allows is dropped and counted, and moves nothing" do
    {_, t} = both(new(), 0, 0, 0)
    {t, {way, _}, at_ms} = drive(t, {0, 0}, {1000, 0}, 10, 100)
    before = t.pose

    # A bit flipped in each of the upper bytes: of the way, of the bearing.
    for bit <- 16..31, n <- [0, 1] do
      last = if n == 0, do: way, else: 0
      {nil, hurt} = axis(t, n, Bitwise.bxor(last, Bitwise.bsl(1, bit)), at_ms)
      assert hurt.dropped == 1 and hurt.pose == before
      # The next sound ones go on as if nothing had been.
      {odometry, hurt} = both(hurt, way + 2000, 0, at_ms + 100)
      near(odometry.pose, (way + 2000) / @distance, 0, 0)
      assert hurt.jumps == 0
    end
  end

  # A report that lost a zero and has another one twice: its checksum fits, its numbers have moved by a byte.
  test "a wrong number within the limits costs no way, whatever was lost before and after it" do
    {_, t} = both(new(), 0, 0, 0)

    # 0.4 m/s: near its zero, where a number near zero may be a controller's that started again, and further on.
    for n <- [4, 10], lost <- 0..15, late <- 1..15, clock <- [0, 50_000_000] do
      {t, {way, _bearing}, at_ms} = drive(t, {0, 0}, {1255, 0}, n, 100)
      at_ms = at_ms + 100 * lost
      true_way = way + 1255 * (lost + 1)
      {odometry, t} = both(t, div(true_way, 256), 0, at_ms, timestamp: at_ms + clock)
      within? = odometry != nil

      {odometry, t} =
        Enum.reduce([late, late + 1], {odometry, t}, fn k, {_, t} ->
          both(t, true_way + 1255 * k, 0, at_ms + 100 * k)
        end)

      about = inspect({n, lost, late, clock, within?})
      assert t.jumps == 0, about
      assert_in_delta odometry.pose.x, (true_way + 1255 * (late + 1)) / @distance, 1.0e-6, about
    end
  end

  test "a speed that is none is dropped" do
    {_, t} = both(new(), 0, 0, 0)
    {nil, t} = axis(t, 0, 0, 100, velocity: 0x4000_0000)
    {nil, t} = axis(t, 1, 0, 100, velocity: -0x4000_0000)
    assert t.dropped == 2
  end

  test "a controller that starts again does not teleport the robot" do
    for way <- [150_000, 20_000, 4_000, -90_000],
        silence <- [500, 1500, 5000],
        clock? <- [true, false] do
      stamp = fn ms -> if clock?, do: ms, else: 0 end
      {_, t} = both(new(), way - 1000, 9000, 0, timestamp: stamp.(100_000))
      {_, t} = both(t, way, 9000, 100, timestamp: stamp.(100_100))
      before = t.pose

      # From zero on, and going.
      {t, furthest} =
        Enum.reduce(0..9, {t, 0.0}, fn k, {t, furthest} ->
          at_ms = 100 + silence + 100 * k
          {_, t} = both(t, 500 * k, 0, at_ms, timestamp: stamp.(100 * k))
          {t, max(furthest, Pose.distance(before, t.pose))}
        end)

      # What it has driven since, but for the first report or two.
      near(%{t.pose | y: 0.0}, before.x + 9 * 500 / @distance, 0, before.heading, 0.04)
      assert furthest < 9 * 500 / @distance + 0.01, inspect({way, silence, clock?})
      assert t.jumps == 2
    end
  end

  test "a line that was silent while the robot drove on: the counters tell how far" do
    {_, t} = both(new(), 100_000, 20_000, 0)
    {odometry, t} = both(t, 100_000 + 15_693, 20_000, 1500)
    near(odometry.pose, 0.5, 0, 0)
    assert t.dropped == 0
  end

  test "reports that were held up and come at once are all believed" do
    {_, t} = both(new(), 0, 0, 0)

    t =
      Enum.reduce(1..20, t, fn k, t ->
        {_, t} = both(t, 1569 * k, 0, 2000 + div(k, 10), timestamp: 100 * k)
        t
      end)

    assert t.dropped == 0
    near(t.pose, 20 * 1569 / @distance, 0, 0)
  end

  test "other axes are nobody's" do
    assert {nil, t} = axis(new(), 2, 7, 0)
    assert t == new()
  end

  test "unequal wheels go an arc where the counters say straight on" do
    t = Odometry.new(@distance, @angle, 0.5, 1.0, {0.36, 1.01})
    {t, _at, at_ms} = drive(t, {0, 0}, {0, 0}, 1, 0)
    {t, _at, _at_ms} = drive(t, {0, 0}, {round(0.03 * @distance), 0}, 100, at_ms)

    # (c_right - c_left) / b for each metre.
    way = 100 * round(0.03 * @distance) / @distance
    turn = way * (2 * 1.01 / 2.01 - 2 / 2.01) / 0.36
    assert_in_delta t.pose.heading, turn, 1.0e-4
    assert_in_delta t.pose.x, way * :math.sin(turn) / turn, 1.0e-4
    assert_in_delta t.pose.y, way * (1 - :math.cos(turn)) / turn, 1.0e-4
  end
end
