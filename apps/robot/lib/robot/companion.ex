defmodule Robot.Companion do
  @moduledoc """
  Defines a process beside a robot's pilot that this application need not know, such as the robot's comms or a recorder.
  Companions start last, so that all other parts are running by then; if one crashes, those listed after it restart too,
  but no other part of the robot.
  """

  @doc "The child to start for a robot with this config, and the companion's own options."
  @callback child_spec({Robot.Config.t(), keyword()}) :: Supervisor.child_spec()
end
