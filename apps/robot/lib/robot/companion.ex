defmodule Robot.Companion do
  @moduledoc """
  A process beside a robot's pilot that this application need not know: the robot's comms, a
  recorder. Companions start last, so that they find all other parts running; if one crashes,
  those listed after it restart too, and nothing else of the robot.
  """

  @doc "The child to start for a robot with this config, and the companion's own options."
  @callback child_spec({Robot.Config.t(), keyword()}) :: Supervisor.child_spec()
end
