defmodule Hal.Drive.SlewLimiterTest do
  use ExUnit.Case, async: true
  alias Hal.Twist
  alias Hal.Drive.SlewLimiter
  doctest Hal.Drive.SlewLimiter

  @limits [max_linear: 0.5, max_turn: 1.0, max_acceleration: 0.5, max_turn_acceleration: 1.0]

  test "within its limits and its accelerations, whatever is asked for" do
    :rand.seed(:exsss, {1, 2, 3})
    ramp = SlewLimiter.new(@limits)

    Enum.reduce(1..20_000, ramp, fn _, before ->
      wanted = Twist.new(4 * :rand.uniform() - 2, 4 * :rand.uniform() - 2)
      wanted = if :rand.uniform(10) == 1, do: Twist.zero(), else: wanted
      seconds = 0.1 * :rand.uniform()
      {twist, ramp} = SlewLimiter.step(before, wanted, seconds)
      assert abs(twist.linear) <= 0.5 and abs(twist.turn) <= 1.0

      for {now, was, asked, rate} <- [
            {twist.linear, before.twist.linear, wanted.linear, 0.5},
            {twist.turn, before.twist.turn, wanted.turn, 1.0}
          ] do
        # Faster by the acceleration, slower by the braking; zero at once.
        assert abs(now) - abs(was) <= rate * seconds + 1.0e-9
        assert now == 0.0 or abs(was) - abs(now) <= 2 * rate * seconds + 1.0e-9
        # Not beyond what is asked for, never across zero.
        assert asked == 0.0 or now * was >= 0
        if asked == 0.0, do: assert(now == 0.0)
      end

      ramp
    end)
  end

  test "the limits are reached and not passed" do
    for {linear, turn} <- [{99.0, -99.0}, {-0.51, 1.01}] do
      speeds =
        Enum.scan(1..50, SlewLimiter.new(@limits), fn _, ramp ->
          elem(SlewLimiter.step(ramp, Twist.new(linear, turn), 0.1), 1)
        end)

      assert List.last(speeds).twist == Twist.new(0.5 * linear / abs(linear), turn / abs(turn))
      for %{twist: twist} <- speeds, do: assert(abs(twist.linear) <= 0.5 and abs(twist.turn) <= 1)
    end
  end

  test "it gets there" do
    {_twist, ramp} = SlewLimiter.step(SlewLimiter.new(@limits), Twist.new(0.3, -0.7), 0.1)

    ramp =
      Enum.reduce(1..50, ramp, fn _, ramp ->
        elem(SlewLimiter.step(ramp, Twist.new(0.3, -0.7), 0.1), 1)
      end)

    assert ramp.twist == Twist.new(0.3, -0.7)
    # And to the other side: 0.3 m/s at 1 m/s2, then 0.2 m/s at 0.5 m/s2.
    speeds =
      Enum.scan(1..8, ramp, fn _, ramp ->
        elem(SlewLimiter.step(ramp, Twist.new(-0.2, 0.0), 0.1), 1)
      end)

    expected = [0.2, 0.1, 0.0, -0.05, -0.1, -0.15, -0.2, -0.2]

    for {ramp, speed} <- Enum.zip(speeds, expected) do
      assert_in_delta ramp.twist.linear, speed, 1.0e-9
      assert ramp.twist.turn == 0.0
    end
  end

  test "a long pause is no leap" do
    {twist, _} = SlewLimiter.step(SlewLimiter.new(@limits), Twist.new(0.5, 1.0), 3600)
    assert_in_delta twist.linear, 0.1, 1.0e-9
    {twist, _} = SlewLimiter.step(SlewLimiter.new(@limits), Twist.new(0.5, 1.0), -5)
    assert twist == Twist.zero()
  end

  test "what is no speed is a stop" do
    {_, ramp} = SlewLimiter.step(SlewLimiter.new(@limits), Twist.new(0.5, 0.5), 0.1)

    for bad <- [
          %Twist{linear: :nan, turn: 0.0},
          %Twist{linear: 0.1, turn: nil},
          %Twist{linear: 1, turn: 0.0},
          %Twist{linear: 1.0e300, turn: 0.0},
          %Twist{linear: 0.0, turn: -1.0e7},
          :fast,
          nil
        ] do
      assert {:error, line} = SlewLimiter.check(bad)
      refute line =~ "\n"
      assert {stop, _} = SlewLimiter.step(ramp, bad, 0.1)
      assert Twist.zero?(stop)
    end
  end
end
