defmodule Hal.Cli.CommandTest do
  use ExUnit.Case, async: true
  alias Hal.Cli.Command
  doctest Hal.Cli.Arguments
  doctest Hal.Cli.Parse

  # Of what the compiler cannot see. The calls below are no tail calls, of which nothing is left in the stack.
  defp any(term), do: Process.get(:nothing, term)
  def only_one(1), do: 1

  test "a command that fails does so with its own error, in its own place" do
    fails = [
      {MatchError, fn -> 1 = any(2) end},
      {ArithmeticError, fn -> 1 / any(0) end},
      {UndefinedFunctionError, fn -> [apply(any(Nowhere), :go, [1])] end},
      {FunctionClauseError, fn -> [only_one(any(2))] end},
      {CaseClauseError, fn -> case(any(1), do: (2 -> 3)) end},
      {KeyError, fn -> [Map.fetch!(%{}, any(:original))] end},
      {RuntimeError, fn -> raise "boom" end}
    ]

    for {error, command} <- fails do
      {raised, stacktrace} =
        try do
          Command.guard("a command", command)
        rescue
          raised -> {raised, __STACKTRACE__}
        end

      assert raised.__struct__ == error
      places = for {_module, _f, _a, at} <- stacktrace, do: "#{at[:file]}"
      assert Enum.find(places, &(&1 =~ "command_test")) =~ "test/hal/cli/command_test.exs"
    end
  end
end
