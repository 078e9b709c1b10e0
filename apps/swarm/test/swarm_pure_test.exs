defmodule SwarmPureTest do
  use ExUnit.Case, async: true
  doctest Swarm.Commands.Client, only: [refusals: 2]
  doctest Swarm.Formation
  doctest Swarm.Formation.Assignment
  doctest Swarm.Formation.Chain
  doctest Swarm.Agreement.Election
  doctest Swarm.Formation.Trail
  doctest Swarm.Formation.FreeSlots
  doctest Swarm.Agreement.Round.Record
  doctest Swarm.Agreement.Round.Epochs
  doctest Swarm.Agreement.Round.Precedence
  doctest Swarm.Wire.CounterGuard
  doctest Swarm.Message
  doctest Swarm.Message.Words
  doctest Swarm.Membership.Heartbeat
  doctest Swarm.Order
  doctest Swarm.Order.Giver
end
