# The tests of the whole system. Fails when a test fails, and when there was none.
#
#   mix run --no-start test/run.exs [FILE | FILE:LINE...] [--only TAG | --exclude TAG] [--except WORD,WORD]
#
# The tags are those of `mix test`; `--except` leaves out the files with such a word in their names.
strict = [only: :string, exclude: :string, except: :string]
{options, files} = OptionParser.parse!(System.argv(), strict: strict)
{except, options} = Keyword.pop(options, :except, "")
except = String.split(except, ",", trim: true)

ExUnit.start(autorun: false)
Code.require_file("start.exs", __DIR__)

case options do
  [only: tag] -> ExUnit.configure(include: ExUnit.Filters.parse([tag]), exclude: [:test])
  [exclude: tag] -> ExUnit.configure(exclude: [:long | ExUnit.Filters.parse([tag])])
  [] -> :ok
end

# Most of these tests wait for programs that they have started.
ExUnit.configure(max_cases: 2 * System.schedulers_online())

# Everything is built by now. Newer Mix tells commands that run side by side to wait for each other's
# look at the build, and what they print is compared.
System.put_env("MIX_OS_CONCURRENCY_LOCK", "0")

# Elixir 1.14 parses one path at a time, and knows the lines of all files as one list.
{files, only} =
  if function_exported?(ExUnit.Filters, :parse_paths, 1) do
    apply(ExUnit.Filters, :parse_paths, [files])
  else
    {files, only} = files |> Enum.map(&ExUnit.Filters.parse_path/1) |> Enum.unzip()
    {files, Enum.find(only, [], &(&1 != []))}
  end

ExUnit.configure(only)

files =
  if files == [],
    do: __DIR__ |> Path.join("**/*_test.exs") |> Path.wildcard() |> Enum.sort(),
    else: Enum.map(files, &Path.expand/1)

for file <- files,
    not String.contains?(Path.basename(file), except),
    do: Code.require_file(file)

case ExUnit.run() do
  %{total: total, excluded: total} ->
    IO.puts(:stderr, "test/run.exs: there was no test to run")
    System.halt(1)

  %{failures: 0} ->
    :ok

  _failed ->
    System.halt(2)
end
