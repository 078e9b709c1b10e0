defmodule Sim.Emulator.CreateTest do
  @moduledoc "The emulated robot by the examples and rules of the fact sheet, as bytes and time."
  use ExUnit.Case, async: true
  alias Hal.Twist
  alias Sim.Emulator.Create

  defp robot(options \\ []) do
    {:ok, core} = Create.new(options, 0)
    core
  end

  defp hear(core, hex, at_ms), do: Create.hear(core, Base.decode16!(hex), at_ms)

  defp said(core, at_ms) do
    {bytes, _wishes, core} = Create.run(core, at_ms)
    {IO.iodata_to_binary(bytes), core}
  end

  # Awake and with power, at 50 ms.
  defp safe(options \\ []), do: robot(options) |> hear("80", 0) |> hear("83", 25) |> later(50)
  defp later(core, at_ms), do: core |> said(at_ms) |> elem(1)

  test "the sheet's commands are the sheet's speeds, in safe and full mode only" do
    for {hex, twist} <- [
          {"9100C800C8", {0.2, 0}},
          {"910064FF9C", {0, 0.1 / 0.1175}},
          {"8900C88000", {0.2, 0}},
          {"8900C87FFF", {0.2, 0}},
          {"8900640001", {0, 0.1 / 0.1175}},
          {"890064FFFF", {0, -0.1 / 0.1175}},
          {"8900C803E8", {0.2, 0.2}},
          {"917FFF7FFF", {0.5, 0}}
        ] do
      wheels = safe() |> hear(hex, 50) |> Create.wheels(1_000)
      assert_in_delta wheels.linear, elem(twist, 0), 1.0e-6
      assert_in_delta wheels.turn, elem(twist, 1), 1.0e-6
      assert robot() |> hear("80", 0) |> hear(hex, 50) |> Create.wheels(1_000) == Twist.zero()
      assert robot() |> hear("83" <> hex, 50) |> Create.wheels(1_000) == Twist.zero()
    end
  end

  test "a change of mode takes 20 ms, in which nothing is heard" do
    assert robot() |> hear("80", 0) |> hear("83", 19) |> Map.get(:mode) == 1
    assert robot() |> hear("80", 0) |> hear("83", 20) |> Map.get(:mode) == 2
  end

  test "a byte that is lost makes it take the next command for something else" do
    core = safe() |> hear("9100C800", 50) |> hear("9100000000", 100)
    # 00 91: the low byte of the left wheel is the opcode of the stop.
    assert_in_delta Create.wheels(core, 1_000).linear, (0.2 + 0.145) / 2, 1.0e-6
    # Passive, whatever it takes for data before.
    assert core |> hear("910000000080", 150) |> Create.wheels(1_000) == Twist.zero()
  end

  test "it does what it was told last for ever" do
    core = hear(safe(), "9100C800C8", 50)
    assert Create.wheels(core, 86_400_000) == Twist.new(0.2, 0)
  end

  test "the sheet's stream: a frame each 15 ms with a right sum, paused, going on" do
    core = safe(counters: {256, 272}) |> hear("940407232B2C", 50)
    {"", core} = said(core, 64)
    {frame, core} = said(core, 65)
    assert Base.encode16(frame) == "130A07002302" <> "2B01002C0110" <> "4E"
    {_frames, core} = said(core, 80)
    {"", core} = core |> hear("9600", 81) |> said(200)
    {frame, _core} = core |> hear("9601", 200) |> said(215)
    assert byte_size(frame) == 13
  end

  test "packets and groups have the sheet's sizes; way and turn are since they were read last" do
    for {group, size} <- [
          {0, 26},
          {1, 10},
          {2, 6},
          {3, 10},
          {4, 14},
          {5, 12},
          {6, 52},
          {100, 80},
          {101, 28},
          {106, 12},
          {107, 9}
        ] do
      {bytes, _core} = safe() |> Create.hear(<<142, group>>, 50) |> said(50)
      assert {group, byte_size(bytes)} == {group, size}
    end

    core = safe() |> hear("9100C80064", 50) |> later(1_050) |> hear("95021314", 1_050)
    {<<way::signed-16, turn::signed-16>>, core} = said(core, 1_050)
    # Their wheels get there at 2 m/s2.
    assert way == round(1_000 * (0.19 + 0.0975) / 2)
    assert turn == round((0.19 - 0.0975) / 0.235 * 180 / :math.pi())
    {<<0::16, 0::16>>, _core} = core |> hear("95021314", 1_050) |> said(1_050)
  end

  test "in safe mode it goes passive at a cliff under way, with a wheel in the air, on a charger; not in full" do
    for {what, bits} <- [cliffs: 4, drops: 8, charger: 2], mode <- ["83", "84"] do
      core = robot() |> hear("80", 0) |> hear(mode, 25) |> hear("9100C800C8", 50) |> later(500)
      core = core |> Create.set(what, bits) |> later(515)
      expected = if mode == "83", do: {1, Twist.zero()}, else: {3, Twist.new(0.2, 0)}
      assert {core.mode, Create.wheels(core, 1_000)} == expected
    end

    # A cliff behind a robot that goes backwards is not seen.
    core = safe() |> hear("91FF38FF38", 50) |> Create.set(:cliffs, 4) |> later(500)
    assert core.mode == 2
  end

  test "after 5 minutes without a command in passive mode it sleeps until it is switched on" do
    core = robot() |> hear("80", 0) |> hear("940123", 30) |> later(299_000)
    {_frame, core} = said(core, 300_029)
    assert core.mode == 1
    {"", core} = said(core, 300_030)
    core = core |> hear("80", 300_100) |> hear("83", 300_200)
    assert core.mode == :asleep
    assert core |> Create.restart(301_000) |> hear("80", 301_000) |> Map.get(:mode) == 1
    # Awake it stays in safe mode.
    assert safe() |> later(600_000) |> Map.get(:mode) == 2
  end

  test "a reset is text, and 5 s in which it hears nothing" do
    {text, core} = safe() |> hear("07", 50) |> said(50)
    assert text =~ "bl-start"
    assert core |> hear("80", 5_049) |> Map.get(:mode) == 0
    assert core |> hear("80", 5_050) |> Map.get(:mode) == 1
  end

  test "wrong options are one line" do
    assert Create.new([boot_ms: -1], 0) ==
             {:error,
              "create emulator option boot_ms: expected a whole number from 0 to 60000 ms, got -1"}
  end
end
