defmodule Console.Person do
  @moduledoc """
  A person at a terminal: hears what is written and types what `answer` returns for it, a line for
  each text that it knows. Use it as the group leader of the process that asks.
  """

  @doc """
  Starts the person; `answer` is called with each text written and returns a line, or `nil`.
  """
  @spec start((String.t() -> String.t() | nil)) :: pid()
  def start(answer), do: spawn_link(fn -> loop(answer, [], nil, []) end)

  @doc "All that was written so far."
  @spec heard(pid()) :: String.t()
  def heard(person) do
    send(person, {:heard, self()})

    receive do
      {:heard, ^person, text} -> text
    end
  end

  @doc "Types a line without being asked."
  @spec type(pid(), String.t()) :: :ok
  def type(person, line) do
    send(person, {:type, line})
    :ok
  end

  defp loop(answer, lines, waiting, heard) do
    receive do
      {:io_request, from, ref, {:put_chars, :unicode, text}} ->
        put(text, from, ref, {answer, lines, waiting, heard})

      {:io_request, from, ref, {:put_chars, :unicode, m, f, a}} ->
        put(apply(m, f, a), from, ref, {answer, lines, waiting, heard})

      {:io_request, from, ref, {:get_line, :unicode, _prompt}} ->
        give(answer, lines, {from, ref}, heard)

      {:io_request, from, ref, _other} ->
        send(from, {:io_reply, ref, {:error, :enotsup}})
        loop(answer, lines, waiting, heard)

      {:type, line} ->
        give(answer, lines ++ [line], waiting, heard)

      {:heard, from} ->
        send(from, {:heard, self(), heard |> Enum.reverse() |> IO.iodata_to_binary()})
        loop(answer, lines, waiting, heard)
    end
  end

  defp put(text, from, ref, {answer, lines, waiting, heard}) do
    send(from, {:io_reply, ref, :ok})
    text = IO.chardata_to_string(text)
    line = answer.(text)
    give(answer, lines ++ List.wrap(line), waiting, [text | heard])
  end

  defp give(answer, [line | lines], {from, ref}, heard) do
    send(from, {:io_reply, ref, line <> "\n"})
    loop(answer, lines, nil, heard)
  end

  defp give(answer, lines, waiting, heard), do: loop(answer, lines, waiting, heard)
end
