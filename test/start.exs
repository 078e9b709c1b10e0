# How every suite of the project starts, of the apps and of the whole system.
for file <- ~w(skipped.exs failed.exs), do: Code.require_file(file, __DIR__)

# On a busy machine a message may take its time; nothing waits longer than it must. Tests tagged `:long` are
# for `bin/test long`; those tagged `:slow` or `:realtime` are left out by `bin/test quick`.
#
# A test may take half an hour: how long one takes that only reckons is the machine's affair, and what waits has a limit of
# its own.
ExUnit.start(
  assert_receive_timeout: 10_000,
  timeout: 1_800_000,
  exclude: [:long],
  formatters: [ExUnit.CLIFormatter, Convoy.Skipped, Convoy.Failed]
)
