defmodule Console.Cli.Command do
  @moduledoc "Runs a Mix task that people start, from an up-to-date build."

  @doc """
  Runs a command. The number that it returns is the exit status; its errors are printed, one a line after its name, and give
  status 1.
  """
  @spec run(name :: String.t(), (... -> term() | {:error, String.t() | [String.t()]})) :: term()
  def run(name, command) do
    Hal.CommandOutput.run(name, fn ->
      Hal.CommandBuild.update()

      case command.() do
        {:error, lines} -> refuse(name, List.wrap(lines) ++ ["--help lists all options"])
        status when is_integer(status) and status > 0 -> exit({:shutdown, status})
        done -> done
      end
    end)
  end

  @doc "Prints errors after the name of a command, and ends it with status 1."
  @spec refuse(name :: String.t(), [String.t()]) :: no_return()
  def refuse(name, lines) do
    Enum.each(lines, &IO.puts(:stderr, "#{name}: #{&1}"))
    exit({:shutdown, 1})
  end
end
