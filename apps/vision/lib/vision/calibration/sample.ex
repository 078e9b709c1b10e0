defmodule Vision.Calibration.Sample do
  @moduledoc """
  Takes the pixels of places in a picture. Pure.

  A place is `{:point, {x, y}}`, which stands for the 5 by 5 pixels around it, or
  `{:box, {x, y, width, height}}`; pixels count from the top left.
  """
  alias Hal.Frame
  alias Vision.{Pixels, Rgb}

  @around 2

  @type place ::
          {:point, {integer(), integer()}} | {:box, {integer(), integer(), integer(), integer()}}
  @type bounds :: {left :: integer(), top :: integer(), right :: integer(), bottom :: integer()}

  @doc """
  The pixels of the points and those of the boxes, in all frames.

      iex> {:ok, frame} = Hal.Frame.new(:yuyv, 2, 1, <<10, 60, 20, 130>>, 0)
      iex> Vision.Calibration.Sample.take([frame], [{:box, {0, 0, 1, 1}}])
      {:ok, {[], [{10, 60, 130}]}}
      iex> Vision.Calibration.Sample.take([frame], [{:point, {5, 0}}])
      {:error, "point 5,0 is not in the picture, which is 2 by 1 pixels"}
  """
  @spec take([Frame.t(), ...], [place(), ...]) ::
          {:ok, {[Rgb.yuv()], [Rgb.yuv()]}} | {:error, String.t()}
  def take([%Frame{width: width, height: height} | _] = frames, places) do
    case Enum.find(places, &(not inside?(&1, width, height))) do
      nil ->
        pictures = Enum.map(frames, &{&1.width, &1 |> Pixels.yuv() |> List.to_tuple()})

        all = fn kind ->
          for(
            {^kind, _} = place <- places,
            picture <- pictures,
            do: pixels(picture, bounds(place, width, height))
          )
        end

        {:ok, {List.flatten(all.(:point)), List.flatten(all.(:box))}}

      place ->
        {:error, "#{words(place)} is not in the picture, which is #{width} by #{height} pixels"}
    end
  end

  defp inside?({:point, {x, y}}, width, height), do: x in 0..(width - 1) and y in 0..(height - 1)

  defp inside?({:box, {x, y, w, h}}, width, height),
    do: x >= 0 and y >= 0 and w >= 1 and h >= 1 and x + w <= width and y + h <= height

  # A place as a person writes it.
  defp words({kind, numbers}), do: "#{kind} #{numbers |> Tuple.to_list() |> Enum.join(",")}"

  @doc """
  The first and last pixels that a place covers; those of a point are limited to a picture of this
  size.

      iex> Vision.Calibration.Sample.bounds({:point, {1, 10}}, 320, 240)
      {0, 8, 3, 12}
  """
  @spec bounds(place(), pos_integer(), pos_integer()) :: bounds()
  def bounds({:point, {x, y}}, width, height) do
    {max(x - @around, 0), max(y - @around, 0), min(x + @around, width - 1),
     min(y + @around, height - 1)}
  end

  def bounds({:box, {x, y, w, h}}, _width, _height), do: {x, y, x + w - 1, y + h - 1}

  defp pixels({width, picture}, {left, top, right, bottom}),
    do: for(y <- top..bottom, x <- left..right, do: elem(picture, y * width + x))
end
