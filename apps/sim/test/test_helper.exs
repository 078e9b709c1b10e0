# One directory for all tests, which run side by side.
{:ok, _worlds} = Supervisor.start_link([Sim.World.Directory], strategy: :one_for_one)

Code.require_file("../../../test/start.exs", __DIR__)

# Most of these tests wait for robots in real time; those that reckon let them go first (`Sim.LockstepCase`).
ExUnit.configure(max_cases: 4 * System.schedulers_online())
