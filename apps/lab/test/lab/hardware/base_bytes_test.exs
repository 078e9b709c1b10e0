defmodule Lab.Hardware.BaseBytesTest do
  @moduledoc "The driver of real bases: its pauses between commands, escaped bytes, and counters at their ends."
  use Lab.BaseCase, async: true
  @moduletag :realtime

  # When they are written is looked at, not when they arrive: a busy machine hands the emulator the bytes of a pause at
  # once, however well they were spaced, and then it loses some.
  @tag base: [pace: {10, 1}]
  test "commands are far enough apart for a controller that accepts one in 10 ms",
       %{device: device} = context do
    :erlang.trace_pattern({Hal.Serial.Native, :write, 2}, true, [])
    :erlang.trace(device, true, [:call, :monotonic_timestamp])
    counts = fn -> Emulator.core(context.emulator).counts end
    drive(context, Twist.new(0.3, 0.2), &(&1.pose.x > -3.5 and counts.().frames > 100))
    stop(context)
    :erlang.trace(device, false, [:call])

    written = written([])
    gaps = Enum.zip_with(written, tl(written), &(&2 - &1))
    assert length(gaps) > 50
    assert Enum.min(gaps) > 10_000
    assert counts.().lost < counts.().frames
  end

  # The times (us) at which commands were written; a write of nothing is a sign of life.
  defp written(times) do
    receive do
      {:trace_ts, _device, :call, {Hal.Serial.Native, :write, [_line, bytes]}, at} ->
        at_us = System.convert_time_unit(at, :native, :microsecond)
        written(if(IO.iodata_length(bytes) > 0, do: [at_us | times], else: times))
    after
      0 -> Enum.reverse(times)
    end
  end

  @tag base: [ghost: :all]
  test "ghost bytes wherever there is a 1B", context do
    drive(context, Twist.new(0.3, 0.2), &(&1.pose.x > -3.5))
    stop(context)
    agree(context)
  end

  @tag base: [counters: {0x7FFFFFFF - 1000, -0x80000000 + 500}]
  test "counters that wrap move nothing", context do
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -3.5))
    stop(context)
    drive(context, Twist.new(0.0, -0.5), &(&1.pose.heading < -0.5))
    stop(context)

    {way, _} =
      Sim.Emulator.RFlexController.Motors.counts(Emulator.core(context.emulator).motors, 0)

    {turn, _} =
      Sim.Emulator.RFlexController.Motors.counts(Emulator.core(context.emulator).motors, 1)

    assert way < 0 and turn > 0
    agree(context)
  end
end
