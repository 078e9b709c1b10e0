defmodule Lab.Hardware.BaseFaultsTest do
  @moduledoc "The driver of real bases on a line that loses, duplicates and changes bytes."
  use Lab.BaseCase, async: true
  @moduletag :realtime

  for {seed, tags} <- [
        {1, []},
        {2, [long: true, realtime: :long]},
        {3, [long: true, realtime: :long]}
      ] do
    @tag tags
    @tag wire: [drop: 0.01, double: 0.005, flip: 0.005, seed: seed]
    test "with 2 % of faulty bytes it drives, and never faster than its limit (#{seed})",
         context do
      {fastest, fastest_turn} = drive(context, Twist.new(0.4, 0.0), &(&1.pose.x > -2.0), 40_000)
      assert fastest <= 0.501
      assert fastest_turn <= 1.001
      {_, fastest_turn} = drive(context, Twist.new(0.0, 0.5), &(&1.pose.heading > 1.2), 40_000)
      assert fastest_turn <= 1.001
      stop(context)
      assert Emulator.core(context.emulator).counts.bad > 0
      agree_but_for_shape(context)
    end
  end
end
