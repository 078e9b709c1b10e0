defmodule Sim.Emulator.KobukiTest do
  @moduledoc "The emulated base by the examples and rules of the fact sheet, as bytes and time."
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Twist}
  alias Sim.Emulator.Kobuki
  doctest Sim.Emulator.Wheels

  @stop "AA5506010400000000" <> "03"
  @ahead "AA5506010464000000" <> "67"
  @left "AA5506010473000100" <> "71"
  @bend "AA5506010402019001" <> "91"

  defp base(options \\ []) do
    {:ok, core} = Kobuki.new(options, 0)
    core
  end

  defp hear(core, hex, at_ms), do: Kobuki.hear(core, Base.decode16!(hex), at_ms)

  # Each report until then, as `{at_ms, bytes}`.
  defp run(core, until_ms, reports \\ []) do
    at_ms = Kobuki.next_ms(core)

    if at_ms > until_ms do
      {Enum.reverse(reports), core}
    else
      {bytes, _wishes, core} = Kobuki.run(core, at_ms)
      run(core, until_ms, [{at_ms, IO.iodata_to_binary(bytes)} | reports])
    end
  end

  defp counters(<<0xAA, 0x55, _, 1, 15, _::40, left::little-16, right::little-16, _::binary>>),
    do: {left, right}

  test "it reports every 20 ms, with the sheet's length and a right sum, and wraps soon" do
    {reports, _core} = run(hear(base(), @ahead, 0), 2_000)
    assert length(reports) == 100

    for {at_ms, <<0xAA, 0x55, 77, payload::binary-size(77), sum>>} <- reports do
      assert sum ==
               for(<<(byte <- <<77, payload::binary>>)>>,
                 reduce: 0,
                 do: (x -> Bitwise.bxor(x, byte))
               )

      <<1, 15, time::little-16, _::binary>> = payload
      assert time == rem(0xFF00 + at_ms, 0x10000)
    end

    assert {_at_ms, last} = List.last(reports)
    # 0.1 m/s for 2 s, less the 0.05 s of getting there at 2 m/s2.
    ticks = round((0.2 - 0.0025) / 8.5292090e-5)
    assert counters(last) == {rem(0xFF00 + ticks, 0x10000), rem(0xFF00 + ticks, 0x10000)}
  end

  test "the sheet's commands are the sheet's speeds" do
    for {hex, twist} <- [
          {@stop, {0, 0}},
          {@ahead, {0.1, 0}},
          {@left, {0, 1}},
          {@bend, {0.2, 0.5}}
        ] do
      wheels = base() |> hear(hex, 0) |> Kobuki.wheels(1_000)
      assert_in_delta wheels.linear, elem(twist, 0), 0.001
      assert_in_delta wheels.turn, elem(twist, 1), 0.005
    end
  end

  test "it does what it was told last for ever, and stops within the time of its wheels" do
    core = hear(base(), @ahead, 0)
    assert Kobuki.wheels(core, 3_600_000).linear == 0.1
    {_reports, core} = run(core, 1_000)
    {_reports, core} = core |> hear(@stop, 1_000) |> run(2_000)
    assert core.wheels.moved_ms == 1_050
    assert Kobuki.wheels(core, 2_000) == Twist.zero()
  end

  test "a command with a wrong sum is none, and a half one keeps the next from being heard" do
    core = hear(base(), "AA5506010464000000" <> "66", 0)
    assert Kobuki.wheels(core, 1_000) == Twist.zero()
    assert core.counts == %{packets: 0, bad: 1}
    # The first of two stops is the end of the half; the second one is heard.
    core = base() |> hear(@ahead, 0) |> hear("AA550601", 500) |> hear(@stop, 500)
    assert Kobuki.wheels(core, 1_000).linear == 0.1
    assert core |> hear(@stop, 500) |> Kobuki.wheels(1_000) == Twist.zero()
  end

  test "it tells its versions once when asked" do
    {reports, _core} = base() |> hear("AA5504090203000C", 0) |> run(60)
    assert [_, {_, second}, _] = reports
    [{_, first} | _] = reports
    assert :binary.match(first, <<10, 4, 4, 0, 1, 0, 11, 4, 0, 2, 1, 0>>) != :nomatch
    assert :binary.match(second, <<10, 4, 4, 0, 1, 0>>) == :nomatch
  end

  test "bumpers and cliffs only report; over 3 A the motors have no power" do
    core = base() |> hear(@ahead, 0) |> Kobuki.set(:cliffs, 2) |> Kobuki.set(:drops, 1)
    {[{_, report} | _], core} = core |> Kobuki.feel({:bumpers, [0, 13]}, 0) |> run(500)
    assert <<_::40, _time::16, 3, 1, 2, _::binary>> = report
    assert Kobuki.wheels(core, 500).linear == 0.1
    assert core |> Kobuki.set(:overcurrent, 1) |> Kobuki.wheels(1_000) == Twist.zero()
  end

  test "with a body its counters are the body's way, and it asks the body for its speed" do
    odometry = fn x, heading ->
      {:odometry, %Odometry{pose: Pose.new(x, 0, heading), twist: Twist.zero()}}
    end

    core = base(counters: {0, 0}) |> hear(@ahead, 0) |> Kobuki.feel(odometry.(1.0, 0.0), 0)
    {_reports, core} = run(core, 400)
    core = core |> Kobuki.feel(odometry.(1.1, 0.0), 410)
    {_bytes, _wishes, core} = Kobuki.run(core, 420)
    {wanted, _at_ms} = core.wheels.wished
    assert wanted == Twist.new(0.1, 0)
    assert_in_delta elem(core.wheels.gone, 0), 0.1, 1.0e-9
  end

  test "switched off and on it has forgotten all" do
    {_reports, core} = base() |> hear(@ahead, 0) |> run(500)
    core = Kobuki.restart(core, 600)
    assert Kobuki.wheels(core, 1_000) == Twist.zero()
    {[{_, report} | _], _core} = run(core, 700)
    assert counters(report) == {0xFF00, 0xFF00}
  end

  test "wrong options are one line" do
    assert Kobuki.new([clock: -1], 0) ==
             {:error,
              "kobuki emulator option clock: expected a whole number from 0 to 65535, got -1"}
  end
end
