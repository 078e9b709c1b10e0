defmodule Mix.Tasks.Replay do
  @shortdoc "Replays a recorded run, compares it, and says why a robot did what it did"
  @moduledoc """
  Replays a run that `mix demo --record` has recorded; `mix replay --help` lists the options.

  Exit status: 0 all is the same; 2 something differs, or could not be compared because it was
  not recorded; 1 something was wrong with the input.
  """
  use Mix.Task
  alias Hal.Cli.Command
  alias Tools.Replay
  alias Tools.Replay.Options

  @impl Mix.Task
  def run(arguments) do
    Command.run("replay", fn ->
      case Options.parse(arguments, System.get_env("CONVOY_FROM", ".")) do
        {:ok, %Options{help: true}} -> IO.write(Options.help())
        {:ok, options} -> Replay.run(options)
        errors -> errors
      end
    end)
  end
end
