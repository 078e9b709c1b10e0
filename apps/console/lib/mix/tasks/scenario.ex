defmodule Mix.Tasks.Scenario do
  @shortdoc "Runs scenarios of a fleet, and says whether what they expect holds"
  @moduledoc """
  Runs scenarios in lockstep; `mix scenario --help` shows how. docs/scenarios.md shows how one is
  written.

  Exit status: 0 if all expectations hold; 2 if one failed; 1 if the input was wrong.
  """
  use Mix.Task
  alias Hal.CommandBuild
  alias Console.Scenario.{Options, Session}

  @impl Mix.Task
  def run(arguments) do
    Hal.CommandOutput.run("scenario", fn ->
      CommandBuild.update()
      status = scenario(arguments)
      if is_integer(status) and status > 0, do: exit({:shutdown, status})
    end)
  end

  defp scenario(arguments) do
    case Options.parse(arguments, System.get_env("CONVOY_FROM", ".")) do
      :help -> IO.write(Options.help())
      {:ok, options} -> play(options)
      {:error, lines} -> refuse(lines)
    end
  end

  defp play(options) do
    with {:error, lines} <- Session.run(options), do: refuse(lines)
  end

  defp refuse(lines) do
    Enum.each(lines, &IO.puts(:stderr, "scenario: #{&1}"))
    IO.puts(:stderr, "scenario: --help shows how it is used")
    1
  end
end
