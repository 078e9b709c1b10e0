defmodule Robot.Companion do
  @moduledoc """
  A process that lives and falls beside a robot's pilot, and that this application need not know:
  the robot's radio, a recorder. Companions are started last, so that they find all other parts
  running; the failure of one takes along those listed after it, and nothing else of the robot.
  """

  @doc "The child to start for a robot with this config, and the companion's own options."
  @callback child_spec({Robot.Config.t(), keyword()}) :: Supervisor.child_spec()
end
