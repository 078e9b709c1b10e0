defmodule Console.Build.Shell do
  @moduledoc """
  Mix's shell while a command builds: progress is not printed, errors go to standard error.

  `Mix.Shell.Quiet` writes the name of the app on standard output before an error, also when Mix only
  says that another build holds the lock; there it would stand in the middle of a report.
  """
  @behaviour Mix.Shell

  @impl Mix.Shell
  def print_app, do: :ok

  @impl Mix.Shell
  def info(_message), do: :ok

  @impl Mix.Shell
  def error(message), do: IO.puts(:stderr, IO.ANSI.format(message))

  # Nothing in a build asks a person.
  @impl Mix.Shell
  def prompt(_message), do: ""

  @impl Mix.Shell
  def yes?(_message, _options \\ []), do: false

  @impl Mix.Shell
  def cmd(command, options \\ []), do: Mix.Shell.cmd(command, options, fn _output -> :ok end)
end
