defmodule Hal.TurtleBot3Test do
  @moduledoc "Frames, readings and the order of requests, by the numbers of the fact sheet; whole bases are in sim."
  use ExUnit.Case, async: true
  alias Hal.{Profile, Twist}
  alias Hal.TurtleBot3.{Driver, Packet, Readings}
  doctest Hal.TurtleBot3.Packet

  @options %{model: :burger, calibrate: false}
  @speed_0_1 "FFFFFD00C81D0003" <> "96000A000000" <> String.duplicate("00", 20) <> "445F"

  defp reply(data, error \\ 0) do
    body =
      :binary.replace(<<0x55, error, data::binary>>, <<255, 255, 253>>, <<255, 255, 253, 253>>, [
        :global
      ])

    framed = <<0xFF, 0xFF, 0xFD, 0, 200, byte_size(body) + 2::little-16, body::binary>>
    framed <> <<Packet.crc(framed)::little-16>>
  end

  # The bytes 10 to 181 of the control table.
  defp table(more \\ %{}) do
    t =
      Map.merge(
        %{time: 0, status: 0, volts: 1190, heading: 0.0, left: 0, right: 0, torque: 1},
        more
      )

    {w, z} = {:math.cos(t.heading / 2), :math.sin(t.heading / 2)}

    <<t.time::little-32, 0::32, t.status::signed-8, 0::184, t.volts::little-32, 0::400,
      w::little-float-32, 0::64, z::little-float-32, 0::192, t.left::little-32,
      t.right::little-32, 0::40, t.torque, 0::256>>
  end

  defp run(tables, senses \\ Readings.new(0.16, nil)) do
    tables
    |> Enum.with_index()
    |> Enum.flat_map_reduce(senses, fn {table, n}, senses ->
      Readings.table(senses, table, 50 * n)
    end)
  end

  test "replies are found, whatever is between them, cut anywhere, with stuffed bytes" do
    data = <<1, 255, 255, 253, 7>>
    stream = <<255, 255, 253>> <> reply(data) <> "junk" <> reply(<<>>, 7)

    for cut <- 0..byte_size(stream) do
      {first, rest} = Packet.cut(binary_part(stream, 0, cut))
      {second, <<>>} = Packet.cut(rest <> binary_part(stream, cut, byte_size(stream) - cut))
      assert first ++ second == [{0, data}, {7, <<>>}]
    end
  end

  test "a wrong CRC is no reply, and what waits is never longer than a frame" do
    <<head::binary-size(8), _byte, rest::binary>> = reply(<<1, 2>>)
    assert Packet.cut(head <> "x" <> rest <> reply(<<3>>)) == {[{0, <<3>>}], ""}

    Enum.reduce(1..300, {<<>>, :rand.seed_s(:exsss, 1)}, fn n, {rest, rand} ->
      {bytes, rand} = :rand.bytes_s(40, rand)
      start = if rem(n, 3) == 0, do: <<255, 255, 253, 0, 200>>, else: <<>>
      {_replies, rest} = Packet.cut(rest <> start <> bytes)
      assert byte_size(rest) < 600
      {rest, rand}
    end)
  end

  test "the way is the wheels', over the wrap of their counters; the heading its own sensors'" do
    tables = [
      table(%{time: 0xFFFF_FFF0, left: 0x7FFF_FFF0, right: -8, heading: 3.1}),
      table(%{time: 34, left: 0x7FFF_FFF0 + 100 - 0x1_0000_0000, right: 92, heading: -3.1})
    ]

    {readings, senses} = run(tables)
    [_first, odometry] = Keyword.get_values(readings, :odometry)
    turn = 2 * :math.pi() - 6.2
    assert_in_delta odometry.pose.heading, turn, 1.0e-6
    way = 100 * 2 * :math.pi() * 0.033 / 4096
    assert_in_delta odometry.twist.linear, way / 0.05, 1.0e-6
    assert_in_delta odometry.twist.turn, turn / 0.05, 1.0e-4
    assert {senses.odometry.jumps, senses.odometry.dropped} == {0, 0}
    assert {:power, 11.9} in readings
  end

  test "what is no number is no heading; then the wheels say it" do
    junk = :binary.replace(table(), <<1.0::little-float-32>>, <<0xFFFF_FFFF::32>>)

    {readings, _} =
      run([
        junk,
        :binary.replace(
          table(%{time: 50, left: -50, right: 50}),
          <<1.0::little-float-32>>,
          <<0x7F80_0000::little-32>>
        )
      ])

    [_first, odometry] = Keyword.get_values(readings, :odometry)
    assert_in_delta odometry.pose.heading, 100 * 2 * :math.pi() * 0.033 / 4096 / 0.16, 1.0e-9
  end

  test "it may turn its wheels with motors and torque; no battery is no reading" do
    for {more, able} <- [
          {%{}, :ok},
          {%{status: -1}, {:error, "its motors are not connected to its board"}},
          {%{torque: 0}, {:error, "its motors have no torque"}}
        ] do
      {_readings, senses} = run([table(more)])
      assert Readings.able(senses) == able
    end

    {readings, _senses} = run([table(%{volts: 699})])
    refute Keyword.has_key?(readings, :power)
  end

  defp hear(protocol, bytes, at_ms) do
    {readings, said, protocol} = Driver.hear(protocol, bytes, at_ms)
    {readings, IO.iodata_to_binary(said), protocol}
  end

  defp say(protocol, twist, fresh?, at_ms) do
    {said, protocol} = Driver.say(protocol, twist, fresh?, at_ms)
    {IO.iodata_to_binary(said), protocol}
  end

  test "one request at a time: a stop first, torque, then speed, heartbeat and table each tick" do
    {said, protocol} = Driver.new(@options, nil, 0)
    assert IO.iodata_to_binary(said) == Packet.write(150, <<0::192>>)
    {[], said, protocol} = hear(protocol, reply(<<>>), 1)
    assert said == Packet.write(149, <<1>>)
    {[], "", protocol} = hear(protocol, reply(<<>>), 2)

    {said, protocol} = say(protocol, Twist.new(0.1, 0), true, 50)
    assert said == Base.decode16!(@speed_0_1)
    {[], said, protocol} = hear(protocol, reply(<<>>), 51)
    assert said == Packet.write(19, <<1>>)
    {[], said, protocol} = hear(protocol, reply(<<>>), 52)
    assert said == Packet.read(10, 172)
    {[odometry: _, power: _], "", protocol} = hear(protocol, reply(table()), 53)

    # The heartbeat is due each 100 ms, and never without a fresh order.
    {_speed, protocol} = say(protocol, Twist.new(0.1, 0), true, 100)
    {[], said, protocol} = hear(protocol, reply(<<>>), 101)
    assert said == Packet.read(10, 172)
    {_, "", protocol} = hear(protocol, reply(table(%{time: 50})), 102)
    {_speed, protocol} = say(protocol, Twist.zero(), false, 600)
    {[], said, _protocol} = hear(protocol, reply(<<>>), 601)
    assert said == Packet.read(10, 172)
  end

  test "a stop waits for no answer, and nothing waits for one for more than 20 ms" do
    {_said, protocol} = Driver.new(@options, nil, 0)
    {"", protocol} = say(protocol, Twist.new(0.1, 0), true, 15)
    {said, protocol} = say(protocol, Twist.new(0.1, 0), true, 20)
    assert said == Base.decode16!(@speed_0_1)
    {said, _protocol} = say(protocol, Twist.zero(), true, 21)
    assert said == Packet.write(150, <<0::192>>)
  end

  test "torque whose answer is lost is asked for again" do
    {_said, protocol} = Driver.new(@options, nil, 0)
    {_, torque, protocol} = hear(protocol, reply(<<>>), 1)
    {speed, protocol} = say(protocol, Twist.zero(), false, 50)
    assert speed == Packet.write(150, <<0::192>>)

    said =
      Enum.map_reduce(51..53, protocol, fn at_ms, protocol ->
        {_, said, protocol} = hear(protocol, reply(<<>>), at_ms)
        {said, protocol}
      end)
      |> elem(0)

    assert torque in said
  end

  test "it calibrates once, and again when its board has restarted" do
    {_said, protocol} = Driver.new(%{@options | calibrate: true}, nil, 0)
    {:error, line} = Driver.able(protocol)
    assert line =~ "its gyro is being calibrated"
    {_, _torque, protocol} = hear(protocol, reply(<<>>), 1)
    {_, calibrate, protocol} = hear(protocol, reply(<<>>), 2)
    assert calibrate == Packet.write(59, <<1>>)
    {_, _, protocol} = hear(protocol, reply(<<>>), 3)

    {able, protocol} =
      Enum.map_reduce([4_000, 5_002, 5_003], protocol, fn at_ms, protocol ->
        {_, _, protocol} = hear(protocol, reply(table(%{time: at_ms})), at_ms)
        {Driver.able(protocol) == :ok, protocol}
      end)

    assert able == [false, false, true]
    {_said, again} = Driver.new(%{@options | calibrate: true}, Driver.keep(protocol), 9_000)
    assert again.due == [:torque]
    {_, _, restarted} = hear(protocol, reply(table(%{time: 100})), 5_200)
    assert {:error, _still} = Driver.able(restarted)
    assert restarted.due == [:calibrate]
  end

  test "what the board refuses is told, and when it does it again" do
    {_said, protocol} = Driver.new(@options, nil, 0)
    {[{:refused, :drive, line}], _, protocol} = hear(protocol, reply(<<>>, 7), 1)
    assert line == "its board refuses what it is told (error 7)"
    # The highest bit warns of something, and refuses nothing.
    {[], _, protocol} = hear(protocol, reply(<<>>, 128), 2)
    {readings, _, _protocol} = hear(protocol, reply(table()), 3)
    assert {:obeyed, :drive} in readings
  end

  test "wrong options are one line each" do
    for {wrong, line} <- [
          {[model: :truffle],
           "turtlebot3 option model: expected :burger or :waffle, got :truffle"},
          {[limits: [max_linear: 0.3]], "up to 0.22, what the body can do"},
          {[calibrate: 1], "calibrate: expected true or false"}
        ] do
      assert {:error, said} = Driver.options([port: "/dev/ttyACM0"] ++ wrong)
      assert said =~ line
      refute said =~ "\n"
    end

    profile = %{Profile.magellan() | max_linear: 0.2}
    assert {:ok, %{limits: limits}} = Driver.options(port: "/dev/ttyACM0", profile: profile)
    assert {limits.max_linear, limits.max_turn} == {0.2, 1.0}
  end
end
