defmodule Robot.Control.Crash do
  @moduledoc """
  Tells people that a mission or a behaviour has crashed, and where: a stage `:crashed` (event `[:robot, :stage]`), and
  the board's entry `{:crashed, part}`, which stays until another one begins. The process that called it crashes as
  ever.
  """
  alias Hal.Event
  alias Robot.Board

  @most 160
  # Lines of these apps do not help a person find the mistake.
  @theirs [:kernel, :stdlib, :elixir, :erts, :compiler]

  @doc "Calls a function of the mission (`:pilot`) or of a behaviour (`:executive`); if it fails, tells so, and fails as it did."
  @spec told(Robot.Config.t(), Board.t(), role :: atom(), (... -> result)) :: result
        when result: term()
  def told(config, board, part, function) when part in [:pilot, :executive] do
    function.()
  catch
    kind, reason ->
      line = line(kind, reason, __STACKTRACE__)
      at_ms = Robot.Config.now(config)
      Board.put(board, part, {:crashed, part}, line, at_ms)
      about = %{robot: config.id, stage: :crashed, crash: line}
      Event.execute([:robot, :stage], %{at_ms: at_ms}, about)
      :erlang.raise(kind, reason, __STACKTRACE__)
  end

  # Of a role that runs no code of others.
  def told(_config, _board, _role, function), do: function.()

  @doc """
  What happened and where, in one line: the first place in the stack that is neither Elixir's nor Erlang's.

      iex> Robot.Control.Crash.line(:error, %RuntimeError{message: "boom"}, [{Gather, :handle, 2, [file: ~c"lib/gather.ex", line: 42]}])
      "(RuntimeError) boom, lib/gather.ex:42"
      iex> Robot.Control.Crash.line(:error, :badarith, [{:erlang, :/, [1, 0], []}, {Gather, :share, 1, [file: ~c"lib/gather.ex", line: 7]}])
      "(ArithmeticError) bad argument in arithmetic expression: 1 / 0, lib/gather.ex:7"
      iex> Robot.Control.Crash.line(:throw, :lost, [])
      "(throw) :lost"
  """
  @spec line(:error | :exit | :throw, term(), Exception.stacktrace()) :: String.t()
  def line(kind, reason, stacktrace), do: what(kind, reason, stacktrace) <> place(stacktrace)

  defp what(:error, reason, stacktrace) do
    %module{} = error = Exception.normalize(:error, reason, stacktrace)
    # It says more with the arguments, which only a new exception does not know.
    {error, _stacktrace} = Exception.blame(:error, error, stacktrace)
    "(#{inspect(module)}) #{error |> Exception.message() |> short()}"
  end

  defp what(kind, reason, _stacktrace), do: "(#{kind}) #{reason |> inspect(limit: 10) |> short()}"

  defp short(text) do
    [first | _] = String.split(text, "\n", trim: true) ++ [""]
    if String.length(first) > @most, do: String.slice(first, 0, @most) <> "…", else: first
  end

  defp place(stacktrace) do
    places =
      for {module, _f, _a, at} <- stacktrace, file = at[:file], do: {module, file, at[:line]}

    case Enum.find(places, List.first(places), fn {module, _file, _line} -> ours?(module) end) do
      {_module, file, line} -> ", #{file}:#{line}"
      nil -> ""
    end
  end

  defp ours?(module) do
    case :application.get_application(module) do
      {:ok, app} -> app not in @theirs
      :undefined -> true
    end
  end
end
