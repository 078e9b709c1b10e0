defmodule Nav.MapFile.Adam7 do
  @moduledoc false
  # Puts interlaced PNG pictures together: seven smaller ones, of every eighth pixel and then of those between, become
  # one. Pure.

  # The first column and row of each, and how far the next are.
  @passes [{0, 0, 8, 8}, {4, 0, 8, 8}, {0, 4, 4, 8}, {2, 0, 4, 4}, {0, 2, 2, 4}, {1, 0, 2, 2}] ++
            [{0, 1, 1, 2}]

  @doc """
  The sizes of the seven pictures, some of which may be empty.

      iex> Nav.MapFile.Adam7.sizes(3, 2)
      [{1, 1}, {0, 1}, {1, 0}, {1, 1}, {2, 0}, {1, 1}, {3, 1}]
  """
  @spec sizes(pos_integer(), pos_integer()) :: [{non_neg_integer(), non_neg_integer()}]
  def sizes(width, height) do
    for {x, y, dx, dy} <- @passes,
        do: {div(max(width - x + dx - 1, 0), dx), div(max(height - y + dy - 1, 0), dy)}
  end

  @doc """
  The rows of the whole picture from those of the seven.

      iex> Nav.MapFile.Adam7.weave([["a"], [""], [], ["c"], [], ["b"], ["xyz"]], 2)
      ["abc", "xyz"]
  """
  @spec weave([[binary()]], height :: pos_integer()) :: [binary()]
  def weave(passes, height) do
    passes = passes |> Enum.map(&List.to_tuple/1) |> List.to_tuple()
    for y <- 0..(height - 1), do: row(passes, y)
  end

  defp row(passes, y) when rem(y, 2) == 1, do: at(passes, 6, div(y, 2))

  defp row(passes, y) when rem(y, 4) == 2,
    do: zip(at(passes, 4, div(y, 4)), at(passes, 5, div(y, 2)))

  defp row(passes, y) do
    fourth =
      if rem(y, 8) == 4,
        do: at(passes, 2, div(y, 8)),
        else: zip(at(passes, 0, div(y, 8)), at(passes, 1, div(y, 8)))

    fourth |> zip(at(passes, 3, div(y, 4))) |> zip(at(passes, 5, div(y, 2)))
  end

  # An empty picture has no rows.
  defp at(passes, n, row) do
    case elem(passes, n) do
      rows when row < tuple_size(rows) -> elem(rows, row)
      _none -> <<>>
    end
  end

  # One pixel of the first, one of the second, and so on.
  defp zip(one, other), do: zip(one, other, <<>>)

  defp zip(<<a, one::binary>>, <<b, other::binary>>, done),
    do: zip(one, other, <<done::binary, a, b>>)

  defp zip(rest, <<>>, done), do: done <> rest
end
