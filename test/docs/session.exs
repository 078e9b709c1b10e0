# A person at iex, for test/docs_test.exs: types lines one after the other, and writes down what came of them.
#
# DOCS_LINES holds the lines as a term, DOCS_TOLD takes the answers.
for file <- ~w(reader.exs shown.exs), do: Code.require_file(file, __DIR__)

defmodule Docs.Session do
  @moduledoc false
  # A robot is heard of within a second or two: a person looks again, for so long.
  def run(lines, patience_ms) do
    env = Code.env_for_eval(file: "docs")
    {_result, _binding, env} = eval("import IEx.Helpers", [], env)

    {told, _end} =
      Enum.map_reduce(lines, {[], env}, fn {n, code, shown}, {binding, env} ->
        deadline = System.monotonic_time(:millisecond) + patience_ms
        {told, binding, env} = type(code, shown, binding, env, deadline)
        {{n, told}, {binding, env}}
      end)

    told
  end

  defp type(code, shown, binding, env, deadline) do
    {printed, {result, after_binding, after_env}} = captured(fn -> tried(code, binding, env) end)

    cond do
      match?({:raised, _line}, result) ->
        {result, binding, env}

      shown == "" and match?({:ok, {:error, _line}}, result) ->
        again({:refused, inspect(elem(result, 1))}, code, shown, {binding, env}, deadline)

      shown == "" ->
        {:ok, after_binding, after_env}

      true ->
        {:ok, value} = result
        printed = String.trim(printed <> "\n" <> inspect(value, pretty: true, limit: 50))

        if Docs.Shown.like?(shown, printed),
          do: {:ok, after_binding, after_env},
          else: again({:printed, printed}, code, shown, {after_binding, after_env}, deadline)
    end
  end

  defp again(answer, code, shown, {binding, env}, deadline) do
    if System.monotonic_time(:millisecond) > deadline do
      {answer, binding, env}
    else
      receive(do: (:never -> :ok), after: (50 -> :ok))
      type(code, shown, binding, env, deadline)
    end
  end

  # What a person would see of an exception, as a line.
  defp tried(code, binding, env) do
    {value, binding, env} = eval(code, binding, env)
    {{:ok, value}, binding, env}
  rescue
    error -> {{:raised, Exception.message(error)}, binding, env}
  catch
    kind, reason -> {{:raised, "#{kind}: #{inspect(reason)}"}, binding, env}
  end

  defp eval(code, binding, env),
    do: code |> Code.string_to_quoted!() |> Code.eval_quoted_with_env(binding, env)

  defp captured(function) do
    {:ok, device} = StringIO.open("")
    leader = Process.group_leader()
    Process.group_leader(self(), device)
    result = function.()
    Process.group_leader(self(), leader)
    {:ok, {_input, printed}} = StringIO.close(device)
    {printed, result}
  end
end

{before, lines, patience_ms} =
  "DOCS_LINES" |> System.fetch_env!() |> File.read!() |> :erlang.binary_to_term()

Code.eval_string(before)
told = Docs.Session.run(lines, patience_ms)
File.write!(System.fetch_env!("DOCS_TOLD"), :erlang.term_to_binary(told))
System.halt(0)
