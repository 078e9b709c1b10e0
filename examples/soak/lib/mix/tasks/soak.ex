defmodule Mix.Tasks.Soak do
  @shortdoc "Disturbs a fleet of nodes at random, and judges it: bin/soak"
  @moduledoc "What `bin/soak` runs; `bin/soak --help` explains it."
  use Mix.Task
  alias Soak.Main

  @impl Mix.Task
  def run(arguments), do: Hal.Cli.Command.guard("soak", fn -> soak(arguments) end)

  defp soak(arguments) do
    Hal.Cli.Command.update()

    case Main.arguments(arguments) do
      {:ok, what} ->
        status = Main.run(what, Path.join(Mix.Project.build_path(), "soak"))
        if status > 0, do: exit({:shutdown, status})

      {:error, line} ->
        IO.puts(:stderr, "soak: #{line}; bin/soak --help explains it")
        exit({:shutdown, 2})
    end
  end
end
