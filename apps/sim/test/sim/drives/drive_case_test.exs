defmodule Sim.DriveCaseTest do
  @moduledoc "Our drivers at emulated bases, by the kit that any driver must pass."
  use ExUnit.Case, async: true
  alias Hal.DriveCase
  @moduletag :realtime
  @moduletag timeout: 600_000

  test "a Kobuki" do
    base = {Sim.Emulator, core: {Sim.Emulator.Kobuki, []}}
    driver = {Hal.Kobuki.Driver, limits: [max_linear: 0.3, max_turn: 1.0]}
    assert DriveCase.problems(driver, base, max_linear: 0.3, max_turn: 1.0) == []
  end
end
