defmodule Hal.CommandOutput do
  @moduledoc """
  Guards the standard output of a command that people start, which may be lost: a disk is full, or no program reads any
  more.

  Erlang writes later, and reports no failure; only the next one that writes learns it. A command
  that prints once and ends would say that all went well.
  """
  alias Hal.Options.Suggest

  # The status that a shell reports for a program whose output is read no more, such as that of `head`.
  @unread 141

  @doc """
  Runs a command, and returns what it returns. If its standard output was lost, the process exits with
  `{:shutdown, status}`, which Mix makes the exit status: 1 and a line of this `name` if it could not be written, 141
  and nothing said if it is not read. An exit `{:shutdown, status}` of the command passes otherwise.
  """
  @spec run(name :: String.t(), (... -> result)) :: result when result: term()
  def run(name, command) do
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

  @doc """
  Runs a Mix task with options of `OptionParser`: `carry_out` gets them and the other words. `--help` prints `help`; an error
  of one or several lines is printed, and ends the task with status 1.
  """
  @spec run(
          name :: String.t(),
          words :: [String.t()],
          help :: String.t(),
          parser :: keyword(),
          (keyword(), [String.t()] -> term() | {:error, String.t() | [String.t()]})
        ) :: term()
  def run(name, words, help, parser, carry_out) do
    run(name, fn ->
      case parse(words, parser) do
        {:ok, options, words} -> told(carry_out.(options, words))
        {:error, line} -> refuse(line)
        :help -> help(help)
      end
    end)
  end

  @doc """
  The options and the other words of a command by those of `OptionParser`, of which one is `help`; the error is one line.

      iex> parser = [strict: [every: :integer, help: :boolean]]
      iex> Hal.CommandOutput.parse(~w(a --every 2 b), parser)
      {:ok, [every: 2], ~w(a b)}
      iex> Hal.CommandOutput.parse(~w(--every x), parser)
      {:error, ~s(--every: expected a whole number, got "x")}
      iex> Hal.CommandOutput.parse(~w(--evry 2), parser)
      {:error, "unknown option --evry; did you mean --every?"}
  """
  @spec parse([String.t()], keyword()) ::
          {:ok, keyword(), [String.t()]} | :help | {:error, String.t()}
  def parse(words, parser) do
    case OptionParser.parse(words, parser) do
      {_options, _words, [{option, nil} | _]} ->
        {:error, unknown(option, parser[:strict])}

      {_options, _words, [{option, text} | _]} ->
        {:error, "#{option}: expected #{value(option, parser[:strict])}, got #{inspect(text)}"}

      {options, words, []} ->
        if options[:help], do: :help, else: {:ok, options, words}
    end
  end

  defp help(text), do: Mix.shell().info(text)

  defp told({:error, lines}), do: refuse(lines)
  defp told(result), do: result

  # A text can be any.
  defp value(option, switches) do
    type = Enum.find_value(switches, fn {name, type} -> if switch(name) == option, do: type end)
    if type == :boolean, do: "no value", else: "a whole number"
  end

  defp switch(name), do: "--" <> String.replace("#{name}", "_", "-")

  defp unknown(option, switches) do
    names = for {name, _type} <- switches, do: switch(name)

    if option in names,
      do: "#{option} needs a value",
      else: "unknown option #{option}#{hint(option, names)}"
  end

  defp hint(option, names),
    do: with("" <- Suggest.hint(option, names), do: "; known are #{Enum.join(names, ", ")}")

  @doc "Prints errors of a Mix task, and ends it with status 1."
  @spec refuse(String.t() | [String.t()]) :: no_return()
  def refuse(lines) do
    lines |> List.wrap() |> Enum.each(&Mix.shell().error/1)
    exit({:shutdown, 1})
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
