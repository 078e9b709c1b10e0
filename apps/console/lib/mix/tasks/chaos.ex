defmodule Mix.Tasks.Chaos do
  @shortdoc "Plays random missions, and shrinks what is wrong in them"
  @moduledoc """
  Plays missions drawn at random and judges each at every tick; `mix chaos --help` lists the options.

  Exit status: 0 if nothing was wrong, 2 if an invariant was violated, 1 if the input was wrong.
  """
  use Mix.Task
  alias Console.Chaos
  alias Console.Chaos.Options
  alias Hal.CommandBuild

  @impl Mix.Task
  def run(arguments), do: Hal.CommandOutput.run("chaos", fn -> chaos(arguments) end)

  defp chaos(arguments) do
    CommandBuild.update()
    # A run that raises is a finding, and told in its line.
    Logger.configure(level: :none)

    status =
      case Options.parse(arguments) do
        {:ok, %Options{help: true}} -> IO.write(Options.help())
        {:ok, options} -> Chaos.run(options)
        {:error, lines} -> refuse(lines)
      end

    if is_integer(status) and status > 0, do: exit({:shutdown, status})
  end

  defp refuse(lines) do
    Enum.each(lines, &IO.puts(:stderr, "chaos: #{&1}"))
    IO.puts(:stderr, "chaos: --help lists all options")
    1
  end
end
