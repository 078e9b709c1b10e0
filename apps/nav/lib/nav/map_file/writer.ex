defmodule Nav.MapFile.Writer do
  @moduledoc """
  Makes the files of a map that robots have made, as map_server writes them: a description in YAML, and a PGM picture of three
  shades, 254 for free, 0 for wall and 205 for unknown. Pure.
  """

  @typedoc """
  `cells` have a byte each, rows from the lowest y: 0 unknown, 1 free, 2 wall. `left` and `low` are the numbers of the
  lower left cell, counted from the origin of the map, `cell` is the width of a cell in metres. `marks` are printed marks that hang there.
  """
  @type raster :: %{
          :cells => binary(),
          :width => non_neg_integer(),
          :height => non_neg_integer(),
          :left => integer(),
          :low => integer(),
          :cell => float(),
          optional(:marks) => [
            {id :: non_neg_integer(), {float(), float(), turn :: float(), sd :: float()}}
          ]
        }

  @doc """
  The description, which names the picture, and the picture.

      iex> map = %{cells: <<0, 1, 2, 1, 1, 1>>, width: 3, height: 2, left: -10, low: 5, cell: 0.1}
      iex> {yaml, pgm} = Nav.MapFile.Writer.encode(map, "found.pgm")
      iex> IO.iodata_to_binary(pgm) == "P5\\n3 2\\n255\\n" <> <<254, 254, 254, 205, 254, 0>>
      true
      iex> {:ok, description} = Nav.MapFile.Description.parse(IO.iodata_to_binary(yaml))
      iex> {description.image, description.resolution, description.origin}
      {"found.pgm", 0.1, {-1.0, 0.5, 0.0}}
      iex> {yaml, _pgm} = Nav.MapFile.Writer.encode(Map.put(map, :marks, [{7, {1.5, -2.0, 1.571, 0.25}}]), "found.pgm")
      iex> {:ok, description} = Nav.MapFile.Description.parse(IO.iodata_to_binary(yaml))
      iex> description.marks
      [{7, {1.5, -2.0, 1.571, 0.25}}]
  """
  @spec encode(raster(), image :: String.t()) :: {yaml :: iodata(), pgm :: iodata()}
  def encode(%{width: width, height: height, cell: cell} = map, image) do
    yaml = [
      ["image: ", image, "\n"],
      ["resolution: ", metres(cell), "\n"],
      ["origin: [", metres(map.left * cell), ", ", metres(map.low * cell), ", 0.0]\n"],
      "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
      | marks(Map.get(map, :marks, []))
    ]

    rows =
      for row <- (height - 1)..0//-1 do
        for <<state <- binary_part(map.cells, row * width, width)>>, into: <<>>, do: shade(state)
      end

    {yaml, ["P5\n#{width} #{height}\n255\n" | rows]}
  end

  defp marks([]), do: []

  defp marks(marks) do
    lines =
      for {id, {x, y, turn, sd}} <- marks,
          do: "  - [#{id}, #{metres(x)}, #{metres(y)}, #{metres(turn)}, #{metres(sd)}]\n"

    ["marks:\n" | lines]
  end

  defp shade(0), do: <<205>>
  defp shade(1), do: <<254>>
  defp shade(2), do: <<0>>

  defp metres(number), do: :erlang.float_to_binary(number * 1.0, [:compact, decimals: 3])
end
