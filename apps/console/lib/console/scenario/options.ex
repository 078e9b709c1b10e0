defmodule Console.Scenario.Options do
  @moduledoc false
  # Reads the arguments of `mix scenario`: files, how much is printed, and where failed runs are recorded (`nil`:
  # nowhere). Pure.
  alias Hal.Cli.{Arguments, Parse}

  @enforce_keys [:files]
  defstruct @enforce_keys ++ [quiet: false, record: nil, live: false]

  @type t :: %__MODULE__{
          files: [Path.t(), ...],
          quiet: boolean(),
          record: Path.t() | nil,
          live: boolean()
        }

  @doc """
  Options from a command's arguments, or one line for each error. Names of files are relative to
  `folder`.

      iex> Console.Scenario.Options.parse(~w(a.exs --quiet b.exs))
      {:ok, %Console.Scenario.Options{files: ["a.exs", "b.exs"], quiet: true, record: "."}}
      iex> Console.Scenario.Options.parse(~w(a.exs --quite))
      {:error, ["unknown option --quite; did you mean --quiet?"]}
      iex> Console.Scenario.Options.parse([])
      {:error, ["a file is missing: mix scenario FILE..."]}
  """
  @spec parse([String.t()], Path.t()) :: {:ok, t()} | :help | {:error, [String.t(), ...]}
  def parse(arguments, folder \\ ".") do
    {files, options} = Arguments.words(arguments, table(folder))

    with {:ok, given} <- Arguments.parse(options, table(folder)) do
      cond do
        {"help", true} in given ->
          :help

        files == [] ->
          {:error, ["a file is missing: mix scenario FILE..."]}

        {"live", true} in given and List.keymember?(given, "record", 0) ->
          {:error, ["--live cannot be used with --record: only runs in lockstep are recorded"]}

        true ->
          {:ok, new(files(files, folder), given, folder)}
      end
    end
  end

  defp new(files, given, folder) do
    {"record", record} = List.keyfind(given, "record", 0, {"record", folder})
    live? = {"live", true} in given
    record = unless live?, do: record
    %__MODULE__{files: files, quiet: {"quiet", true} in given, record: record, live: live?}
  end

  defp files(files, "."), do: files
  defp files(files, folder), do: Enum.map(files, &Path.expand(&1, folder))

  defp table(folder) do
    [
      {"record", "DIR", &Parse.folder(&1, folder),
       "where the runs that fail are recorded, for mix replay (here)"},
      {"live", nil, nil,
       "in real time on processes, as robots run, one file after the other; not recorded"},
      {"quiet", nil, nil, "print only what failed, and the last line"}
    ]
  end

  @doc "The help text of `mix scenario`."
  @spec help() :: String.t()
  def help do
    """
    Runs scenarios: files that say what happens to a fleet of simulated robots, and what is expected.

        mix scenario FILE... [options]

    #{Arguments.help(table("."))}

    Examples
      mix scenario test/scenarios/kill_leader.exs   its stages, and a line for each expectation
      mix scenario test/scenarios/*.exs             all of them, side by side
      mix scenario --quiet test/scenarios/*.exs     only what failed
      mix scenario --live mine.exs                  the same on robots of processes, in real time

    docs/scenarios.md shows how to write one, with all events and expectations.

    Exit status: 0 all expectations hold; 2 one of them failed; 1 a file was wrong.
    """
  end
end
