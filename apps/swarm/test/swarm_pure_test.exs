defmodule SwarmPureTest do
  use ExUnit.Case, async: true
  doctest Swarm.Formation
  doctest Swarm.Assignment
  doctest Swarm.Chain
  doctest Swarm.Election
  doctest Swarm.Trail
  doctest Swarm.Room
  doctest Swarm.Round.Record
  doctest Swarm.Message
  doctest Swarm.Heartbeat
  doctest Swarm.Anchor
  doctest Swarm.Missions.Landmark.Phases
end
