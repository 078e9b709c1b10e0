defmodule Hal.CommandBuild do
  @moduledoc "Updates the build from within a Mix task, without output on standard output."

  @doc """
  Compiles what has changed. Mix itself would run a task of an umbrella from an old build, and one of a dependency
  without the project's own modules.
  """
  @spec update() :: :ok
  def update do
    shell = Mix.shell()
    # `Mix.Shell.Quiet` writes the name of the app on standard output before an error.
    Mix.shell(Mix.Shell.Process)

    try do
      Mix.Task.run("compile", [])
    after
      Mix.shell(shell)
      Mix.Shell.Process.flush(&tell/1)
    end

    :ok
  end

  defp tell({:mix_shell, :error, [message]}), do: IO.puts(:stderr, message)
  defp tell(_progress), do: :ok
end
