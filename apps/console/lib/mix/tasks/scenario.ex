defmodule Mix.Tasks.Scenario do
  @shortdoc "Runs scenarios of a fleet, and says whether what they expect holds"
  @moduledoc """
  Runs scenarios in lockstep; `mix scenario --help` shows how. docs/scenarios.md shows how one is
  written.

  Exit status: 0 if all expectations hold; 2 if one failed; 1 if the input was wrong.
  """
  use Mix.Task
  alias Console.Scenario.{Options, Session}

  @impl Mix.Task
  def run(arguments) do
    Hal.Cli.Command.run("scenario", fn ->
      case Options.parse(arguments, System.get_env("CONVOY_FROM", ".")) do
        :help -> IO.write(Options.help())
        {:ok, options} -> Session.run(options)
        errors -> errors
      end
    end)
  end
end
