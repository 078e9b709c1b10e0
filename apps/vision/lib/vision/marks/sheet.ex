defmodule Vision.Marks.Sheet do
  @moduledoc """
  Draws a mark to be printed, as SVG with its size in millimetres: the same bytes for the same mark. Pure.
  """
  alias Vision.Marks.Picture

  @doc """
  The drawing. `size_m` is the side of the square between the corners. The white round the mark must stay white on the wall;
  below it is `name` in small letters.

      iex> picture = Vision.Marks.Picture.square({2, 1, <<0, 1, 1, 0>>})
      iex> svg = IO.iodata_to_binary(Vision.Marks.Sheet.svg(picture, 0.05, "two"))
      iex> svg =~ ~s(width="200mm" height="206mm")
      true
      iex> length(String.split(svg, "<rect")) - 1
      3
  """
  @spec svg(Picture.t(), float(), String.t()) :: iodata()
  def svg(%Picture{} = picture, size_m, name) do
    unit = size_m * 1000
    {left, right} = Picture.sides(picture)
    {wide, row} = {(right - left) * unit, picture.row * unit}
    high = picture.rows * row
    edges = List.to_tuple(for edge <- picture.edges, do: (edge - left) * unit)

    [
      ~s(<svg xmlns="http://www.w3.org/2000/svg" width="#{mm(wide)}mm" height="#{mm(high + 6)}mm" ),
      ~s(viewBox="0 0 #{mm(wide)} #{mm(high + 6)}" shape-rendering="crispEdges">\n),
      ~s(<rect width="#{mm(wide)}" height="#{mm(high + 6)}" fill="#fff"/>\n),
      for {cells, y} <- Enum.with_index(Picture.rows(picture)),
          {from, to} <- black(cells) do
        {x, end_x} = {elem(edges, from), elem(edges, to)}

        ~s(<rect x="#{mm(x)}" y="#{mm(y * row)}" width="#{mm(end_x - x)}" height="#{mm(row)}"/>\n)
      end,
      ~s(<text x="#{mm(row)}" y="#{mm(high + 4)}" font-family="sans-serif" font-size="3">#{name}</text>\n</svg>\n)
    ]
  end

  # The runs of black cells: the first, and the one behind the last.
  defp black(row) do
    for [{from, _length} = run] <- Regex.scan(~r/\x00+/, row, return: :index),
        do: {from, from + elem(run, 1)}
  end

  defp mm(value), do: :erlang.float_to_binary(value * 1.0, [:compact, decimals: 3]) |> whole()
  defp whole(text), do: String.replace_suffix(text, ".0", "")
end
