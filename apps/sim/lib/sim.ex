defmodule Sim do
  @moduledoc """
  Worlds with walls, bodies, sonars, cameras and radio, and whole missions in them: as a function, or live.

  `Sim.Trial` is a mission as a function, in lockstep and as fast as it goes; the same seed gives the same bytes. `Sim.Fleet` is the
  same fleet as processes in real time, with the robots' own tree.

  Two seconds of three robots:

      iex> {:ok, trial} = Sim.Trial.new(%{robots: [:mag1, :mag2, :min1], seed: 1, blobs: :direct})
      iex> trial = Enum.reduce(1..20, trial, fn _step, trial -> Sim.Trial.step(trial) end)
      iex> {trial.at_ms, Sim.Trial.living(trial)}
      {2000, [:mag1, :mag2, :min1]}
      iex> Enum.map(Sim.Trial.scene(trial).robots, & &1.id)
      [:mag1, :mag2, :min1]

  A live fleet:

      Sim.Fleet
      |-- Sim.World.Server       the only truth: bodies, walls, landmark
      |-- Sim.Fleet.RadioServer  who hears whom
      `-- Robot.Fleet            a Robot.Supervisor for each robot, with simulated drivers

  Only `Sim.Trial`, `Sim.Fleet`, `Sim.Node` and `Sim.Calibration` know robots; the rest is physics. Go on with `Sim.Trial`,
  `Sim.World` and `docs/scenarios.md`.
  """
end
