defmodule Robot.Control.CrashTest do
  use ExUnit.Case, async: true
  alias Robot.Control.Crash
  doctest Robot.Control.Crash

  # Calls it as a pilot calls a mission.
  defp line(function) do
    function.()
  catch
    kind, reason -> Crash.line(kind, reason, __STACKTRACE__)
  end

  defp at(line), do: Regex.escape(", #{Path.relative_to_cwd(__ENV__.file)}:#{line}")

  # Of what the compiler cannot see. The calls below are no tail calls, of which nothing is left in the stack.
  defp any(term), do: Process.get(:nothing, term)
  def only_one(1), do: 1

  test "what failed, and in which line of the mission, whatever it was" do
    fails = [
      {fn -> raise "boom" end, __ENV__.line, "(RuntimeError) boom"},
      {fn -> 1 = any(2) end, __ENV__.line, "(MatchError) no match of right hand side value: 2"},
      {fn -> 1 / any(0) end, __ENV__.line,
       "(ArithmeticError) bad argument in arithmetic expression"},
      {fn -> [apply(any(Nowhere), :go, [1])] end, __ENV__.line,
       "(UndefinedFunctionError) function Nowhere.go/1 is undefined"},
      {fn -> [Map.fetch!(%{a: 1}, any(:b))] end, __ENV__.line,
       "(KeyError) key :b not found in: %{a: 1}"},
      {fn -> [Enum.map([1], any(:no_function))] end, __ENV__.line, "("},
      {fn -> throw(:out) end, __ENV__.line, "(throw) :out"},
      {fn -> exit(:gone) end, __ENV__.line, "(exit) :gone"}
    ]

    for {function, line, what} <- fails do
      told = line(function)
      assert String.starts_with?(told, what), told
      assert told =~ ~r/#{at(line)}$/, told
    end

    told = line(fn -> [only_one(any(2))] end)
    assert told =~ "(FunctionClauseError) no function clause matching in"
    assert told =~ "crash_test.exs:"
  end

  test "one line, of a length that fits a line" do
    told = line(fn -> raise "first\nsecond" end)
    assert told =~ "(RuntimeError) first, "
    told = line(fn -> raise String.duplicate("x", 10_000) end)
    assert String.length(told) < 300
    assert line(fn -> raise "" end) =~ "(RuntimeError) , "
    assert line(fn -> :erlang.error(%{odd: 1}) end) =~ "(ErlangError) Erlang error: %{odd: 1}"
  end
end
