defmodule Sim do
  @moduledoc """
  Worlds with walls, bodies, sonars, cameras and radio. Knows no robot: `Lab` plays missions in them.

  | subject | module |
  |---|---|
  | a world as a function of speeds and time | `Sim.World` |
  | the same in real time, and simulated devices | `Sim.World.Server`, `Sim.Device.Drive`, `.Ptz`, `.Camera` |
  | devices at the other end of a serial line | `Sim.Emulator` |
  | floor plans, built in or from files | `Sim.Floorplan` |
  | which robot hears which | `Sim.Radio` |
  | rays and pictures, in C with a reference | `Sim.Compute` |
  """
end
