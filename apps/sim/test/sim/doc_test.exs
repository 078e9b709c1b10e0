defmodule Sim.DocTest do
  use ExUnit.Case, async: true
  doctest Sim.Fleet.Mission
  doctest Sim.Fleet.Said
  doctest Sim.Contact
  doctest Sim.Lateness
  doctest Sim.Map
  doctest Sim.Map.Pgm
  doctest Sim.Noise
  doctest Sim.Palette
  doctest Sim.Trial.Cuts
  doctest Sim.Scene
  doctest Sim.Radio
  doctest Sim.Trial.Options
  doctest Sim.Trig
end
