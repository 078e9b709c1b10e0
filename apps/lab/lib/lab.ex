defmodule Lab do
  @moduledoc """
  Plays whole missions of simulated fleets, judges, records and replays them: as a function, or live.

  `Lab.Trial` is a mission as a function, in lockstep and as fast as it goes; the same seed gives the same bytes. `Lab.Fleet` is the
  same fleet as processes in real time, with the robots' own tree. `Lab.Run` is the one loop that plays either; `Lab.Check` judges it,
  `Lab.Scenario` and `Lab.Chaos.Draw` say what happens in it, `Lab.Recorder` records it, `Lab.Replay` plays a recording again.

  Two seconds of three robots:

      iex> {:ok, trial} = Lab.Trial.new(%{robots: [:mag1, :mag2, :min1], seed: 1, blobs: :direct})
      iex> trial = Enum.reduce(1..20, trial, fn _step, trial -> Lab.Trial.step(trial) end)
      iex> {trial.at_ms, Lab.Trial.living(trial)}
      {2000, [:mag1, :mag2, :min1]}
      iex> Enum.map(Lab.Trial.scene(trial).robots, & &1.id)
      [:mag1, :mag2, :min1]

  A live fleet:

      Lab.Fleet
      |-- Sim.World.Server       the only truth: bodies, walls, landmark
      |-- Lab.RadioServer  who hears whom
      `-- Robot.Fleet            a Robot.Supervisor for each robot, with simulated drivers

  Bodies, walls, sonars, cameras and radio are those of `Sim`, which knows no robot. Go on with `Lab.Trial` and `docs/scenarios.md`.
  """
end
