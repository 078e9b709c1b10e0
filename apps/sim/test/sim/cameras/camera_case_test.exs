defmodule Sim.Cameras.CameraCaseTest do
  @moduledoc "What must hold for every camera, at simulated ones; and for every pan-tilt unit, at an emulated one."
  use ExUnit.Case, async: true
  alias Hal.{CameraCase, PtzCase}

  @moduletag :realtime
  @moduletag :capture_log
  @moduletag timeout: 300_000

  test "all rules hold for the simulated camera that paints" do
    driver = {Sim.Device.Camera, &[world: &1, robot: :mag1]}
    options = [size: {320, 240}, format: :i420]
    assert CameraCase.problems(driver, {Sim.EmulatedWorld, []}, options) == []
  end

  test "all rules hold for the simulated camera that detects by itself" do
    driver = {Sim.Device.Camera, &[world: &1, robot: :mag1, blobs: :direct]}
    assert CameraCase.problems(driver, {Sim.EmulatedWorld, []}) == []
  end

  test "all rules hold for a Sony camera's head" do
    unit = {Sim.Emulator, core: {Sim.Emulator.ViscaCamera, []}}
    assert PtzCase.problems({Hal.Visca.Driver, []}, unit) == []
  end

  defmodule Mirrored do
    @moduledoc false
    # Takes left for right.
    @behaviour Hal.Ptz
    alias Hal.Visca.Driver

    @impl Hal.Ptz
    defdelegate init(options), to: Driver
    @impl Hal.Ptz
    def look(pan, tilt, state), do: Driver.look(-pan, tilt, state)
    @impl Hal.Ptz
    defdelegate handle_message(message, state), to: Driver
    @impl Hal.Ptz
    defdelegate terminate(state), to: Driver
  end

  test "a driver that looks to the wrong side does not pass" do
    unit = {Sim.Emulator, core: {Sim.Emulator.ViscaCamera, []}}
    options = [only: [:missing, :looks], wait_ms: 5_000]

    assert ["missing: expected one line that names " <> _, "looks: does not look" <> _] =
             PtzCase.problems({Mirrored, []}, unit, options)
  end
end
