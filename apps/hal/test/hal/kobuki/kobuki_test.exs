defmodule Hal.KobukiTest do
  @moduledoc "Bytes and readings, by the numbers of the fact sheet; whole bases are in sim."
  use ExUnit.Case, async: true
  alias Hal.{Kobuki, Profile, Twist}
  alias Hal.Kobuki.{Driver, Readings}
  doctest Hal.Kobuki

  defp core(more \\ %{}) do
    c = Map.merge(%{time: 100, bumpers: 0, drops: 0, cliffs: 0, left: 0, right: 0, over: 0}, more)
    angle = Map.get(more, :angle, 0)

    <<1, 15, c.time::little-16, c.bumpers, c.drops, c.cliffs, c.left::little-16,
      c.right::little-16, 0, 0, 0, 0, 158, c.over, 4, 7, angle::little-16, 0::40>>
  end

  defp run(payloads, senses \\ Readings.new(16, nil)) do
    payloads
    |> Enum.with_index()
    |> Enum.flat_map_reduce(senses, fn {payload, n}, senses ->
      Readings.packet(senses, payload, 20 * n)
    end)
  end

  @firmware <<11, 4, 0, 2, 1, 0>>

  test "packets are found, whatever is between them, cut anywhere" do
    stream =
      <<0xAA, 0x55, 2, 0xAA>> <>
        Kobuki.packet(core()) <> "junk" <> Kobuki.packet(<<99, 2, 0xAA, 0x55>>)

    for cut <- 0..byte_size(stream) do
      {first, rest} = Kobuki.cut(binary_part(stream, 0, cut))
      {second, <<>>} = Kobuki.cut(rest <> binary_part(stream, cut, byte_size(stream) - cut))
      assert first ++ second == [core(), <<99, 2, 0xAA, 0x55>>]
    end
  end

  test "a packet whose sum is wrong is none, and what begins inside it is found" do
    inner = Kobuki.packet(<<1, 1, 1>>)
    assert Kobuki.cut(<<0xAA, 0x55, 8, inner::binary, 0, 0>>) == {[<<1, 1, 1>>], ""}
    bad = binary_part(inner, 0, byte_size(inner) - 1) <> <<0>>
    assert Kobuki.cut(bad <> inner) == {[<<1, 1, 1>>], ""}
  end

  test "what waits is never longer than a packet" do
    {_found, rand} = {nil, :rand.seed_s(:exsss, 1)}

    Enum.reduce(1..300, {<<>>, rand}, fn _n, {rest, rand} ->
      {bytes, rand} = :rand.bytes_s(100, rand)
      {_payloads, rest} = Kobuki.cut(rest <> bytes)
      assert byte_size(rest) <= 258
      {rest, rand}
    end)
  end

  test "every speed is the sheet's way back to both wheels, but for rounding, and fits 16 bits" do
    for linear <- [-0.7, -0.05, 0.0, 0.1, 0.7, 99.0], turn <- [-3.1, -0.5, 0.0, 0.01, 2.0] do
      <<0xAA, 0x55, 6, 1, 4, speed::little-signed-16, radius::little-signed-16, _sum>> =
        Kobuki.speed(Twist.new(linear, turn))

      {left, right} =
        case radius do
          0 -> {speed, speed}
          1 -> {-speed, speed}
          r when r > 0 -> {speed * (r - 115) / (r + 115), speed}
          r -> {speed, speed * (r + 115) / (r - 115)}
        end

      if linear < 1 do
        assert_in_delta (left + right) / 2_000, linear, 0.006
        assert_in_delta (right - left) / 230, turn, 0.02
      else
        assert max(abs(left), abs(right)) <= 0x8000
      end
    end
  end

  test "the way is the wheels', the heading the gyro's, which wraps at a half turn or at 16 bits" do
    for {first, last, turn} <- [{17_900, -17_900, 2.0}, {32_700, -32_636, 2.0}, {0, -200, -2.0}] do
      payloads = [
        core(%{angle: first, left: 0xFFF0}),
        core(%{time: 120, left: 0x0010, right: 32, angle: last})
      ]

      {readings, senses} = run(payloads)
      [_first, odometry] = for {:odometry, odometry} <- readings, do: odometry
      assert_in_delta odometry.pose.x, 32 * 8.5292090e-5, 1.0e-6
      assert_in_delta odometry.pose.heading, turn * :math.pi() / 180, 1.0e-9
      assert_in_delta odometry.twist.linear, 32 * 8.5292090e-5 / 0.02, 1.0e-6
      assert {senses.odometry.jumps, senses.odometry.dropped} == {0, 0}
    end
  end

  test "a packet that comes twice counts once, and one with a wrong size not at all" do
    {readings, senses} = run([core(), core(), <<1, 14, 0::112>>, <<4, 200, 0>>])
    assert length(Keyword.get_values(readings, :odometry)) == 1
    assert senses.malformed == 2
  end

  test "a base that was switched off and on is at the same place, in a new frame" do
    payloads = [
      core(%{time: 30_000}),
      core(%{time: 30_020, left: 20, right: 20}),
      core(%{time: 5})
    ]

    {readings, senses} = run(payloads)
    [_, before, later] = Keyword.get_values(readings, :odometry)
    assert senses.odometry.jumps == 1
    assert before.pose == later.pose and before.frame != later.frame
  end

  test "battery and bumpers, on any body" do
    {readings, _senses} = run([core(%{bumpers: 7})])
    assert {:power, 15.8} in readings and {:bumpers, [0, 3, 13]} in readings
    {readings, _senses} = run([core(%{bumpers: 5})], Readings.new(6, nil))
    assert {:bumpers, [1, 5]} in readings
    {readings, _senses} = run([core(%{bumpers: 5})], Readings.new(0, nil))
    refute Keyword.has_key?(readings, :bumpers)
  end

  test "it may turn its wheels once its firmware is known, on its wheels, on a floor" do
    {_, senses} = run([core()])
    assert Readings.able(senses) == {:error, "its firmware's version is not known yet"}
    {_, senses} = run([@firmware], senses)
    assert Readings.able(senses) == :ok

    for {more, words} <- [
          {%{drops: 2}, "a wheel hangs in the air (left): put it down"},
          {%{drops: 3}, "a wheel hangs in the air (left, right): put it down"},
          {%{cliffs: 3}, "there is no floor before it (middle, right): take it from there"}
        ] do
      {_, senses} = run([core(Map.put(more, :time, 500))], senses)
      assert Readings.able(senses) == {:error, words}
    end

    for {version, words} <- [{<<123::little-16>>, :ok}, {<<10_101::little-16>>, :ok}],
        {_, senses} = run([<<11, 2, version::binary>>]),
        do: assert(Readings.able(senses) == words)

    {_, senses} = run([<<11, 4, 7, 0, 2, 0>>])
    assert {:error, "its firmware 2.0.7 speaks" <> _} = Readings.able(senses)
  end

  test "a motor without power is refused once a second, and is well again" do
    payloads = for n <- 0..60, do: core(%{time: 20 * n, over: 1})
    {readings, senses} = run(payloads)

    assert [{:refused, :drive, line}, {:refused, _, line}] =
             Enum.filter(readings, &match?({:refused, _, _}, &1))

    assert line =~ "left"
    {readings, _senses} = run([core(%{time: 9_000})], senses)
    assert {:obeyed, :drive} in readings
  end

  test "wheels that turn on the spot while the gyro does not slip" do
    slipping = for n <- 0..60, do: core(%{time: 20 * n, right: 40 * n})
    {readings, _senses} = run(slipping)

    assert [{:odd, "wheels and gyro differ: the wheels slip"}] =
             Enum.filter(readings, &match?({:odd, _}, &1))

    {readings, _senses} =
      run(
        for n <- 0..60,
            do:
              core(%{
                time: 20 * n,
                right: 40 * n,
                angle: round(n * 40 * 8.5292090e-5 / 0.23 * 18_000 / :math.pi())
              })
      )

    refute Keyword.has_key?(readings, :odd)
  end

  test "the driver asks for the version until it has come, and says every speed" do
    options = %{profile: nil}
    {bytes, protocol} = Driver.new(options, nil, 0)
    assert IO.iodata_to_binary(bytes) == Kobuki.speed(Twist.zero()) <> Kobuki.ask()
    {said, protocol} = Driver.say(protocol, Twist.new(0.1, 0), true, 500)
    assert said == Kobuki.speed(Twist.new(0.1, 0))
    {said, protocol} = Driver.say(protocol, Twist.new(0.1, 0), true, 1_000)
    assert IO.iodata_to_binary(said) == Kobuki.speed(Twist.new(0.1, 0)) <> Kobuki.ask()
    {[], [], protocol} = Driver.hear(protocol, Kobuki.packet(@firmware), 1_020)
    {said, _protocol} = Driver.say(protocol, Twist.zero(), true, 9_000)
    assert said == Kobuki.speed(Twist.zero())
  end

  test "wrong options are one line each" do
    for {wrong, line} <- [
          {[prt: 1], "kobuki option prt is not known"},
          {[limits: [max_linear: 0.8]],
           "limits.max_linear: expected a number above 0 and up to 0.7"},
          {[profile: Profile.magellan(), limits: [max_linear: 0.6]],
           "up to 0.5, what the body can do"},
          {[serial: [keep_alive_ms: 5_000]],
           "serial.keep_alive_ms: expected a whole number from 100 to 300"},
          {[], "port is missing"}
        ] do
      port = if wrong == [], do: [], else: [port: "/dev/kobuki"]
      assert {:error, said} = Driver.options(port ++ wrong)
      assert said =~ line
      refute said =~ "\n"
      assert Driver.judge(port ++ wrong) == {:error, said}
      assert_raise ArgumentError, said, fn -> Driver.init(port ++ wrong) end
    end

    assert {:ok, %{ready: :ok, senses: [], odd: []}} = Driver.judge(port: "/dev/kobuki")
    assert {:ok, %{odd: [odd]}} = Driver.judge(port: "/dev/kobuki", speed: 9600)
    assert odd =~ "115200 is usual"
    assert Driver.explain(:silent, port: "/dev/kobuki") =~ "/dev/kobuki: the base says nothing"
    assert Driver.explain(:enoent, port: "/dev/kobuki") == "/dev/kobuki: no such device"
  end
end
