defmodule Sim.HazardsTest do
  @moduledoc "What a base senses of a danger stops its wheels, and disarms them until a person has looked."
  use ExUnit.Case, async: true
  import Hal.Lines, only: [eventually: 1]
  alias Hal.{Device, Twist}
  alias Sim.Emulator
  @moduletag :realtime
  @moduletag :tmp_dir

  defp rolling(context, driver, core) do
    link = Path.join(context.tmp_dir, "line")
    emulator = start_supervised!({Emulator, core: core, link: link})
    {driver, options} = driver
    driver = {driver, [port: link] ++ options}
    device = start_supervised!({Device, kind: :drive, driver: driver, arm: :manual})
    eventually(fn -> arm(device) == :ok end)
    eventually(fn -> drive(device, emulator).linear > 0.05 end)
    {emulator, device}
  end

  # As a person who has looked: a driver that gets no processor for 0.2 s loses its line.
  defp arm(device) do
    :ok = Device.acknowledge(device)
    Device.arm(device)
  end

  defp drive(device, emulator) do
    Device.drive(device, Twist.new(0.1, 0.0))
    Emulator.wheels(emulator)
  end

  # Though it is told to drive on; and when the danger is over, only a person makes it drive again.
  defp stands({emulator, device}, change, back, words) do
    :ok = Emulator.change(emulator, elem(change, 0), elem(change, 1))
    eventually(fn -> drive(device, emulator) == Twist.zero() end)
    assert Device.arming(device).state == :disarmed
    {:error, line} = Device.arm(device)
    assert line =~ words
    :ok = Emulator.change(emulator, elem(back, 0), elem(back, 1))
    eventually(fn -> Device.arming(device).why == nil end)
    for _ <- 1..10, do: assert(drive(device, emulator) == Twist.zero())
    eventually(fn -> arm(device) == :ok end)
    eventually(fn -> drive(device, emulator).linear > 0.05 end)
  end

  test "a Kobuki that is lifted, or at a stair", context do
    rolling = rolling(context, {Hal.Kobuki.Driver, []}, {Emulator.Kobuki, []})

    for {what, bits, words} <- [{:drops, 1, "hangs in the air (right)"}, {:cliffs, 6, "no floor"}],
        do: stands(rolling, {:set, [what, bits]}, {:set, [what, 0]}, words)
  end

  test "a TurtleBot3 that has no torque any more is given it again, and its watchdog is fed by orders only",
       context do
    driver = {Hal.TurtleBot3.Driver, calibrate: false}
    {emulator, device} = rolling(context, driver, {Emulator.TurtleBot3, []})
    %{counts: %{beats: beats}} = Emulator.core(emulator)
    assert beats > 0
    # The device's own watchdog, then that of the orders: no further heartbeat comes.
    eventually(fn -> Emulator.wheels(emulator) == Twist.zero() end)
    eventually(fn -> Emulator.core(emulator).beat_ms == nil end)
    eventually(fn -> arm(device) == :ok end)
    eventually(fn -> drive(device, emulator).linear > 0.05 end)
  end

  test "a TurtleBot3 does not arm while its gyro is calibrated", context do
    link = Path.join(context.tmp_dir, "line")
    emulator = start_supervised!({Emulator, core: {Emulator.TurtleBot3, []}, link: link})
    driver = {Hal.TurtleBot3.Driver, port: link}
    device = start_supervised!({Device, kind: :drive, driver: driver, arm: :manual})

    eventually(fn ->
      drive(device, emulator)
      match?({:error, "its gyro is being calibrated" <> _}, Device.arm(device))
    end)

    eventually(fn ->
      drive(device, emulator)
      Device.arm(device) == :ok
    end)

    assert %{disturbed?: false, still_ms: still_ms} = Emulator.core(emulator)
    assert System.monotonic_time(:millisecond) >= still_ms
  end

  test "a Create 2 that is lifted, at a stair, on its charger, or with a wheel that is stuck",
       context do
    rolling = rolling(context, {Hal.Create.Driver, []}, {Emulator.Create, []})

    for {what, bits, words} <- [
          {:drops, 4, "hangs in the air (right)"},
          {:cliffs, 6, "no floor under it (front left, front right)"},
          {:charger, 1, "on its charger"},
          {:overcurrent, 16, "draws too much current (left)"}
        ],
        do: stands(rolling, {:set, [what, bits]}, {:set, [what, 0]}, words)
  end
end
