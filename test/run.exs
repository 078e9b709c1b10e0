# The tests of the whole system. Fails when a test fails, and when there was none.
ExUnit.start(autorun: false)
Code.require_file("start.exs", __DIR__)

# Everything is built by now. Newer Mix tells commands that run side by side to wait for each other's
# look at the build, and what they print is compared.
System.put_env("MIX_OS_CONCURRENCY_LOCK", "0")

for file <- __DIR__ |> Path.join("**/*_test.exs") |> Path.wildcard() |> Enum.sort(),
    do: Code.require_file(file)

case ExUnit.run() do
  %{total: 0} ->
    IO.puts(:stderr, "test/run.exs: there was no test to run")
    System.halt(1)

  %{failures: 0} ->
    :ok

  _failed ->
    System.halt(2)
end
