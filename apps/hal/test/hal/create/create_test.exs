defmodule Hal.CreateTest do
  @moduledoc "Commands, frames and readings, by the numbers of the fact sheet; whole bases are in sim."
  use ExUnit.Case, async: true
  alias Hal.{Create, Twist}
  alias Hal.Create.{Driver, Readings}
  doctest Hal.Create

  defp report(more \\ %{}) do
    {[report], ""} = Create.cut(Create.frame(Map.merge(%{mode: 2, millivolts: 15_500}, more)))
    report
  end

  # A frame each 60 ms.
  defp run(reports, senses \\ Readings.new(8, nil)) do
    reports
    |> Enum.with_index()
    |> Enum.flat_map_reduce(senses, fn {report, n}, senses ->
      Readings.report(senses, report, 60 * n)
    end)
  end

  test "frames are found, whatever is between them, cut anywhere; 13 is in them, too" do
    one = Create.frame(%{mode: 2, left: 0x1319, right: 0x1313, bumps_drops: 0x13})
    two = Create.frame(%{mode: 1})
    stream = <<0x13>> <> "bl-start\r\n" <> one <> <<0x13, 25>> <> two

    for cut <- 0..byte_size(stream) do
      {first, rest} = Create.cut(binary_part(stream, 0, cut))
      {second, left} = Create.cut(rest <> binary_part(stream, cut, byte_size(stream) - cut))
      # The false start before the last frame holds it up until more comes.
      {third, ""} = Create.cut(left <> <<0, 0>>)
      assert [%{left: 0x1319, right: 0x1313, mode: 2}, %{mode: 1}] = first ++ second ++ third
    end
  end

  test "a wrong sum, length or order of packets is no frame, and what waits is never longer than one" do
    frame = Create.frame(%{mode: 2})
    <<0x13, n, id, rest::binary>> = frame
    size = byte_size(frame) - 1
    <<head::binary-size(size), sum>> = frame
    assert Create.cut(head <> <<sum + 1>> <> frame) == {[report(%{millivolts: 0})], ""}
    assert Create.cut(<<0x13, n + 1, id, rest::binary>>) == {[], ""}
    <<other, _same, last::binary>> = rest
    swapped = <<0x13, n, id + 1, other - 1, last::binary>>
    assert {[], _rest} = Create.cut(swapped)

    Enum.reduce(1..300, {<<>>, :rand.seed_s(:exsss, 1)}, fn _n, {rest, rand} ->
      {bytes, rand} = :rand.bytes_s(40, rand)
      {_reports, rest} = Create.cut(rest <> bytes <> <<0x13, n>>)
      assert byte_size(rest) <= n + 3
      {rest, rand}
    end)
  end

  test "no wheel is told more than 0.5 m/s, and the bend stays" do
    for linear <- [-2.0, -0.3, 0.0, 0.4, 99.0], turn <- [-9.0, -1.0, 0.0, 3.0] do
      <<145, right::signed-16, left::signed-16>> = Create.speed(Twist.new(linear, turn))
      assert max(abs(left), abs(right)) <= 500

      assert_in_delta (left + right) * turn * 0.235,
                      2 * (right - left) * linear,
                      2 * (1 + abs(linear)) * (1 + abs(turn))
    end
  end

  test "the way is that of its counters, over their wrap" do
    reports = [
      report(%{left: 0xFFF0, right: 0xFFF0}),
      report(%{left: 50, right: 50}),
      report(%{left: 100, right: 116})
    ]

    {readings, senses} = run(reports)
    [_, straight, bent] = Keyword.get_values(readings, :odometry)
    assert_in_delta straight.pose.x, 66 * 4.44565e-4, 1.0e-9
    assert_in_delta straight.twist.linear, 66 * 4.44565e-4 / 0.06, 1.0e-9
    assert_in_delta bent.pose.heading, 16 * 4.44565e-4 / 0.235, 1.0e-9
    assert {senses.odometry.jumps, senses.odometry.dropped} == {0, 0}
    assert {:power, 15.5} in readings
  end

  test "frames between are signs of dangers only; after a silence the counters are in a new frame" do
    senses = Readings.new(8, nil)
    {[_ | _], senses} = Readings.report(senses, report(), 0)
    {[], senses} = Readings.report(senses, report(%{left: 9, bumps_drops: 4}), 15)
    assert {:error, _drop} = Readings.able(senses)
    {[{:odometry, first} | _], senses} = Readings.report(senses, report(%{left: 9, right: 9}), 60)
    {[{:odometry, later} | _], _} = Readings.report(senses, report(%{left: 99, right: 99}), 600)
    assert first.pose == later.pose and first.frame != later.frame
  end

  test "bumpers, on any body" do
    for {bits, count, pressed} <- [
          {0, 8, []},
          {1, 8, [7]},
          {2, 8, [1]},
          {3, 8, [0]},
          {1, 16, [14]}
        ] do
      {readings, _} = run([report(%{bumps_drops: bits})], Readings.new(count, nil))
      assert {:bumpers, pressed} in readings
    end

    {readings, _} = run([report(%{bumps_drops: 3})], Readings.new(0, nil))
    refute Keyword.has_key?(readings, :bumpers)
  end

  test "it may turn its wheels with power, on a floor, on its wheels, off its charger" do
    for {more, words} <- [
          {%{bumps_drops: 12}, "a wheel hangs in the air (left, right): put it down"},
          {%{cliff_left: 1, cliff_front_right: 1},
           "there is no floor under it (left, front right)"},
          {%{charger: 2}, "it is on its charger: take it off"},
          {%{overcurrent: 8}, "a wheel draws too much current (right): free it"},
          {%{mode: 1}, "it has left the mode in which it drives (passive)"},
          {%{mode: 3}, "(full)"}
        ] do
      {_, senses} = run([report(more)])
      assert {:error, line} = Readings.able(senses)
      assert line =~ words
    end

    {_, senses} = run([report()])
    assert Readings.able(senses) == :ok
    assert {:error, "it has not reported" <> _} = Readings.able(Readings.new(8, nil))
  end

  defp say(protocol, at_ms) do
    {said, protocol} = Driver.say(protocol, Twist.new(0.2, 0), true, at_ms)
    {IO.iodata_to_binary(said), protocol}
  end

  defp hear(protocol, report, at_ms) do
    {_readings, [], protocol} = Driver.hear(protocol, Create.frame(report), at_ms)
    protocol
  end

  test "it begins with a stop, asks for the stream, and for power once nothing is in the way" do
    {said, protocol} = Driver.new(%{profile: nil}, nil, 0)
    assert said == Create.stop()
    {said, protocol} = say(protocol, 50)
    assert said == Create.stream()
    # Nothing is known of it yet.
    {said, protocol} = say(protocol, 100)
    assert said == Create.speed(Twist.new(0.2, 0))
    protocol = hear(protocol, %{mode: 1, cliff_left: 1}, 110)
    {said, protocol} = say(protocol, 150)
    assert said == Create.speed(Twist.new(0.2, 0))
    protocol = hear(protocol, %{mode: 1}, 160)
    {said, protocol} = say(protocol, 200)
    assert said == Create.safe()
    {said, protocol} = say(protocol, 250)
    assert said == Create.speed(Twist.new(0.2, 0))
    {said, _protocol} = say(hear(protocol, %{mode: 1}, 690), 700)
    assert said == Create.safe()
    {said, _protocol} = say(hear(protocol, %{mode: 2}, 690), 700)
    assert said == Create.speed(Twist.new(0.2, 0))
  end

  test "a base that falls silent is set up again, every half a second" do
    {_said, protocol} = Driver.new(%{profile: nil}, nil, 0)
    {_stream, protocol} = say(protocol, 50)
    protocol = hear(protocol, %{mode: 2}, 100)

    {said, _protocol} =
      Enum.map_reduce(150..1_300//50, protocol, fn at_ms, protocol -> say(protocol, at_ms) end)

    assert Enum.count(said, &(&1 == Create.stop())) == 2
    assert Enum.count(said, &(&1 == Create.stream())) == 2
  end

  test "its last words are longer than what they may have to end" do
    assert byte_size(:binary.copy(Driver.stop_words(%{}), 2)) > byte_size(Create.stream()) + 5
  end
end
