defmodule Bench.Stop.Main do
  @moduledoc "Runs the command `mix bench stop`: reads its options, measures, prints the table."
  alias Console.Cli.Output
  alias Hal.Cli.Parse
  alias Bench.{Command, Load, Stop}

  @doc "Runs the command; each error is one line."
  @spec run([String.t()]) :: :ok | {:error, [String.t()]}
  def run(arguments),
    do: Command.run(arguments, "stop", table(), &measure/1, Command.cases(Stop.cases()))

  defp measure(given), do: Command.in_folder("stop", &measure(given, &1))

  defp measure(given, folder) do
    cases = Map.get(given, "only", Stop.cases())
    times = Map.get(given, "times", 20)

    {results, about} = Command.loaded(&Stop.Runner.run(cases, times, folder, Command.note(&1)))

    IO.write(Stop.Report.draw(results))
    IO.puts("\n" <> words(about))
    Output.json(given["json"], Stop.Report.term(results, about))
  end

  defp words(about) do
    "Times run from before the cause to when both axes were told to stand, at the line's other end. " <>
      "#{Load.words(about)}; #{about.schedulers} processors."
  end

  defp table do
    [
      {"times", "N", &Parse.whole(&1, 1..1_000), "how often each is measured (20)"},
      {"only", "NAME,NAME", &Stop.choose/1, "which cases (all)"},
      {"json", "FILE", &{:ok, &1}, "write the figures there too, in milliseconds"}
    ]
  end
end
