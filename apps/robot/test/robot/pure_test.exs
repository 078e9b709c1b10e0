defmodule Robot.PureTest do
  use ExUnit.Case, async: true
  doctest Robot.Wish
  doctest Robot.Behaviour
  doctest Robot.Watch
  doctest Robot.Readiness
  doctest Robot.Arbiter
  doctest Robot.Steering
  doctest Robot.Reflex.Body
  doctest Robot.Behaviour.Options
end
