defmodule Vision.Runs do
  @moduledoc """
  Finds the regions of a picture of masks, for a backend that computes the masks of all pixels and leaves the rest. A
  run is a longest piece of a row whose pixels have the same mask, not 0. A run that touches runs of the same mask in
  the row above joins their regions into one.

  The time grows with the runs, not with the pixels: empty rows cost almost nothing, and a frame of
  speckle much.
  """
  import Bitwise
  alias Vision.{Backend, Colours}

  @doc """
  The regions, as `Vision.Backend.Reference` gives and orders them. `masks` has 32 bits, in the order
  of the machine, for each pixel.

      iex> {:ok, colours} = Vision.Colours.new([%{name: "a", y: {1, 9}, u: {0, 255}, v: {0, 255}}], min_area: 2)
      iex> masks = for mask <- [1, 1, 0, 0, 1, 1], into: <<>>, do: <<mask::32-native>>
      iex> Vision.Runs.regions(masks, 3, colours)
      [{0, 4, 4, 2, 0, 0, 2, 1}]
  """
  @spec regions(binary(), pos_integer(), Colours.t()) :: [Backend.region()]
  def regions(masks, width, %Colours{} = colours) do
    bytes = 4 * width
    empty = <<0::size(bytes)-unit(8)>>
    start = %{y: 0, above: [], next: 0, label: nil, joined: %{}, regions: %{}}

    state =
      for <<row::binary-size(bytes) <- masks>>, reduce: start do
        state when row == empty -> %{state | y: state.y + 1, above: []}
        state -> row(row, state)
      end

    state.regions
    |> Enum.filter(fn {_label, {_, area, _, _, _, _, _, _}} -> allowed?(area, colours) end)
    |> Enum.map(fn {label, region} ->
      {label, put_elem(region, 0, lowest_bit(elem(region, 0)))}
    end)
    |> Enum.sort_by(fn {label, {class, area, _, _, left, top, _, _}} ->
      {class, -area, top, left, label}
    end)
    |> Enum.map(&elem(&1, 1))
  end

  # A label is the number of a region's first run, so of two labels the smaller one is kept.
  defp row(row, %{y: y} = state) do
    state = %{state | above: [], y: y + 1} |> join(runs(row, 0, []), state.above, y)
    %{state | above: Enum.reverse(state.above)}
  end

  defp join(state, [], _above, _y), do: state

  defp join(state, [{mask, first, last} | runs], above, y) do
    above = Enum.drop_while(above, fn {_mask, _first, last, _label} -> last < first end)
    region = region(mask, first, last, y)

    state =
      case touched(above, mask, last, state.joined, []) do
        [] -> put(%{state | next: state.next + 1}, state.next, region, [])
        [label] -> put(state, label, region, [])
        labels -> put(state, Enum.min(labels), region, labels)
      end

    join(%{state | above: [{mask, first, last, state.label} | state.above]}, runs, above, y)
  end

  defp touched([{mask, first, _last, label} | above], mask, last, joined, labels)
       when first <= last do
    root = root(joined, label)
    labels = if root in labels, do: labels, else: [root | labels]
    touched(above, mask, last, joined, labels)
  end

  defp touched([{_mask, first, _last, _label} | above], mask, last, joined, labels)
       when first <= last,
       do: touched(above, mask, last, joined, labels)

  defp touched(_above, _mask, _last, _joined, labels), do: labels

  defp put(state, label, region, labels) do
    others = List.delete(labels, label)
    {parts, regions} = Map.split(state.regions, others)
    region = Enum.reduce(Map.values(parts), region, &add/2)
    regions = Map.update(regions, label, region, &add(&1, region))

    joined =
      for other <- others, reduce: state.joined, do: (joined -> Map.put(joined, other, label))

    %{state | label: label, regions: regions, joined: joined}
  end

  defp root(joined, label) do
    case joined do
      %{^label => smaller} -> root(joined, smaller)
      _ -> label
    end
  end

  defp runs(<<>>, _x, runs), do: Enum.reverse(runs)
  defp runs(<<0::32, rest::binary>>, x, runs), do: runs(rest, x + 1, runs)
  defp runs(<<mask::32-native, rest::binary>>, x, runs), do: run(rest, mask, x, x + 1, runs)

  defp run(<<mask::32-native, rest::binary>>, mask, first, x, runs),
    do: run(rest, mask, first, x + 1, runs)

  defp run(rest, mask, first, x, runs), do: runs(rest, x, [{mask, first, x - 1} | runs])

  defp region(mask, first, last, y) do
    area = last - first + 1
    {mask, area, div(area * (first + last), 2), area * y, first, y, last, y}
  end

  defp add({mask, area, sum_x, sum_y, left, top, right, bottom}, {mask, a, x, y, l, t, r, b}) do
    {mask, area + a, sum_x + x, sum_y + y, min(left, l), min(top, t), max(right, r),
     max(bottom, b)}
  end

  defp allowed?(area, %Colours{min_area: least, max_area: most}),
    do: area >= least and (most == 0 or area <= most)

  defp lowest_bit(mask), do: Enum.find(0..31, &((mask >>> &1 &&& 1) == 1))
end
