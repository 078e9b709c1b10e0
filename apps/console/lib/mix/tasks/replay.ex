defmodule Mix.Tasks.Replay do
  @shortdoc "Replays a recorded run, compares it, and says why a robot did what it did"
  @moduledoc """
  Replays a run that `mix demo --record` has recorded; `mix replay --help` lists the options.

  Exit status: 0 all is the same; 2 something differs, or could not be compared because it was
  not recorded; 1 something was wrong with the input.
  """
  use Mix.Task
  alias Hal.CommandBuild
  alias Console.Replay
  alias Console.Replay.Options

  @impl Mix.Task
  def run(arguments), do: Hal.CommandOutput.run("replay", fn -> replay(arguments) end)

  defp replay(arguments) do
    CommandBuild.update()

    status =
      case Options.parse(arguments, System.get_env("CONVOY_FROM", ".")) do
        {:ok, %Options{help: true}} ->
          IO.write(Options.help())
          0

        {:ok, options} ->
          Replay.run(options)

        {:error, lines} ->
          Enum.each(lines, &IO.puts(:stderr, "replay: #{&1}"))
          IO.puts(:stderr, "replay: --help lists all options")
          1
      end

    if status > 0, do: exit({:shutdown, status})
  end
end
