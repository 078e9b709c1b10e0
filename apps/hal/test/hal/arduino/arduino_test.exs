defmodule Hal.ArduinoTest do
  @moduledoc "Lines and readings, by the numbers of the fact sheet; whole bases are in sim."
  use ExUnit.Case, async: true
  alias Hal.{Arduino, Twist}
  alias Hal.Arduino.Driver
  doctest Hal.Arduino

  @wheels [ticks: 3_000, wheel_radius: 0.05, wheel_base: 0.3]

  defp open(given \\ @wheels, before \\ nil) do
    {:ok, options} = Driver.options([port: "/dev/ttyACM0"] ++ given)
    {said, protocol} = Driver.new(options, before, 0)
    {IO.iodata_to_binary(said), protocol}
  end

  defp hear(protocol, bytes, at_ms) do
    {readings, [], protocol} = Driver.hear(protocol, bytes, at_ms)
    {readings, protocol}
  end

  defp say(protocol, twist, at_ms) do
    {said, protocol} = Driver.say(protocol, twist, true, at_ms)
    {IO.iodata_to_binary(said), protocol}
  end

  test "answers come in pieces, and a line that never ends is noise" do
    stream = "OK\r\n12 -7\r\nInvalid Command\r\n"

    for cut <- 0..byte_size(stream) do
      {first, rest} = Arduino.cut(binary_part(stream, 0, cut))
      {second, ""} = Arduino.cut(rest <> binary_part(stream, cut, byte_size(stream) - cut))
      assert first ++ second == [:ok, {:encoders, 12, -7}, :bad]
    end

    rest =
      Enum.reduce(1..100, "", fn _n, rest ->
        {[], rest} = Arduino.cut(rest <> "1111111")
        assert byte_size(rest) <= 64
        rest
      end)

    assert Arduino.cut(rest <> "\r\n1 2\r\n") == {[:bad, {:encoders, 1, 2}], ""}
  end

  test "it begins with a probe and a stop, which end what was half said" do
    assert {"\rb\r\rm 0 0\r", _protocol} = open()
  end

  test "a speed is the sheet's counts of both wheels, each 1/30 s, and the encoders are asked for ten times a second" do
    {_said, protocol} = open()
    counts = 0.2 / (2 * :math.pi() * 0.05) * 3_000 / 30
    {said, protocol} = say(protocol, Twist.new(0.2, 0), 50)
    assert said == "m #{round(counts)} #{round(counts)}\re\r"
    {said, protocol} = say(protocol, Twist.new(0, 1.0), 100)
    turn = round(0.15 / 0.2 * counts)
    assert said == "m -#{turn} #{turn}\r"
    {said, _protocol} = say(protocol, Twist.zero(), 150)
    assert said == "m 0 0\re\r"
  end

  test "the way is that of its encoders; a line opened again begins a new frame at the same place" do
    {_said, protocol} = open()
    {[odometry: first], protocol} = hear(protocol, "0 0\r\n", 100)
    {[odometry: second], protocol} = hear(protocol, "300 300\r\nOK\r\n", 200)
    assert_in_delta second.pose.x, 0.1 * 2 * :math.pi() * 0.05, 1.0e-9
    assert first.frame == second.frame
    {_said, again} = open(@wheels, Driver.keep(protocol))
    {[odometry: third], _protocol} = hear(again, "0 0\r\n", 5_000)
    assert third.pose == second.pose and third.frame != second.frame
  end

  test "an encoder that lost a digit is dropped, the next one goes on" do
    {_said, protocol} = open()
    {_, protocol} = hear(protocol, "100000 100000\r\n", 0)
    {[], protocol} = hear(protocol, "10000 100010\r\n", 100)
    {[odometry: odometry], protocol} = hear(protocol, "100020 100020\r\n", 200)
    assert_in_delta odometry.pose.x, 20 / 3_000 * 2 * :math.pi() * 0.05, 1.0e-9
    assert protocol.odometry.jumps == 0
  end

  test "three answers in a row that say nothing known stop it, until one does" do
    {_said, protocol} = open()
    {_, protocol} = hear(protocol, "x\r\n1 y\r\n", 0)
    assert Driver.able(protocol) == :ok
    {_, protocol} = hear(protocol, "Invalid Command\r\n", 0)
    assert {:error, "its answers say nothing" <> _} = Driver.able(protocol)
    {_, protocol} = hear(protocol, "OK\r\n", 0)
    assert Driver.able(protocol) == :ok
  end

  test "without measures of its wheels it reports, does not arm, and does not turn them" do
    {:ok, judged} = Driver.judge(port: "/dev/ttyACM0", ticks: 100)

    assert judged.ready ==
             {:error, "measures of its wheels are missing: wheel_radius, wheel_base"}

    {_said, protocol} = open([])
    assert {[report: :wheels], _protocol} = hear(protocol, "5 5\r\n", 0)
    assert {"m 0 0\re\r", _protocol} = say(protocol, Twist.zero(), 50)
  end

  test "wrong options are one line each" do
    for {wrong, line} <- [
          {[ticks: 0],
           "arduino option ticks: expected a whole number from 1 to 10000000 counts a turn, got 0"},
          {[wheel_radius: 33], "wheel_radius: expected a number from 0.005 to 1.0 m"},
          {[limits: [max_turn: 7]], "up to 6.0, what the body can do"}
        ] do
      assert {:error, said} = Driver.options([port: "/dev/ttyACM0"] ++ wrong)
      assert said =~ line
      refute said =~ "\n"
    end
  end
end
