defmodule Vision.Filter do
  @moduledoc """
  Selects blobs. The filters take a list and return a list, so that they can be chained with `|>`;
  `largest/1` ends the chain.

      blobs
      |> Vision.Filter.real({320, 240})
      |> Vision.Filter.colour("YellowLandmark")
      |> Vision.Filter.least_share(0.0005)
      |> Vision.Filter.largest()
  """
  alias Vision.Blob

  @doc """
  Drops phantoms: blobs whose frame has another size than the camera's, blobs that are
  larger than their frame, and blobs whose box lies outside it. An old simulator reports one of
  22648 by 5 pixels whenever it sees nothing.

      iex> blob = %Vision.Blob{colour: "Red", area: 30, share: 0.1, x: 4.0, y: 2.0, left: 2, top: 0,
      ...>                     right: 6, bottom: 4, width: 20, height: 15}
      iex> phantom = %{blob | width: 22648, height: 5}
      iex> Vision.Filter.real([phantom, blob], {20, 15}) == [blob]
      true
      iex> Vision.Filter.real([%{blob | area: 301}, %{blob | right: 20}], {20, 15})
      []
  """
  @spec real([Blob.t()], {pos_integer(), pos_integer()}) :: [Blob.t()]
  def real(blobs, {width, height}) do
    Enum.filter(blobs, fn blob ->
      {blob.width, blob.height} == {width, height} and blob.area in 1..(width * height) and
        blob.left in 0..blob.right//1 and blob.right < width and
        blob.top in 0..blob.bottom//1 and blob.bottom < height
    end)
  end

  @doc """
  Keeps the blobs of one colour: a camera sees the other robots too.

      iex> Vision.Filter.colour([], "YellowLandmark")
      []
  """
  @spec colour([Blob.t()], String.t()) :: [Blob.t()]
  def colour(blobs, name), do: Enum.filter(blobs, &(&1.colour == name))

  @doc "Drops blobs with fewer pixels: camera noise."
  @spec least_area([Blob.t()], non_neg_integer()) :: [Blob.t()]
  def least_area(blobs, area), do: Enum.filter(blobs, &(&1.area >= area))

  @doc """
  Drops blobs with a smaller share of their frame, which means the same for pictures of any
  size.
  """
  @spec least_share([Blob.t()], float()) :: [Blob.t()]
  def least_share(blobs, share), do: Enum.filter(blobs, &(&1.share >= share))

  @doc """
  The blob with the largest share; the first of equals, and `nil` for an empty list.

      iex> Vision.Filter.largest([])
      nil
  """
  @spec largest([Blob.t()]) :: Blob.t() | nil
  def largest(blobs), do: Enum.max_by(blobs, & &1.share, fn -> nil end)
end
