defmodule Sim.Emulator.RFlexController.CommandHandler do
  @moduledoc false
  # Carries out the frames that a controller receives (fact sheet rFLEX, sections 3 to 9). Pure.
  # Unknown orders are only counted.
  #
  # Where the sheet leaves it open: setting the defaults stops both axes with their accelerations;
  # periods of reports of motion and inputs are in microseconds, those of infrared in milliseconds;
  # the shortest is 10 ms.
  import Sim.Emulator.RFlexController.State, only: [count: 3, stamp: 2, tell: 2]
  alias Sim.Emulator.RFlexController
  alias Sim.Emulator.RFlexController.{Frame, Motors, Sonars}

  @least_ms 10
  @screen_rows 0..239

  @doc "The controller after it has carried out the frame."
  @spec obey(RFlexController.State.t(), Frame.t(), integer()) :: RFlexController.State.t()
  def obey(core, {port, _id, opcode, data}, at_ms), do: order(core, {port, opcode}, data, at_ms)

  defp order(core, {1, 0}, <<>>, at_ms) do
    blank = <<0::320>>

    Enum.reduce(
      @screen_rows,
      core,
      &tell(&2, RFlexController.Report.row(stamp(&2, at_ms), &1, blank))
    )
  end

  defp order(core, {1, 1}, <<>>, at_ms),
    do:
      tell(
        core,
        RFlexController.Report.status(stamp(core, at_ms), core.centivolts, core.motors.brake?)
      )

  defp order(core, {2, 34}, <<period_us::32, mask::32>>, at_ms),
    do: %{core | motion: every(period_us, mask, at_ms)}

  defp order(core, {2, 10}, <<>>, at_ms), do: %{core | motors: Motors.halt(core.motors, at_ms)}

  defp order(core, {2, 11}, <<>>, at_ms),
    do: %{core | motors: Motors.brake(core.motors, true, at_ms)}

  defp order(core, {2, 12}, <<>>, at_ms),
    do: %{core | motors: Motors.brake(core.motors, false, at_ms)}

  defp order(core, {2, 7}, <<axis, speed::32, acceleration::32, torque::32, forward>>, at_ms)
       when axis in [0, 1] and forward in [0, 1] do
    escaped? = axis == 1 and escape?(speed)
    core = if escaped?, do: count(core, :escaped, 1), else: core

    if escaped? and core.options.escape == :drop,
      do: core,
      else: move(core, axis, speed, {acceleration, torque}, forward, at_ms)
  end

  defp order(core, {3, 0}, <<>>, at_ms) do
    {x, y, buttons} = core.stick
    tell(core, RFlexController.Report.joystick(stamp(core, at_ms), x, y, buttons))
  end

  defp order(core, {4, 0}, <<_delays::96, 0>>, _at_ms), do: %{core | sonars: nil}

  defp order(core, {4, 0}, <<echo_us::32, ping_us::32, set_us::32, 2>>, at_ms),
    do: %{core | sonars: Sonars.start({echo_us, ping_us, set_us}, at_ms * 1000)}

  defp order(core, {5, 0}, <<period_us::32>>, at_ms) do
    core = %{core | inputs_wanted: every(period_us, nil, at_ms)}
    tell(core, RFlexController.Report.inputs_wanted(stamp(core, at_ms)))
  end

  defp order(core, {6, 0}, <<_times::160, 0>>, _at_ms), do: %{core | infrared: nil}

  defp order(core, {6, 0}, <<_times::128, period_ms::32, 2>>, at_ms),
    do: %{core | infrared: every(period_ms * 1000, nil, at_ms)}

  defp order(core, _port_and_opcode, _data, _at_ms), do: count(core, :unknown, 1)

  # Section 13: turns that contain this byte go wrong, and the driver must avoid them.
  defp escape?(speed) do
    <<top, _second, third, _low>> = <<speed::32>>
    top == 0x1B or third == 0x1B
  end

  defp move(core, axis, speed, {acceleration, torque}, forward, at_ms) do
    signed = if forward == 1, do: speed, else: -speed
    %{core | motors: Motors.command(core.motors, axis, signed, acceleration, torque, at_ms)}
  end

  defp every(0, _argument, _at_ms), do: nil

  defp every(period_us, argument, at_ms) do
    period_ms = max(div(period_us, 1000), @least_ms)
    {at_ms + period_ms, period_ms, argument}
  end
end
