defmodule Robot.File.Printer do
  @moduledoc "A node of `Robot.File.Reader` in words, for messages. Pure."
  alias Robot.File.Reader

  @longest 60

  @doc """
  A node as it may have been written, not longer than fits on a line.

      iex> Robot.File.Printer.show({1, {:tuple, [{1, 1.5}, {1, {:name, "north"}}]}})
      "{1.5, :north}"
  """
  @spec show(Reader.tree()) :: String.t()
  def show(node) do
    text = node |> words(6) |> IO.iodata_to_binary()
    if String.length(text) > @longest, do: String.slice(text, 0, @longest - 3) <> "…", else: text
  end

  # Nothing is written out deeper or longer than anybody would read.
  defp words(_node, 0), do: "…"
  defp words({_line, value}, depth), do: words_of(value, depth - 1)

  defp words_of({:name, name}, _depth), do: [":", name]
  defp words_of({:module, name}, _depth), do: name
  defp words_of({:list, items}, depth), do: ["[", some(items, depth), "]"]
  defp words_of({:tuple, items}, depth), do: ["{", some(items, depth), "}"]
  defp words_of({:map, _pairs}, _depth), do: "%{…}"

  defp words_of({:keys, keys}, depth) do
    shown = for {key, _line, node} <- Enum.take(keys, 4), do: [key, ": ", words(node, depth)]
    ["[", Enum.intersperse(shown, ", "), "]"]
  end

  defp words_of(value, _depth), do: inspect(value, printable_limit: 80)

  defp some(items, depth),
    do: items |> Enum.take(8) |> Enum.map(&words(&1, depth)) |> Enum.intersperse(", ")
end
