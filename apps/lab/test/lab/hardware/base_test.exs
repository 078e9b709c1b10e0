defmodule Lab.Hardware.BaseTest do
  @moduledoc """
  The driver of real bases: its commands to the controller, and the reports that it gets.
  """
  use Lab.BaseCase, async: true
  @moduletag :realtime

  test "it drives, turns and stops, and its odometry matches the body's motion", context do
    {fastest, _} = drive(context, Twist.new(0.3, 0.0), &(&1.pose.x > -3.0))
    assert fastest <= 0.3001
    stop(context)
    agree(context)
    drive(context, Twist.new(0.0, 0.5), &(&1.pose.heading > 1.5))
    stop(context)
    drive(context, Twist.new(0.2, -0.4), &(&1.pose.heading < 0.0))
    stop(context)
    drive(context, Twist.new(-0.2, 0.0), &(&1.pose.x < -3.1))
    stop(context)
    agree(context, {-4, 0, 0}, 0.01)

    assert_in_delta newest(:odometry, nil)
                    |> then(&(&1 || last_odometry()))
                    |> Map.get(:pose)
                    |> Map.get(:heading),
                    body(context.server).pose.heading,
                    0.005

    assert Emulator.core(context.emulator).counts |> Map.take([:bad, :unknown, :lost, :escaped]) ==
             %{bad: 0, unknown: 0, lost: 0, escaped: 0}
  end

  defp last_odometry do
    assert_receive {:odometry, odometry}
    odometry
  end

  @tag profile: Profile.atrv_mini()
  test "it drives an ATRV mini, whose turns contain a 1B", context do
    # 6960 to 7167 counts contain it, at 60000 per radian.
    drive(context, Twist.new(0.1, 0.117), &(&1.pose.heading > 0.6))
    stop(context)
    agree(context)
    assert Emulator.core(context.emulator).counts.escaped == 0
  end

  # In front of the right wall, which is 0.5 m from its front.
  @tag place: {7.3, 0.0, 0.0}
  test "sonar, infrared, battery and bumpers report what the body senses", context do
    eventually(fn ->
      felt = body(context.server)
      sonar = newest(:sonar)

      sonar != nil and
        Enum.zip(sonar, felt.sonar) |> Enum.all?(fn {a, b} -> abs(a - b) < 0.002 end)
    end)

    eventually(fn ->
      felt = body(context.server)
      near = newest(:ir)
      # A step of the converter is 8 % of a metre at the end of its range.
      near != nil and Enum.zip(near, felt.ir) |> Enum.all?(fn {a, b} -> abs(a - b) < 0.06 end)
    end)

    felt = body(context.server)
    assert Enum.at(felt.ir, 11) < 0.6
    assert Enum.at(felt.ir, 3) == 0.8
    assert_receive {:power, volts}
    assert_in_delta volts, 25.6, 0.02

    # Into the wall, with the front bumper.
    drive(context, Twist.new(0.3, 0.0), &(Map.keys(&1.pressed) == [0]))
    assert_receive {:bumpers, [0]}
    drive(context, Twist.new(-0.3, 0.0), &(&1.pressed == %{}))
    assert_receive {:bumpers, []}
    stop(context)
  end
end
