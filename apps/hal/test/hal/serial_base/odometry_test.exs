defmodule Hal.SerialBase.OdometryTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, SerialBase}
  alias Hal.SerialBase.Odometry
  doctest Hal.SerialBase.Odometry
  doctest Hal.SerialBase.Options

  defp odometry(bits \\ 16), do: Odometry.new(bits, 0.001, 0.2, 1.0)

  defp report(left, right, at_ms, more \\ %{}) do
    usual = %{left: left, right: right, at_ms: at_ms}
    usual |> Map.merge(%{elapsed_ms: nil, turn: nil, restarted?: false}) |> Map.merge(more)
  end

  defp run(odometry, reports), do: Enum.map_reduce(reports, odometry, &Odometry.report(&2, &1))

  test "a square of a metre, over every wrap of its counters, ends where it began" do
    side = for n <- 1..20, do: {50 * n, 50 * n}
    # A quarter turn on the spot: each wheel goes 0.2 m * pi / 4 = 0.157 m.
    corner = for {l, r} <- [{-40, 40}, {-80, 80}, {-120, 120}, {-157, 157}], do: {l, r}

    {ways, _end} =
      Enum.flat_map_reduce(1..4, {65_000, 300}, fn _side, {left, right} ->
        ways = side ++ for {l, r} <- corner, do: {1_000 + l, 1_000 + r}
        {for({l, r} <- ways, do: {left + l, right + r}), {left + 843, right + 1_157}}
      end)

    reports =
      for {{left, right}, n} <- Enum.with_index([{65_000, 300} | ways]),
          do: report(Integer.mod(left, 65_536), Integer.mod(right, 65_536), 100 * n)

    {readings, odometry} = run(odometry(), reports)
    assert odometry.jumps + odometry.dropped == 0
    assert Pose.distance(List.last(readings).pose, {0.0, 0.0}) < 0.003
    assert abs(List.last(readings).pose.heading) < 0.01
    assert Enum.any?(readings, &(Pose.distance(&1.pose, {1.0, 1.0}) < 0.01))
  end

  test "a lost report loses no way, and a base's own clock and turn are believed" do
    {[_, reading], _} = run(odometry(), [report(0, 0, 0), report(100, 100, 300)])
    assert_in_delta reading.pose.x, 0.1, 1.0e-9
    more = %{elapsed_ms: 200, turn: 0.5}
    {[_, reading], _} = run(odometry(), [report(0, 0, 0), report(100, 100, 300, more)])
    assert_in_delta reading.twist.linear, 0.5, 1.0e-9
    assert_in_delta reading.twist.turn, 2.5, 1.0e-9
    assert reading.pose.heading == 0.5
  end

  test "one impossible report is dropped, and the next one goes on from the last" do
    reports = [report(0, 0, 0), report(9_000, 0, 50), report(10, 10, 100)]

    assert {[%{frame: frame}, nil, %{frame: frame, pose: pose}], odometry} =
             run(odometry(), reports)

    assert {odometry.dropped, odometry.jumps} == {1, 0}
    assert_in_delta pose.x, 0.01, 1.0e-9
  end

  test "counters that jumped are followed in a new frame, at the same place" do
    reports = [
      report(0, 0, 0),
      report(50, 50, 50),
      report(9_000, 9_000, 100),
      report(9_010, 9_010, 150)
    ]

    {[_, there, nil, then], odometry} = run(odometry(), reports)
    assert {odometry.dropped, odometry.jumps} == {1, 1}
    assert then.pose == there.pose and then.frame != there.frame
  end

  test "so are those of a base that has restarted, and those that may have wrapped unseen" do
    for {last, bits, jumps} <- [
          {report(1, 1, 100, %{restarted?: true}), 16, 1},
          {report(1, 1, 33_000), 16, 1},
          {report(1, 1, 33_000), 32, 0}
        ] do
      {[first, second], odometry} = run(odometry(bits), [report(0, 0, 0), last])
      assert odometry.jumps == jumps
      assert first.frame == second.frame == (jumps == 0)
    end
  end

  test "the lower of what maker and body allow" do
    makers = %{max_linear: 0.7, max_turn: 3.0, max_acceleration: 0.3, max_turn_acceleration: 3.5}
    able = SerialBase.Options.abilities(makers, Hal.Profile.magellan())
    assert able == %{makers | max_linear: 0.5, max_turn: 1.0, max_turn_acceleration: 1.0}
    assert SerialBase.Options.abilities(makers, nil) == makers
  end
end
