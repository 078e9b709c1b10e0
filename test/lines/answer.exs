# Does the lines of a file, and writes the answers into it: `Lines` asks.
defmodule Lines.Answer do
  @moduledoc false

  def answer(line, one?) do
    {:ok, output} = StringIO.open("")
    {:ok, errors} = if one?, do: {:ok, output}, else: StringIO.open("")
    status = given(output, errors, fn -> status(line) end)
    {_input, printed} = StringIO.contents(output)
    {printed, if(one?, do: "", else: elem(StringIO.contents(errors), 1)), status}
  end

  # Whoever prints finds its devices there, in this process and in those that it starts.
  defp given(output, errors, function) do
    device = Process.whereis(:standard_error)
    leader = Process.group_leader()
    put(errors)
    Process.group_leader(self(), output)

    try do
      function.()
    after
      Process.group_leader(self(), leader)
      put(device)
    end
  end

  defp put(device) do
    Process.unregister(:standard_error)
    Process.register(device, :standard_error)
  end

  # As Mix ends with it.
  defp status([task | arguments]) do
    Mix.Task.rerun(task, arguments)
    0
  rescue
    error ->
      IO.puts(:stderr, Exception.format_banner(:error, error, __STACKTRACE__))
      1
  catch
    :exit, :normal -> 0
    :exit, {:shutdown, status} when is_integer(status) -> status
  end

  defp status(line) do
    {printed, status} =
      System.cmd("sh", ["-c", "exec </dev/null\n" <> line], stderr_to_stdout: true)

    IO.write(printed)
    status
  end
end

[path] = System.argv()
{lines, one?} = path |> File.read!() |> :erlang.binary_to_term()
answers = for line <- lines, do: Lines.Answer.answer(line, one?)
File.write!(path, :erlang.term_to_binary(answers))
