defmodule Mix.Tasks.Chaos do
  @shortdoc "Plays random missions, and shrinks what is wrong in them"
  @moduledoc """
  Plays missions drawn at random and judges each at every tick; `mix chaos --help` lists the options.

  Exit status: 0 if nothing was wrong, 2 if an invariant was violated, 1 if the input was wrong.
  """
  use Mix.Task
  alias Console.Chaos
  alias Console.Chaos.Options

  @impl Mix.Task
  def run(arguments) do
    Hal.Cli.Command.run("chaos", fn ->
      # A run that raises is a finding, and told in its line.
      Logger.configure(level: :none)

      case Options.parse(arguments) do
        {:ok, %Options{help: true}} -> IO.write(Options.help())
        {:ok, options} -> Chaos.run(options)
        errors -> errors
      end
    end)
  end
end
