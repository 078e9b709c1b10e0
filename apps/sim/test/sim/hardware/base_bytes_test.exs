defmodule Sim.Hardware.BaseBytesTest do
  @moduledoc "The driver of real bases: its pauses between commands, escaped bytes, and counters at their ends."
  use Sim.BaseCase, async: true
  @moduletag :slow

  # On a busy machine the emulator may get the bytes of a pause all at once, however well they
  # were spaced. If commands are not spaced, at least every second one is lost, all the time.
  @tag base: [pace: {10, 1}]
  test "commands are far enough apart for a controller that accepts one in 10 ms",
       context do
    counts = fn -> Emulator.core(context.emulator).counts end
    drive(context, Twist.new(0.3, 0.2), &(&1.pose.x > -3.5 and counts.().frames > 100))
    stop(context)
    %{frames: frames, lost: lost} = counts.()
    assert lost < frames / 3
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
