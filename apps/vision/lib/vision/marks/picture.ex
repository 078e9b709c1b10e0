defmodule Vision.Marks.Picture do
  @moduledoc """
  The picture of a mark, to be printed or painted: rows of one height, columns of any width, each cell black or white. Pure.

  Lengths are in sides of the square between the mark's corners, from its centre, to the right:

    * `edges` - where columns begin and end, ascending, one more than there are columns
    * `row`, `rows` - the height of a row, and how many there are; the square's centre is in the middle of them
    * `white` - a byte for each cell, row by row from the top, 1 for white

  The white that must stay round a mark belongs to it.
  """

  @enforce_keys [:edges, :row, :rows, :white]
  defstruct @enforce_keys

  @type t :: %__MODULE__{
          edges: [float(), ...],
          row: float(),
          rows: pos_integer(),
          white: binary()
        }

  @doc """
  The picture of `cells` x `cells` equal cells, `border` of which are the side of the square, with one white cell round them.

      iex> picture = Vision.Marks.Picture.square({2, 1, <<0, 1, 1, 0>>})
      iex> {picture.edges, picture.row, picture.rows, byte_size(picture.white)}
      {[-2.0, -1.0, 0.0, 1.0, 2.0], 1.0, 4, 16}
  """
  @spec square({cells :: pos_integer(), border :: pos_integer(), binary()}) :: t()
  def square({cells, border, bits}) do
    wide = cells + 2
    edge = :binary.copy(<<1>>, wide)
    rows = for <<row::binary-size(cells) <- bits>>, into: <<>>, do: <<1, row::binary, 1>>
    edges = for k <- 0..wide, do: (k - wide / 2) / border
    %__MODULE__{edges: edges, row: 1 / border, rows: wide, white: edge <> rows <> edge}
  end

  @doc "The least and the greatest x."
  @spec sides(t()) :: {left :: float(), right :: float()}
  def sides(%__MODULE__{edges: edges}), do: {hd(edges), List.last(edges)}

  @doc "The rows from the top: each a byte for each of its columns."
  @spec rows(t()) :: [binary()]
  def rows(%__MODULE__{edges: edges, white: white}) do
    columns = length(edges) - 1
    for <<row::binary-size(columns) <- white>>, do: row
  end
end
