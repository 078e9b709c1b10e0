defmodule Lab.Hardware.BaseLossTest do
  @moduledoc "The driver of real bases when the line, or the controller, is gone for a while."
  use Lab.BaseCase, async: true
  @moduletag :realtime

  test "unplugged in motion, the body stops; plugged in, it goes on, and knows where it is",
       context do
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -3.7))
    :ok = Emulator.unplug(context.emulator)
    assert_receive {:health, :drive, {{:offline, _reason}, _}}
    eventually(fn -> still?(context.server) end)
    :ok = Emulator.plug(context.emulator)
    assert_receive {:health, :drive, {:online, _}}, 20_000
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -3.0))
    stop(context)
    agree(context)
  end

  test "a frozen controller is noticed; thawed, it does as the driver wants now", context do
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -3.7))
    :ok = Emulator.freeze(context.emulator)
    assert_receive {:health, :drive, {{:offline, _reason}, _}}, 10_000
    eventually(fn -> still?(context.server) end)
    x = body(context.server).pose.x
    :ok = Emulator.thaw(context.emulator)
    assert_receive {:health, :drive, {:online, _}}, 20_000
    assert_in_delta body(context.server).pose.x, x, 0.2
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > x + 0.5))
    stop(context)
    agree(context)
  end

  test "a controller that was switched off and on is configured again, and the pose does not jump",
       context do
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -3.4))
    :ok = Emulator.restart(context.emulator)
    drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -2.8))
    stop(context)
    # How far it went while nobody counted is unknown: 0.3 m/s for a second or so, braking.
    agree(context, {-4, 0, 0}, 0.35)
  end
end
