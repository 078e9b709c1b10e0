defmodule Sim.Emulator.TurtleBot3Test do
  @moduledoc "The emulated board by the examples and rules of the fact sheet, as bytes and time."
  use ExUnit.Case, async: true
  alias Hal.Twist
  alias Sim.Emulator.TurtleBot3

  @ping "FFFFFD00C80300013BFA"
  @positions "FFFFFD00C8070002880008" <> "00835F"
  @beat "FFFFFD00C806000313000723A7"
  @torque "FFFFFD00C8060003950001" <> "4C2D"
  @ahead "FFFFFD00C81D0003" <> "96000A000000" <> String.duplicate("00", 20) <> "445F"

  defp board(options \\ []) do
    {:ok, core} = TurtleBot3.new(options, 0)
    core
  end

  defp hear(core, hex, at_ms), do: TurtleBot3.hear(core, Base.decode16!(hex), at_ms)

  defp said(core, at_ms) do
    {bytes, _wishes, core} = TurtleBot3.run(core, at_ms)
    {IO.iodata_to_binary(bytes), core}
  end

  # A driver that beats every 100 ms until then.
  defp beating(core, from_ms, until_ms) do
    Enum.reduce(from_ms..until_ms//100, core, fn at_ms, core ->
      core |> hear(@beat, at_ms) |> hear(@ahead, at_ms) |> said(at_ms) |> elem(1)
    end)
  end

  defp rolling, do: board() |> hear(@torque, 0) |> beating(0, 1_000)

  test "it answers the sheet's ping and read, and no frame for another" do
    {bytes, core} = board(counters: {5, -1}) |> hear(@ping, 0) |> said(0)
    assert <<0xFF, 0xFF, 0xFD, 0, 200, 7, 0, 0x55, 0, _model::16, _firmware, _crc::16>> = bytes
    {bytes, core} = core |> hear(@positions, 1) |> said(1)
    assert <<_::56, 0x55, 0, 5::little-32, -1::little-signed-32, _crc::16>> = bytes
    another = "FFFFFD00C90300013BFA"
    assert {"", _} = core |> hear(another, 2) |> said(2)
  end

  test "it obeys with torque and a heartbeat only" do
    assert board() |> hear(@ahead, 0) |> TurtleBot3.wheels(400) == Twist.zero()

    assert board() |> hear(@torque, 0) |> hear(@ahead, 0) |> TurtleBot3.wheels(400) ==
             Twist.zero()

    assert board() |> hear(@beat, 0) |> hear(@ahead, 0) |> TurtleBot3.wheels(400) == Twist.zero()
    core = board() |> hear(@torque, 0) |> hear(@beat, 0) |> hear(@ahead, 0)
    assert TurtleBot3.wheels(core, 400) == Twist.new(0.1, 0)

    assert board(motors: false) |> hear(@torque, 0) |> beating(0, 300) |> TurtleBot3.wheels(400) ==
             Twist.zero()
  end

  test "a heartbeat that is missing for 500 ms zeroes the velocity, whatever velocity was written" do
    core = rolling()
    for at_ms <- 1_100..1_500//100, do: assert(TurtleBot3.wheels(core, at_ms).linear == 0.1)
    core = hear(core, @ahead, 1_450)
    assert TurtleBot3.wheels(core, 1_499).linear == 0.1
    assert TurtleBot3.wheels(core, 1_600) == Twist.zero()
    # A look much later finds that they stood 50 ms of braking after that.
    assert {_, %{wheels: %{moved_ms: 1_550}}} = said(core, 9_000)
  end

  test "without torque the wheels stand" do
    off = "FFFFFD00C8060003950000" <> "49AD"
    core = rolling() |> hear(off, 1_010)
    assert core.counts.bad == 0
    assert TurtleBot3.wheels(core, 1_100) == Twist.zero()
  end

  test "a frame with a wrong CRC is none; one may be cut anywhere" do
    bad = String.replace(@torque, "4C2D", "4C2C")
    core = hear(board(), bad, 0)
    assert {core.torque?, core.counts.bad} == {false, 1}
    bytes = Base.decode16!(@torque)

    for cut <- 0..byte_size(bytes) do
      {first, second} =
        {binary_part(bytes, 0, cut), binary_part(bytes, cut, byte_size(bytes) - cut)}

      assert board()
             |> TurtleBot3.hear(first, 0)
             |> TurtleBot3.hear(second, 5)
             |> Map.get(:torque?)
    end
  end

  test "its counters wrap, its heading is its wheels', and moving disturbs its calibration" do
    core = board(counters: {0x7FFF_FFFF, 0}) |> hear(@torque, 0) |> beating(0, 1_000)
    {bytes, _core} = core |> hear(@positions, 1_000) |> said(1_000)
    assert <<_::56, 0x55, 0, left::little-signed-32, right::little-signed-32, _crc::16>> = bytes
    # 0.1 m/s for 1 s, less the 0.05 s of getting there at 2 m/s2.
    assert right == round(0.0975 / (2 * :math.pi() * 0.033) * 4096)
    assert left == 0x7FFF_FFFF + right - 0x1_0000_0000
    refute core.disturbed?
    calibrate = "FFFFFD00C80600033B0001" <> "17A5"
    {_bytes, core} = core |> hear(calibrate, 1_000) |> said(1_000)
    assert core.counts.bad == 0
    {_bytes, core} = said(core, 1_100)
    assert core.disturbed?
  end

  test "what is not in its table is refused, and wrong options are one line" do
    {bytes, _core} = board() |> hear("FFFFFD00C8060003" <> "000001" <> "4826", 0) |> said(0)
    assert <<_::56, 0x55, 7, _crc::16>> = bytes

    assert TurtleBot3.new([model: :truffle], 0) ==
             {:error,
              "turtlebot3 emulator option model: expected :burger or :waffle, got :truffle"}
  end
end
