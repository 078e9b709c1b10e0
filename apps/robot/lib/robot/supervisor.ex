defmodule Robot.Supervisor do
  @moduledoc """
  Supervises one robot.

      Robot.Supervisor (rest_for_one)
      |-- Robot.Board                   the newest readings, the e-stop latch
      |-- Robot.Devices                 one_for_one: blob detector, drive, ptz, camera
      |-- Robot.Safety.Gate             the only process that drives the wheels
      |-- Robot.Safety.LivenessMonitor  kills gate, executive or pilot if one hangs
      |-- Robot.Control.Executive       percept to wish, ten times a second
      |-- Robot.Control.Pilot           runs the mission
      `-- companions                    such as the comms; the config lists them

  If a child crashes, it and those below it are restarted, but not those above. Without an
  executive the gate remains, and stops the robot when no wish has come for 200 ms; without a gate
  the drive's device stops the wheels. Executive and pilot restart idle.

  The fourth crash of a child within 5 s ends the robot: such a fault is not cured by restarts.
  `Robot.Fleet` determines what happens then.
  """
  use Supervisor
  alias Robot.{Board, Devices, Host, Names}
  alias Robot.Control.{Executive, Pilot}
  alias Robot.Safety.{Gate, LivenessMonitor}

  @doc "Starts a robot. `Robot.Names` must be running."
  @spec start_link(Robot.Config.t()) :: Supervisor.on_start()
  def start_link(%Robot.Config{} = config),
    do: Supervisor.start_link(__MODULE__, config, name: Names.via(config.id, :robot))

  @doc "The child specification of a robot, with the robot's id as part of the child's id."
  @spec child_spec(Robot.Config.t()) :: Supervisor.child_spec()
  def child_spec(%Robot.Config{} = config) do
    %{
      id: {__MODULE__, config.id},
      start: {__MODULE__, :start_link, [config]},
      type: :supervisor
    }
  end

  @impl Supervisor
  def init(%Robot.Config{} = config) do
    parts = [
      {Board, config},
      {Devices, config},
      {Host, {Gate, config}},
      {LivenessMonitor, config},
      {Host, {Executive, config}},
      {Host.Phases, {Pilot, config}}
    ]

    companions = for {module, options} <- config.companions, do: {module, {config, options}}

    Supervisor.init(parts ++ companions, strategy: :rest_for_one, max_restarts: 3, max_seconds: 5)
  end
end
