# One directory for all tests, which run side by side.
{:ok, _worlds} = Supervisor.start_link([Sim.World.Directory], strategy: :one_for_one)

Code.require_file("../../../test/start.exs", __DIR__)
