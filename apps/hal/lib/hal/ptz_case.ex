defmodule Hal.PtzCase do
  @moduledoc """
  Runs the driver of any pan-tilt unit at one that is emulated, and says what does not hold that must hold for all. For tests:

      @tag timeout: 300_000
      test "what holds for every pan-tilt unit" do
        assert Hal.PtzCase.problems({Hal.Visca.Driver, []}, {Sim.Emulator, core: {Sim.Emulator.ViscaCamera, []}}) == []
      end

  `Hal.Device` runs the driver, as in a robot, with the unit's line as its option `port:`; the unit is a `Hal.Emulated`, such as
  `Sim.Emulator`. Each rule is a run of its own, in real time. Where the unit looks is what it reports.

  | rule | must hold |
  |---|---|
  | `:options` | an option that it does not know is refused in one line that names it |
  | `:missing` | a port that is not there is an error, and in words one line that names it; once it is there it looks where it is told |
  | `:looks` | to the left and to the right, up and down, to 0.02 rad |
  | `:junk` | noise on the line neither ends it nor makes its state grow, and it looks on |
  | `:messages` | nor do messages that it does not know |
  | `:unplug` | a pulled cable is an error, and once it is back it looks again |
  | `:restart` | a unit that is switched off and on is found again |
  | `:program` | so is one whose port program was killed |
  | `:close`, `:killed` | after the end of the device, or the killing of its process, nothing comes, and no program of its runs on (on Linux) |
  """
  alias Hal.{Device, DeviceCase, Options}
  import Hal.DeviceCase, only: [await: 3, on_emulated: 3]

  @rules DeviceCase.rules([:looks])
  @table DeviceCase.table(@rules, 60_000)
  # Where it is told to look, and how exactly it must, in radians.
  @pan 0.3
  @tilt 0.1
  @exact 0.02

  @doc """
  What does not hold, one line each. Options: `only` (these rules), `wait_ms` (how long a busy machine may take for what must come,
  20,000), `bytes` (how large the device's state may be, 60,000), `seed` (of the noise). Raises `ArgumentError` for options
  that are wrong.
  """
  @spec problems(driver :: {module(), keyword()}, unit :: {module(), keyword()}, keyword()) ::
          [String.t()]
  def problems({_, _} = driver, {_, _} = unit, options \\ []) do
    options = Options.check!(options, @table, "ptz case")
    t = %DeviceCase{kind: :ptz, driver: driver, emulated: unit, options: options}
    DeviceCase.problems(t, &rule/2)
  end

  defp rule(:looks, t) do
    on_emulated(t, [], fn t ->
      with :ok <- looks(t, @pan, 0.0, "to the left"),
           :ok <- looks(t, -@pan, 0.0, "to the right"),
           :ok <- looks(t, 0.0, @tilt, "up"),
           do: looks(t, 0.0, -@tilt, "down")
    end)
  end

  defp rule(rule, t),
    do: DeviceCase.rule(rule, t, &looks(&1, if(&2 == 1, do: @pan, else: -@pan), @tilt, &3))

  defp looks(t, pan, tilt, how) do
    :ok = Device.look(t.device, pan, tilt)
    line = "does not look where it is told, #{how}"
    with {:ok, _reading} <- await(t, line, &there(&1, pan, tilt)), do: :ok
  end

  defp there({:ptz, %{pan: pan, tilt: tilt} = reading}, wanted_pan, wanted_tilt) do
    if abs(pan - wanted_pan) < @exact and abs(tilt - wanted_tilt) < @exact, do: reading
  end

  defp there(_other, _pan, _tilt), do: nil
end
