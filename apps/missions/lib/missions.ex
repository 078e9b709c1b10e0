defmodule Missions do
  @moduledoc """
  Describes what a fleet does: the missions that come with Convoy. Each is a `Robot.Mission`, a pure state machine of which every robot
  runs its own; this app has no processes.

  | name | module | what it does |
  |---|---|---|
  | `landmark` | `Missions.Landmark` | finds a landmark, elects the robot that sees it best, and follows it in formation |
  | `patrol` | `Missions.Patrol` | visits points for ever, and takes over those of a robot that has died |
  | `flock` | `Missions.Flock` | keeps together on its way along a course, without a leader |
  | `explore` | `Missions.Explore` | sees all of an unknown building, and makes its map |
  | `chase` | `Missions.Chase` | surrounds a ball, and brings it to a place |
  | `push` | `Missions.Push` | brings a box to a place, which takes two |
  | `teleop` | `Missions.Teleop` | is driven by a person |

  A mission is fed events, and returns its phase and what is to be done:

      iex> {:ok, options} = Robot.Mission.check_options(Missions.Teleop, [speed: 0.3], 1)
      iex> {:idle, mission, []} = Missions.Teleop.init(:mag1, options)
      iex> {:wait, mission, _effects} = Missions.Teleop.handle({:command, :start}, mission)
      iex> {phase, _mission, [{:goal, _tag, goal} | _claims]} = Missions.Teleop.handle({:command, {:move, 9.0, 0.0, 0.3}}, mission)
      iex> {phase, goal}
      {:driven, {Robot.Behaviour.Move, [linear: 0.3, turn: 0.0, for_ms: 300.0]}}

  `Robot.Control.Pilot` runs it on a robot, `Lab.Trial` in a simulation, `Lab.MissionCase` in a test: the same lines.

  Go on with `docs/missions.md`, from an empty file to a mission of your own, and with `Missions.Teleop`, the shortest one.
  """
end
