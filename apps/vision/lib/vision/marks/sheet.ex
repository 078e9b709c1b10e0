defmodule Vision.Marks.Sheet do
  @moduledoc """
  Draws a mark to be printed, as SVG with its size in millimetres: the same bytes for the same mark. Pure.
  """

  @doc """
  The drawing. `picture` is that of `Vision.Marks.Native.picture/2`, `size_m` the side of the square between the corners. Round
  the cells there is one white cell more, which must stay white on the wall, and below it `name` in small letters.

      iex> svg = IO.iodata_to_binary(Vision.Marks.Sheet.svg({2, 1, <<0, 1, 1, 0>>}, 0.05, "two"))
      iex> svg =~ ~s(width="200mm" height="206mm")
      true
      iex> length(String.split(svg, "<rect")) - 1
      3
  """
  @spec svg({pos_integer(), pos_integer(), binary()}, float(), String.t()) :: iodata()
  def svg({cells, border, picture}, size_m, name) do
    cell = size_m * 1000 / border
    side = (cells + 2) * cell

    [
      ~s(<svg xmlns="http://www.w3.org/2000/svg" width="#{mm(side)}mm" height="#{mm(side + 6)}mm" ),
      ~s(viewBox="0 0 #{mm(side)} #{mm(side + 6)}" shape-rendering="crispEdges">\n),
      ~s(<rect width="#{mm(side)}" height="#{mm(side + 6)}" fill="#fff"/>\n),
      for {row, y} <- Enum.with_index(rows(picture, cells), 1),
          {from, to} <- black(row) do
        ~s(<rect x="#{mm((from + 1) * cell)}" y="#{mm(y * cell)}" width="#{mm((to - from) * cell)}" height="#{mm(cell)}"/>\n)
      end,
      ~s(<text x="#{mm(cell)}" y="#{mm(side + 4)}" font-family="sans-serif" font-size="3">#{name}</text>\n</svg>\n)
    ]
  end

  defp rows(picture, cells), do: for(<<row::binary-size(cells) <- picture>>, do: row)

  # The runs of black cells: the first, and the one behind the last.
  defp black(row) do
    for [{from, _length} = run] <- Regex.scan(~r/\x00+/, row, return: :index),
        do: {from, from + elem(run, 1)}
  end

  defp mm(value), do: :erlang.float_to_binary(value * 1.0, [:compact, decimals: 3]) |> whole()
  defp whole(text), do: String.replace_suffix(text, ".0", "")
end
