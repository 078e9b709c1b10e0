defmodule Hal.Cli.Command do
  @moduledoc """
  Runs a command that people start: from an up-to-date build, with options by a table (`Hal.Cli.Arguments`), and with errors of
  one line each after its name.

  Its standard output may be lost: a disk is full, or no program reads any more. Erlang writes later, and reports no failure;
  only the next one that writes learns it. A command that prints once and ends would say that all went well, so that is
  looked at in the end.
  """
  alias Hal.Cli.Arguments

  # The status that a shell reports for a program whose output is read no more, such as that of `head`.
  @unread 141
  @listed "`--help` lists the options."

  @doc """
  Runs a command. The number that it returns is the exit status; its errors are printed, and give status 1.
  """
  @spec run(name :: String.t(), (... -> term() | {:error, String.t() | [String.t()]})) :: term()
  def run(name, command) do
    guard(name, fn ->
      update()

      case command.() do
        {:error, lines} -> refuse(name, List.wrap(lines) ++ ["--help lists all options"])
        status when is_integer(status) and status > 0 -> exit({:shutdown, status})
        done -> done
      end
    end)
  end

  @doc """
  Runs a command that takes words and the options of a table: `carry_out` gets the options in the order in which they were given,
  and the words; its errors, which name files and lines, are printed as they are. `--help` prints `help` with the table in place of the sentence "`--help` lists the options."
  """
  @spec run(
          name :: String.t(),
          arguments :: [String.t()],
          {help :: String.t(), [Arguments.option()]},
          ([{String.t(), term()}], words :: [String.t()] ->
             term() | {:error, String.t() | [String.t()]})
        ) :: term()
  def run(name, arguments, {help, table}, carry_out) do
    guard(name, fn ->
      update()

      with {:ok, given, words} <- Arguments.parse_words(arguments, table) do
        if List.keymember?(given, "help", 0),
          do: IO.puts(String.replace(help, @listed, Arguments.help(table))),
          else: told(carry_out.(given, words))
      else
        {:error, lines} -> refuse(name, lines)
      end
    end)
  end

  defp told({:error, lines}), do: refused(List.wrap(lines))
  defp told(done), do: done

  @doc "Prints errors after the name of a command, and ends it with status 1."
  @spec refuse(name :: String.t(), [String.t()]) :: no_return()
  def refuse(name, lines), do: refused(for line <- lines, do: "#{name}: #{line}")

  defp refused(lines) do
    Enum.each(lines, &Mix.shell().error/1)
    exit({:shutdown, 1})
  end

  @doc """
  Compiles what has changed, without output on standard output. Mix itself would run a task of an umbrella from an old build,
  and one of a dependency without the project's own modules.
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
      Mix.Shell.Process.flush(&compiled/1)
    end

    :ok
  end

  defp compiled({:mix_shell, :error, [message]}), do: IO.puts(:stderr, message)
  defp compiled(_progress), do: :ok

  @doc """
  Runs a command, and returns what it returns. If its standard output was lost, the process exits with
  `{:shutdown, status}`, which Mix makes the exit status: 1 and a line of this `name` if it could not be written, 141
  and nothing said if it is not read. An exit `{:shutdown, status}` of the command passes otherwise.
  """
  @spec guard(name :: String.t(), (... -> result)) :: result when result: term()
  def guard(name, command) do
    ended = outcome(command)
    flush()
    # If the output was lost, the writer has been told by now, and this is refused.
    IO.write("")

    case ended do
      {:returned, result} -> result
      {:exited, status} -> exit({:shutdown, status})
    end
  catch
    # Not `rescue`, which would make an `ErlangError` of what others failed with: a match, an undefined function.
    :error, :terminated -> exit({:shutdown, lost(name)})
  end

  defp outcome(command) do
    {:returned, command.()}
  catch
    :exit, {:shutdown, status} when is_integer(status) -> {:exited, status}
  end

  # The port of standard output answers when it has tried all that came before.
  defp flush do
    with user when is_pid(user) <- Process.whereis(:user),
         {:links, links} <- Process.info(user, :links),
         do: for(port <- links, is_port(port), do: drain(port))
  end

  defp drain(port) do
    case :erlang.port_info(port, :queue_size) do
      {:queue_size, bytes} when bytes > 0 ->
        receive(do: (:never -> :ok), after: (1 -> drain(port)))

      _empty_or_closed ->
        :ok
    end
  end

  # A pipe without a reader would keep us waiting.
  defp lost(name) do
    with {:ok, %File.Stat{type: type}} when type in [:regular, :device] <-
           File.stat("/dev/stdout"),
         {:error, reason} when reason != :badarg <-
           File.write("/dev/stdout", "\n", [:append, :raw]) do
      IO.puts(:stderr, "#{name}: the output cannot be written: #{:file.format_error(reason)}")
      1
    else
      _pipe_or_written -> @unread
    end
  end
end
