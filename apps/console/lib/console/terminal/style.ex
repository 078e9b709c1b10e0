defmodule Console.Terminal.Style do
  @moduledoc "Turns styled rows into text with ANSI colours. Pure."

  @codes %{
    plain: "0",
    floor: "0",
    wall: "38;5;242",
    slot: "38;5;245",
    landmark: "1;38;5;220",
    robot: "1;38;5;39",
    follower: "1;38;5;42",
    leader: "1;38;5;208",
    dead: "38;5;160",
    name: "38;5;252",
    title: "1;7",
    bar: "7",
    dim: "38;5;245",
    good: "38;5;42",
    bad: "1;38;5;203",
    alarm: "1;97;41",
    unsure: "38;5;220",
    prompt: "1;38;5;208"
  }

  @doc """
  One row of exactly `columns` characters: cut, or padded with blanks.

      iex> [{"ab", :plain}, {"cd", :plain}] |> Console.Terminal.Style.row(3) |> IO.iodata_to_binary()
      "\\e[0mabc"
      iex> [{"ab", :bad}] |> Console.Terminal.Style.row(3) |> IO.iodata_to_binary()
      "\\e[0m\\e[0;1;38;5;203mab\\e[0;0m "
  """
  @spec row([{String.t(), atom()}], non_neg_integer()) :: iodata()
  def row(parts, columns) do
    {parts, left} = cut(parts, columns, [])
    parts = if left > 0, do: parts ++ [{String.duplicate(" ", left), filling(parts)}], else: parts

    {text, _style} =
      Enum.map_reduce(parts, :plain, fn {text, style}, last ->
        if @codes[style] == @codes[last], do: {text, last}, else: {[code(style), text], style}
      end)

    ["\e[0m", text]
  end

  @doc "The characters of a row without styles."
  @spec plain([{String.t(), atom()}]) :: String.t()
  def plain(parts), do: Enum.map_join(parts, fn {text, _style} -> text end)

  defp code(style), do: ["\e[0;", @codes[style], "m"]

  defp filling(parts) do
    case List.last(parts) do
      {_text, style} when style in [:title, :bar, :alarm] -> style
      _other -> :plain
    end
  end

  defp cut([], left, done), do: {Enum.reverse(done), left}
  defp cut(_parts, 0, done), do: {Enum.reverse(done), 0}

  defp cut([{text, style} | rest], left, done) do
    case String.length(text) do
      length when length <= left -> cut(rest, left - length, [{text, style} | done])
      _longer -> {Enum.reverse([{String.slice(text, 0, left), style} | done]), 0}
    end
  end
end
