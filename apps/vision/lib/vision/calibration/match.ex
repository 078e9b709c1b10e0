defmodule Vision.Calibration.Match do
  @moduledoc false
  # Measures how well a colour's limits separate an object from the rest of a picture. Pure.
  #
  # A blob that touches one of the places is part of the object; every other blob is background.
  alias Hal.Frame
  alias Vision.{Blob, Colours, Pixels}
  alias Vision.Calibration.Sample

  @growth 2

  @typedoc """
  In pixels: `inside` is the size of the places, `hit` how many of them have the colour, `outside`
  how many other pixels have it; `background` is the area of the blobs that touch no place.
  `blobs` are those of the object, `others` those of the background, largest first.
  """
  @type t :: %{
          inside: non_neg_integer(),
          hit: non_neg_integer(),
          outside: non_neg_integer(),
          background: non_neg_integer(),
          blobs: [Blob.t()],
          others: [Blob.t()]
        }

  @doc """
  Judges a class (`Vision.Calibration.class/3`) by a frame; blobs below `min_area` pixels do not
  count.
  """
  @spec judge(Frame.t(), map(), [Sample.place(), ...], pos_integer()) :: t()
  def judge(%Frame{width: width, height: height} = frame, class, places, min_area) do
    {own, others} = blobs(frame, class, places, min_area)
    {:ok, colours} = Colours.new([class])

    {inside, hit, outside} =
      count(frame, colours, Enum.map(places, &Sample.bounds(&1, width, height)))

    %{
      inside: inside,
      hit: hit,
      outside: outside,
      background: others |> Enum.map(& &1.area) |> Enum.sum(),
      blobs: own,
      others: others
    }
  end

  @doc "The object's blobs, and the others."
  @spec blobs(Frame.t(), map(), [Sample.place(), ...], pos_integer()) :: {[Blob.t()], [Blob.t()]}
  def blobs(%Frame{width: width, height: height} = frame, class, places, min_area) do
    {:ok, colours} = Colours.new([class], min_area: min_area)
    {:ok, blobs} = Vision.blobs(frame, colours)
    bounds = Enum.map(places, &Sample.bounds(&1, width, height))
    Enum.split_with(blobs, fn blob -> Enum.any?(bounds, &touches?(blob, &1)) end)
  end

  @doc """
  Whether wider limits find the same things as strict ones: no additional blob, and none that is
  more than twice as large, because an object that merges with its background is not found.
  """
  @spec same?({[Blob.t()], [Blob.t()]}, {[Blob.t()], [Blob.t()]}) :: boolean()
  def same?({own, others}, {strict_own, strict_others}) do
    area(own) <= @growth * area(strict_own) and
      Enum.all?(others, fn blob ->
        bounds = {blob.left, blob.top, blob.right, blob.bottom}
        blob.area <= @growth * area(Enum.filter(strict_others, &touches?(&1, bounds)))
      end)
  end

  defp area(blobs), do: blobs |> Enum.map(& &1.area) |> Enum.sum()

  defp touches?(%Blob{} = blob, {left, top, right, bottom}),
    do: blob.left <= right and blob.right >= left and blob.top <= bottom and blob.bottom >= top

  defp count(%Frame{width: width} = frame, colours, bounds) do
    frame
    |> Pixels.yuv()
    |> Enum.with_index()
    |> Enum.reduce({0, 0, 0}, fn {yuv, index}, {inside, hit, outside} ->
      {x, y} = {rem(index, width), div(index, width)}
      in? = Enum.any?(bounds, fn {l, t, r, b} -> x in l..r//1 and y in t..b//1 end)
      match? = Colours.mask(colours, yuv) != 0
      {inside + one(in?), hit + one(in? and match?), outside + one(match? and not in?)}
    end)
  end

  defp one(true), do: 1
  defp one(false), do: 0
end
