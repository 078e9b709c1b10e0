defmodule Vision.Marks.Similar do
  @moduledoc """
  Self-similar marks with a barcode: stripes that look the same from any distance, because each of them is sqrt(2/3) times as
  wide as the next one to its right (D. Scharstein and A. Briggs, "Real-time recognition of self-similar landmarks", Image and
  Vision Computing 19, 2001). Such a mark is found row by row, without any library.

  The square between the corners has side 1; x runs from its left side, where the stripes vanish, to its right side. Edges of
  stripes are at (2/3)^(k/2), and the rightmost stripe is black. The barcode follows: a white gap of 0.1, a black bar of 0.1, and
  eight cells of 0.1, black for 1. They are a word of the extended Hamming code of length 8, in which any two words differ in
  four cells (R. Hamming, "Error detecting and error correcting codes", 1950). There are 16 ids. White of 0.1 is all round.

  `search/2` runs in C on a dirty scheduler where that was built, else in Elixir, with the same result to the bit.
  """
  import Bitwise
  alias Hal.Frame
  alias Vision.Marks.{Native, Picture, Schedule}
  alias Vision.Marks.Similar

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
  @ids 16

  @doc "How many ids there are, from 0."
  @spec ids() :: pos_integer()
  def ids, do: @ids

  @doc """
  The cells of an id's barcode from the left, 1 for black.

      iex> Vision.Marks.Similar.code(5)
      [0, 1, 0, 0, 1, 0, 1, 1]
      iex> words = for id <- 0..15, do: Vision.Marks.Similar.code(id)
      iex> for(a <- words, b <- words, a != b, do: Enum.zip(a, b) |> Enum.count(fn {x, y} -> x != y end)) |> Enum.min()
      4
  """
  @spec code(0..15) :: [0..1, ...]
  def code(id) when id in 0..(@ids - 1) do
    [a, b, c, d] = for shift <- 3..0//-1, do: id >>> shift &&& 1
    word = [bxor(bxor(a, b), d), bxor(bxor(a, c), d), a, bxor(bxor(b, c), d), b, c, d]
    word ++ [rem(Enum.sum(word), 2)]
  end

  @doc "The picture of a mark; `nil` if there is no such id."
  @spec picture(non_neg_integer()) :: Picture.t() | nil
  def picture(id) when id in 0..(@ids - 1) do
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

  @doc """
  The marks in a part of a frame, as `Vision.Marks.Native.search/3` tells them, and with its errors.
  """
  @spec search(Frame.t(), Schedule.box()) :: {:ok, [Native.found()]} | {:error, :memory}
  def search(%Frame{} = frame, box), do: kernel().find(frame, box)

  defp kernel, do: if(Similar.Native.loaded?(), do: Similar.Native, else: Similar.Reference)
end
