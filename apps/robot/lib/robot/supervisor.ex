defmodule Robot.Supervisor do
  @moduledoc """
  One robot.

      Robot.Supervisor (rest_for_one)
      |-- Robot.Board        the newest readings, the e-stop latch
      |-- Robot.Devices      one_for_one: blob detector, drive, ptz, camera; each crashes alone
      |-- Robot.Safety.Gate         the only one who drives the wheels
      |-- Robot.Safety.LivenessMonitor        sees that gate, executive and mission go on, and ends one that hangs
      |-- Robot.Control.Executive    percept to wish, ten times a second
      |-- Robot.Control.Pilot        runs the mission
      `-- companions         the radio, and what else the config names

  Whoever falls takes those below along, never those above. Without an executive the gate is
  still there, and stops the robot when no wish has come for 200 ms; without a gate the drive's
  device stops the wheels. Whatever starts again starts idle.

  The fourth failure within 5 s ends the robot: something is wrong that a restart does not
  cure. What then happens is the fleet's to say (`Robot.Fleet`).
  """
  use Supervisor
  alias Robot.{Board, Config, Devices, Names}
  alias Robot.Control.{Executive, Pilot}
  alias Robot.Safety.{Gate, LivenessMonitor}

  @doc "Starts a robot. `Robot.Names` must be running."
  @spec start_link(Config.t()) :: Supervisor.on_start()
  def start_link(%Config{} = config),
    do: Supervisor.start_link(__MODULE__, config, name: Names.via(config.id, :robot))

  @doc "A robot as a child, called by its id."
  @spec child_spec(Config.t()) :: Supervisor.child_spec()
  def child_spec(%Config{} = config) do
    %{
      id: {__MODULE__, config.id},
      start: {__MODULE__, :start_link, [config]},
      type: :supervisor
    }
  end

  @impl Supervisor
  def init(%Config{} = config) do
    parts = [
      {Board, config},
      {Devices, config},
      {Gate, config},
      {LivenessMonitor, config},
      {Executive, {config, {Pilot, :hear, [config.id]}}},
      {Pilot, config}
    ]

    companions = for {module, options} <- config.companions, do: {module, {config, options}}

    Supervisor.init(parts ++ companions, strategy: :rest_for_one, max_restarts: 3, max_seconds: 5)
  end
end
