# How every suite of the project starts, of the apps and of the whole system.
for file <- ~w(skipped.exs failed.exs), do: Code.require_file(file, __DIR__)

# On a busy machine a message may take its time; nothing waits longer than it must. Tests tagged `:long` are
# for `bin/test long`; those tagged `:slow` or `:realtime` are left out by `bin/test quick`.
#
# A test may take three minutes, and one of many seeds a quarter of an hour.
long? = :long in Keyword.get(ExUnit.configuration(), :include, [])

ExUnit.start(
  assert_receive_timeout: 10_000,
  timeout: if(long?, do: 900_000, else: 180_000),
  exclude: [:long],
  formatters: [ExUnit.CLIFormatter, Convoy.Skipped, Convoy.Failed]
)
