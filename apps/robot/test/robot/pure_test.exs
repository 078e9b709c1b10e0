defmodule Robot.PureTest do
  use ExUnit.Case, async: true
  doctest Robot
  doctest Robot.Wish
  doctest Robot.Behaviour
  doctest Robot.Safety.LivenessMonitor
  doctest Robot.Safety.Readiness
  doctest Robot.Behaviour.Arbiter
  doctest Nav.Steering
  doctest Robot.Safety.Reflex.Body
end
