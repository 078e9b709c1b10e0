defmodule Player.Writer do
  @moduledoc """
  Writes values as a robot file that `Robot.File` reads. Pure.
  """

  @doc """
  The text of a file: remarks as comments at its head, and its keys. In values, `{:deg, x}` means
  x degrees, and a driver is `{module, options}`.

      iex> Player.Writer.text(["mag1"], id: :mag1, start: {0.0, 0.0, {:deg, 90.0}})
      "# mag1\\n[\\n  id: :mag1,\\n  start: {0.0, 0.0, deg(90)}\\n]\\n"
  """
  @spec text([String.t()], keyword()) :: String.t()
  def text(remarks, values) do
    head = for line <- remarks, do: String.trim_trailing("# #{line}") <> "\n"
    keys = Enum.map_join(values, ",\n", fn {key, value} -> "  #{key}: #{value(value)}" end)
    formatted = "[\n#{keys}\n]" |> Code.format_string!(line_length: 98) |> IO.iodata_to_binary()
    IO.iodata_to_binary([head, formatted, "\n"])
  end

  defp value({:deg, degrees}), do: "deg(#{number(degrees)})"
  defp value(number) when is_float(number), do: inspect(number)
  defp value([]), do: "[]"

  defp value(list) when is_list(list) do
    if Keyword.keyword?(list),
      do: "[" <> Enum.map_join(list, ", ", fn {key, item} -> "#{key}: #{value(item)}" end) <> "]",
      else: "[" <> Enum.map_join(list, ", ", &value/1) <> "]"
  end

  defp value(tuple) when is_tuple(tuple),
    do: "{" <> (tuple |> Tuple.to_list() |> Enum.map_join(", ", &value/1)) <> "}"

  defp value(text) when is_binary(text) do
    escaped = for <<c::utf8 <- text>>, into: "", do: escape(c)
    "\"" <> escaped <> "\""
  end

  defp value(atom_or_integer), do: inspect(atom_or_integer)

  defp escape(c) when c in [?", ?\\, ?#], do: <<?\\, c>>
  defp escape(c), do: <<c::utf8>>

  defp number(degrees) do
    whole = trunc(degrees)
    if whole == degrees, do: Integer.to_string(whole), else: inspect(degrees)
  end
end
