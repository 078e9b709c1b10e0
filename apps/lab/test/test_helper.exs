# One directory for all tests, which run side by side.
{:ok, _worlds} = Supervisor.start_link([Sim.World.Directory], strategy: :one_for_one)

Code.require_file("../../../test/start.exs", __DIR__)

# Code that is loaded at its first call makes its caller wait for the disk; a driver that waits for 0.2 s loses its line.
:ok = Swarm.MissionRegistry.load(:lab)

# Most of these tests wait for robots in real time; those that reckon let them go first (`Lab.LockstepCase`).
ExUnit.configure(max_cases: 4 * System.schedulers_online())
