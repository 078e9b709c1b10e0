# One for all tests, which run side by side.
{:ok, _worlds} = Supervisor.start_link([Sim.Worlds], strategy: :one_for_one)

# On a busy machine a message may take its time; nothing waits longer than it must.
ExUnit.start(assert_receive_timeout: 3_000)
