defmodule Sim.DocTest do
  use ExUnit.Case, async: true
  doctest Sim.World.Contact
  doctest Sim.Lateness
  doctest Sim.Floorplan
  doctest Sim.Stage
  doctest Sim.Stage.Tokens
  doctest Sim.Stage.Entities
  doctest Sim.Stage.Values
  doctest Sim.Stage.Colours
  doctest Sim.Stage.Shape
  doctest Sim.Floorplan.Cells
  doctest Sim.Floorplan.Maps
  doctest Sim.Floorplan.Rooms
  doctest Sim.Floorplan.Shape
  doctest Sim.Noise
  doctest Sim.Compute.Palette
  doctest Sim.Scene
  doctest Sim.Radio
  doctest Sim.Trig
end
