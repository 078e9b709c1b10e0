defmodule Console.Build do
  @moduledoc "Brings the build up to date from within a Mix task, without a word on standard output."

  @doc "Compiles what has changed; Mix itself would run a task of an umbrella from an old build."
  @spec update() :: :ok
  def update do
    shell = Mix.shell()
    Mix.shell(Console.Build.Shell)
    Mix.Task.run("compile", [])
    Mix.shell(shell)
    :ok
  end
end
