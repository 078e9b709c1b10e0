defmodule Sim.Emulator.ArduinoTest do
  @moduledoc "The emulated base by the rules of the fact sheet, as bytes and time."
  use ExUnit.Case, async: true
  alias Hal.Twist
  alias Sim.Emulator.Arduino

  defp base(options \\ []) do
    {:ok, core} = Arduino.new(options, 0)
    core
  end

  defp said(core, at_ms) do
    {bytes, _wishes, core} = Arduino.run(core, at_ms)
    {IO.iodata_to_binary(bytes), core}
  end

  defp asked(core, text, at_ms), do: core |> Arduino.hear(text, at_ms) |> said(at_ms)

  # Counts of 1/30 s for 0.1 m/s, and the speed that these whole counts are.
  @counts 23
  @speed 23 * 30 / 1_440 * 2 * :math.pi() * 0.033

  test "it answers as the sheet says" do
    {"57600\r\n", core} = asked(base(), "b\r", 0)
    {"0 0\r\n", core} = asked(core, "e\r", 0)
    {"OK\r\n", core} = asked(core, "u 20:12:0:50\r", 0)
    {"Invalid Command\r\n", core} = asked(core, "fly\r", 0)
    {"", core} = asked(core, "\r\re", 0)
    {"0 0\r\n", _core} = asked(core, "\r", 5)
  end

  test "targets are counts per 1/30 s; the encoders count them, from a reset on" do
    {"OK\r\n", core} = asked(base(), "m #{@counts} #{@counts}\r", 0)
    assert_in_delta Arduino.wheels(core, 1_000).linear, @speed, 1.0e-9
    {encoders, core} = asked(core, "e\r", 1_000)
    # They get there at 2 m/s2.
    gone = round((@speed - @speed * @speed / 4) / (2 * :math.pi() * 0.033) * 1_440)
    assert encoders == "#{gone} #{gone}\r\n"
    {"OK\r\n0 0\r\n", _core} = asked(core, "r\re\r", 1_000)
    {"OK\r\n", core} = asked(base(), "m -10 10\r", 0)
    assert Arduino.wheels(core, 500).turn > 0
  end

  test "the wheels stop 2 s after the last command for them" do
    core = Arduino.hear(base(), "m 23 23\r", 0)
    {_encoders, core} = asked(core, "e\r", 1_900)
    assert Arduino.wheels(core, 1_999).linear > 0.09
    # A look much later finds that they stood when they had braked.
    {_bytes, core} = said(core, 60_000)
    assert core.wheels.moved_ms == 2_000 + round(@speed / 2 * 1_000)
    assert Arduino.wheels(core, 60_000) == Twist.zero()
    core = base() |> Arduino.hear("m 23 23\r", 0) |> Arduino.hear("m 23 23\r", 1_500)
    assert Arduino.wheels(core, 3_400).linear > 0.09
  end

  test "a stop behind half a command is heard, and noise is bounded" do
    core =
      base()
      |> Arduino.hear("m 23 23\r", 0)
      |> Arduino.hear("m 2", 100)
      |> Arduino.hear("\rm 0 0\r", 110)

    assert Arduino.wheels(core, 1_000) == Twist.zero()
    core = Arduino.hear(base(), :binary.copy("x", 10_000), 0)
    assert byte_size(core.line) == 32
  end

  test "it hears nothing while it starts, and has forgotten all" do
    core = base(boot_ms: 2_000)
    assert {"", _core} = asked(core, "b\r", 1_999)
    assert {"57600\r\n", core} = asked(core, "b\r", 2_000)
    core = core |> Arduino.hear("m 23 23\r", 2_000) |> Arduino.restart(3_000)
    assert Arduino.wheels(core, 3_500) == Twist.zero()
    assert {"0 0\r\n", _core} = asked(core, "e\r", 5_000)
  end

  test "wrong options are one line" do
    assert {:error, "arduino emulator option ticks: expected" <> _} = Arduino.new([ticks: 0], 0)
  end
end
