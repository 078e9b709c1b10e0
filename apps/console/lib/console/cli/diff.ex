defmodule Console.Cli.Diff do
  @moduledoc "Shows the change of a text file, for people. Pure."

  @doc """
  The removed (`-`) and added (`+`) lines, with their numbers in the old and the new text.

      iex> Console.Cli.Diff.lines("a\\nb\\nc\\n", "a\\nB\\nc\\n")
      ["  2 - b", "  2 + B"]
      iex> Console.Cli.Diff.lines("a\\n", "a\\n")
      []
  """
  @spec lines(String.t(), String.t()) :: [String.t()]
  def lines(old, new) do
    {lines, _old_line, _new_line} =
      split(old)
      |> List.myers_difference(split(new))
      |> Enum.reduce({[], 1, 1}, fn
        {:eq, same}, {lines, o, n} -> {lines, o + length(same), n + length(same)}
        {:del, gone}, {lines, o, n} -> {lines ++ mark(gone, o, "-"), o + length(gone), n}
        {:ins, come}, {lines, o, n} -> {lines ++ mark(come, n, "+"), o, n + length(come)}
      end)

    lines
  end

  # No line begins after the end of the last line.
  defp split(text), do: text |> String.replace_suffix("\n", "") |> String.split("\n")

  defp mark(lines, from, sign) do
    for {line, n} <- Enum.with_index(lines, from),
        do: "#{String.pad_leading("#{n}", 3)} #{sign} #{line}"
  end
end
