defmodule Vision.Marks.Similar.Pattern do
  @moduledoc """
  Describes self-similar marks with a barcode: stripes that look the same from any distance, because each of them is sqrt(2/3)
  times as wide as the next one to its right (D. Scharstein and A. Briggs, "Real-time recognition of self-similar landmarks",
  Image and Vision Computing 19, 2001). Pure.

  The square between the corners has side 1; t runs from its left side, where the stripes vanish, to its right side. Edges of
  stripes are at (2/3)^(k/2), and the rightmost stripe is black. The barcode follows: a white gap of 0.1, a black bar of 0.1, and
  eight cells of 0.1, black for 1. They are a word of the extended Hamming code of length 8, in which any two words differ in
  four cells (R. Hamming, "Error detecting and error correcting codes", 1950), with its last two cells turned round: so each has
  two to six black ones, and a bare wall is none. There are 16 ids. White of 0.1 is all round.
  """
  import Bitwise
  alias Vision.Marks.Picture

  # sqrt(2/3) to the power of 0 to 11. Even stripes from the right are black; to the left of the last edge is white.
  @edges [
    1.0,
    0.816496580927726,
    0.6666666666666666,
    0.5443310539518174,
    0.4444444444444445,
    0.36288736930121157,
    0.2962962962962963,
    0.2419249128674744,
    0.19753086419753088,
    0.16128327524498293,
    0.13168724279835392,
    0.10752218349665528
  ]
  @codes 16

  @doc "How many ids there are, from 0."
  @spec ids() :: pos_integer()
  def ids, do: @codes

  @doc """
  The cells of an id's barcode from the left, 1 for black.

      iex> Vision.Marks.Similar.Pattern.code(5)
      [0, 1, 0, 0, 1, 0, 0, 0]
      iex> words = for id <- 0..15, do: Vision.Marks.Similar.Pattern.code(id)
      iex> for(a <- words, b <- words, a != b, do: Enum.zip(a, b) |> Enum.count(fn {x, y} -> x != y end)) |> Enum.min()
      4
  """
  @spec code(0..15) :: [0..1, ...]
  def code(id) when id in 0..(@codes - 1)//1 do
    [a, b, c, d] = for shift <- 3..0//-1, do: id >>> shift &&& 1
    word = [bxor(bxor(a, b), d), bxor(bxor(a, c), d), a, bxor(bxor(b, c), d), b, c]
    word ++ [1 - d, 1 - rem(Enum.sum(word) + d, 2)]
  end

  @doc """
  The id of a barcode; `nil` if it is none. Nothing is corrected: with one wrong cell, more than half of all words would be some
  id's.
  """
  @spec id([0..1, ...]) :: 0..15 | nil
  def id(cells), do: Enum.find(0..(@codes - 1), &(code(&1) == cells))

  @doc """
  Where colours change, from the right: at the right and the left of the black bar, and from stripe to stripe. Beyond an even one
  (the first is 0) it is brighter.
  """
  @spec edges() :: [float(), ...]
  def edges, do: [1.2, 1.1 | @edges]

  @doc "The picture of a mark; `nil` if there is no such id."
  @spec picture(non_neg_integer()) :: Picture.t() | nil
  def picture(id) when id in 0..(@codes - 1)//1 do
    stripes = Enum.reverse(@edges)
    edges = [-0.1] ++ stripes ++ for(k <- 11..21, do: k / 10)
    black = [0] ++ for(k <- 10..0//-1, do: 1 - rem(k, 2)) ++ [0, 1] ++ code(id) ++ [0]
    row = for cell <- black, into: <<>>, do: <<1 - cell>>
    edge = :binary.copy(<<1>>, length(black))

    %Picture{
      edges: for(edge <- edges, do: edge - 0.5),
      row: 0.1,
      rows: 12,
      white: edge <> :binary.copy(row, 10) <> edge
    }
  end

  def picture(_id), do: nil
end
