defmodule Vision.Backend.Reference do
  @moduledoc """
  Defines a region in plain Elixir: a map of all coloured pixels, and a flood fill over it. It reads every format. It
  compares pixels with the limits of the classes, not with the tables, so that a comparison also checks the tables of
  the faster backends.
  """
  @behaviour Vision.Backend
  import Bitwise
  alias Hal.Frame
  alias Vision.{Colours, Pixels}

  @impl Vision.Backend
  def reads?(format), do: format in Frame.formats()

  @impl Vision.Backend
  def regions(%Frame{} = frame, %Colours{} = colours) do
    regions =
      frame
      |> masks(colours.classes)
      |> flood_all()
      |> Enum.filter(&allowed?(&1, colours))
      |> Enum.sort_by(fn {class, area, _, _, left, top, _, _} -> {class, -area, top, left} end)

    {:ok, regions}
  end

  # {row, x} => mask, for the coloured pixels only.
  defp masks(%Frame{width: width} = frame, classes) do
    numbered = Enum.with_index(classes)

    for {pixel, index} <- Enum.with_index(Pixels.yuv(frame)),
        mask = mask(pixel, numbered),
        mask != 0,
        into: %{},
        do: {{div(index, width), rem(index, width)}, mask}
  end

  defp mask({y, u, v}, numbered) do
    for {class, k} <- numbered,
        inside?(y, class.y) and inside?(u, class.u) and inside?(v, class.v),
        reduce: 0,
        do: (mask -> mask ||| 1 <<< k)
  end

  defp inside?(value, {lowest, highest}), do: value >= lowest and value <= highest

  # In reading order, so that regions come in the order of their first pixels.
  defp flood_all(masks) do
    {regions, _rest} =
      masks
      |> Enum.sort()
      |> Enum.reduce({[], masks}, fn {place, mask}, {regions, left} ->
        case left do
          %{^place => ^mask} ->
            {places, left} = flood([place], mask, [], Map.delete(left, place))
            {[region(places, mask) | regions], left}

          _visited ->
            {regions, left}
        end
      end)

    Enum.reverse(regions)
  end

  defp flood([], _mask, places, left), do: {places, left}

  defp flood([{row, x} = place | open], mask, places, left) do
    near =
      for next <- [{row - 1, x}, {row, x - 1}, {row, x + 1}, {row + 1, x}],
          left[next] == mask,
          do: next

    flood(near ++ open, mask, [place | places], Map.drop(left, near))
  end

  defp region(places, mask) do
    {rows, columns} = Enum.unzip(places)
    {top, bottom} = Enum.min_max(rows)
    {left, right} = Enum.min_max(columns)

    {lowest_bit(mask), length(places), Enum.sum(columns), Enum.sum(rows), left, top, right,
     bottom}
  end

  defp lowest_bit(mask), do: Enum.find(0..31, &((mask >>> &1 &&& 1) == 1))

  defp allowed?({_, area, _, _, _, _, _, _}, %Colours{min_area: least, max_area: most}),
    do: area >= least and (most == 0 or area <= most)
end
