Code.require_file("../../../test/start.exs", __DIR__)
# One registry for robots of all tests, which run beside each other.
{:ok, _supervisor} = Supervisor.start_link([Robot.Names], strategy: :one_for_one)
