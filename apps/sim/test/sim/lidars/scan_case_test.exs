defmodule Sim.Lidars.ScanCaseTest do
  @moduledoc "What must hold for every lidar, at emulators that were written from the sheets alone, on pseudo-terminals."
  use ExUnit.Case, async: true
  alias Sim.Emulator

  @moduletag :realtime
  @moduletag timeout: 300_000

  for {name, driver, core} <- [
        {"an RPLIDAR by express scans", {Hal.RPLidar.Driver, []}, {Emulator.RPLidar, []}},
        {"an RPLIDAR by plain scans", {Hal.RPLidar.Driver, mode: :standard},
         {Emulator.RPLidar, []}},
        {"an LDS-01", {Hal.Lds.Driver, model: :lds01}, {Emulator.Lds, model: :lds01}},
        {"an LDS-02", {Hal.Lds.Driver, model: :lds02}, {Emulator.Lds, model: :lds02}}
      ] do
    test "all rules hold for #{name}" do
      driver = unquote(Macro.escape(driver))
      lidar = {Emulator, core: unquote(Macro.escape(core))}
      assert Hal.ScanCase.problems(driver, lidar) == []
    end
  end

  defmodule Mirrored do
    @moduledoc false
    # Takes left for right.
    @behaviour Hal.Lidar
    alias Hal.Lds.Driver

    @impl Hal.Lidar
    def init(options), do: Driver.init(options)
    @impl Hal.Lidar
    defdelegate terminate(state), to: Driver

    @impl Hal.Lidar
    def handle_message(message, state) do
      with {:ok, readings, state} <- Driver.handle_message(message, state),
           do: {:ok, Enum.map(readings, &mirror/1), state}
    end

    defp mirror({:scan, scan}), do: {:scan, %{scan | start: -scan.start, step: -scan.step}}
  end

  test "a driver that mirrors what it sees does not pass" do
    lidar = {Emulator, core: {Emulator.Lds, model: :lds02}}

    assert ["turned: does not see what is to the left"] =
             Hal.ScanCase.problems({Mirrored, model: :lds02}, lidar,
               only: [:sees, :turned],
               wait_ms: 3_000
             )
  end
end
