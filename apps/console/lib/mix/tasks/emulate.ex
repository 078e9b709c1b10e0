defmodule Mix.Tasks.Emulate do
  @shortdoc "Emulates the devices of a robot on serial lines, in a small world"
  @moduledoc "Runs `bin/emulate`, whose `--help` lists the options."
  use Mix.Task

  @impl Mix.Task
  def run(arguments) do
    Hal.Cli.Command.run("emulate", fn ->
      Console.Emulate.run(arguments, System.get_env("CONVOY_FROM", "."))
    end)
  end
end
