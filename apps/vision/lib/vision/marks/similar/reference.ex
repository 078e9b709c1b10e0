defmodule Vision.Marks.Similar.Reference do
  @moduledoc false
  # Finds self-similar marks in plain Elixir, operation by operation as `similar.c` does. Pure.
  import Bitwise
  alias Hal.Frame
  alias Vision.Marks.Similar.{Fit, Pattern, Reading}

  # As in similar.c.
  @window 24
  @band 4
  @least_contrast 40
  @gap 2
  @aside 2
  @least_bands 4
  @profile 64
  @widths 36..104
  @shifts -2..2

  # For each pixel of the window, what it is compared with: a pixel, and how much of the next one, in 256ths.
  @offsets (for k <- 1..@window do
              turned = (k * 13_698_540 + 32_768) >>> 16
              same = div(k * 512 + 1, 3)
              {k, {turned >>> 8, turned &&& 255}, {same >>> 8, same &&& 255}}
            end)

  @doc "What is found in a part of a frame, in pixels of the part."
  @spec find(Frame.t(), Vision.Marks.Schedule.box()) :: {:ok, [Vision.Marks.Native.found()]}
  def find(%Frame{} = frame, box) do
    luma = luma(frame, box)
    {:ok, luma |> bands() |> levels(1, luma, [])}
  end

  @doc "The luma of a part of a frame."
  @spec luma(Frame.t(), Vision.Marks.Schedule.box()) :: Fit.luma()
  def luma(%Frame{format: format, width: width, bytes: bytes}, {left, top, right, bottom}) do
    step = if format == :yuyv, do: 2, else: 1

    rows =
      for y <- top..(bottom - 1), into: <<>> do
        row = binary_part(bytes, (y * width + left) * step, (right - left) * step)
        if step == 1, do: row, else: for(<<luma, _chroma <- row>>, into: <<>>, do: <<luma>>)
      end

    %{width: right - left, height: bottom - top, bytes: rows}
  end

  # The sums of four rows; of coarser copies the means of four of the finer.
  defp bands(%{width: width, height: height, bytes: bytes}) do
    for r <- 0..(div(height, @band) - 1)//1 do
      part = binary_part(bytes, r * @band * width, @band * width)
      rows = for <<row::binary-size(width) <- part>>, do: :binary.bin_to_list(row)
      rows |> Enum.zip_with(&Enum.sum/1) |> List.to_tuple()
    end
  end

  defp halve(bands) do
    for [above, below] <- Enum.chunk_every(bands, 2, 2, :discard) do
      for x <- 0..(div(tuple_size(above), 2) - 1)//1 do
        (elem(above, 2 * x) + elem(above, 2 * x + 1) + elem(below, 2 * x) + elem(below, 2 * x + 1) +
           2) >>> 2
      end
      |> List.to_tuple()
    end
  end

  # The marks of all copies, the last one first.
  defp levels([first | _] = bands, scale, luma, found)
       when tuple_size(first) > @window + 1 and length(bands) >= @least_bands do
    rows = List.to_tuple(bands)

    found =
      for chain <- chains(bands),
          line = measure(rows, scale, chain),
          mark = Reading.read(luma, line),
          reduce: found,
          do: (found -> if(Enum.any?(found, &same?(&1, mark)), do: found, else: [mark | found]))

    levels(halve(bands), 2 * scale, luma, found)
  end

  defp levels(_too_small, _scale, _luma, found), do: found

  # Coarser copies show some marks again.
  defp same?({_, _, _, {other_x, other_y}, [{left, _}, {right, _} | _]}, {_, _, _, {x, y}, _}) do
    {dx, dy, wide} = {other_x - x, other_y - y, right - left}
    dx * dx + dy * dy < wide * wide / 4.0
  end

  # Lines of origins: places {band, x}, the last one first. In the order of their ends.
  defp chains(bands) do
    {open, closed} =
      bands
      |> Enum.with_index()
      |> Enum.reduce({[], []}, fn {band, r}, {open, closed} ->
        {kept, ended} = Enum.split_with(open, fn [{last, _x} | _] -> last >= r - @gap end)
        {band |> peaks() |> Enum.reduce(kept, &link(&2, {r, &1})), ended ++ closed}
      end)

    (open ++ closed) |> Enum.filter(&(length(&1) >= @least_bands)) |> Enum.sort_by(&hd/1)
  end

  # At the end of the nearest chain that ends in one of the bands above, or of none.
  defp link(open, {r, x}) do
    best =
      for {[{band, end_x} | _], k} <- Enum.with_index(open),
          band < r and abs(end_x - x) <= @aside,
          do: {abs(end_x - x), k}

    case Enum.min(best, fn -> nil end) do
      nil -> open ++ [[{r, x}]]
      {_off, k} -> List.update_at(open, k, &[{r, x} | &1])
    end
  end

  defp peaks(band) do
    count = tuple_size(band) - @window - 1
    scores = List.to_tuple(for x <- 0..(count - 1), do: score(band, x))
    for x <- 0..(count - 1), peak?(band, scores, count, x), do: x
  end

  defp score(band, x) do
    for {k, turned, same} <- @offsets, reduce: 0 do
      sum ->
        value = elem(band, x + k) <<< 8
        sum + abs(value - at(band, x, turned)) - abs(value - at(band, x, same))
    end
  end

  defp at(band, x, {k, part}),
    do: elem(band, x + k) * (256 - part) + elem(band, x + k + 1) * part

  defp peak?(band, scores, count, x) do
    score = elem(scores, x)

    Enum.all?(1..3, fn k ->
      (x < k or elem(scores, x - k) < score) and
        (x + k >= count or elem(scores, x + k) <= score)
    end) and strong?(score, for(k <- 0..@window, do: elem(band, x + k)))
  end

  defp strong?(score, pixels) do
    {least, most} = Enum.min_max(pixels)
    most - least >= @least_contrast and score * 5 >= (most - least) * 256 * @window
  end

  # The line of a chain, and what its pattern is like; `nil` if it is none.
  defp measure(rows, scale, [{last, _x} | _] = chain) do
    {first, _x} = List.last(chain)
    sum = fn value -> chain |> Enum.map(value) |> Enum.sum() end
    {n, sr, sx} = {length(chain), sum.(&elem(&1, 0)), sum.(&elem(&1, 1))}
    {srr, srx} = {sum.(fn {r, _x} -> r * r end), sum.(fn {r, x} -> r * x end)}
    slope = (n * srx - sr * sx) / (n * srr - sr * sr)
    x0 = (sx - slope * sr) / n

    off =
      for {r, x} <- chain, reduce: 0.0 do
        off ->
          d = x - (x0 + slope * r)
          off + d * d
      end

    if off <= 2.25 * n do
      profile =
        for u <- 0..(@profile - 1) do
          for r <- first..last, reduce: 0.0 do
            sum -> sum + between(elem(rows, r), x0 + slope * r + u)
          end
        end

      {width, shift} = widest(profile)

      inside =
        [hd(profile)] ++
          for {value, u} <- Enum.with_index(profile), u > 0 and u < 1.2 * width, do: value

      {least, most} = Enum.min_max(inside)
      from = x0 + shift + slope * (0.125 / scale - 0.5)

      %{
        x0: (from + 0.5) * scale - 0.5,
        slope: slope / 4.0,
        width: width * scale,
        contrast: (most - least) / (4 * (last - first + 1)),
        first: first * @band * scale,
        last: (last + 1) * @band * scale - 1,
        scale: scale
      }
    end
  end

  defp between(row, x) do
    last = tuple_size(row) - 1

    cond do
      x <= 0.0 ->
        elem(row, 0)

      x >= last ->
        elem(row, last)

      true ->
        k = trunc(x)
        part = x - k
        (1.0 - part) * elem(row, k) + part * elem(row, k + 1)
    end
  end

  # The width that fits best, and how far to the right the pattern begins; the first of equals.
  defp widest(profile) do
    numbered = Enum.with_index(profile)

    {_fits, place} =
      for half <- @widths, shift <- @shifts, reduce: {-1.0e9, nil} do
        {best, place} ->
          fits = fit(numbered, half / 2.0, shift)
          if fits > best, do: {fits, {half / 2.0, shift}}, else: {best, place}
      end

    place
  end

  defp fit(profile, width, shift) do
    {both, signs, values, n} =
      for {value, u} <- profile,
          t = (u - shift) / width,
          t >= 0.2 and t <= 1.15,
          reduce: {0.0, 0.0, 0.0, 0.0} do
        {both, signs, values, n} ->
          sign = stripe(t)
          {both + sign * value, signs + sign, values + value, n + 1.0}
      end

    (both - signs * values / n) / n
  end

  # Black is -1, white 1.
  defp stripe(t) do
    k = Enum.find_index(tl(Pattern.edges()), &(t >= &1))
    if rem(k, 2) == 0, do: -1.0, else: 1.0
  end
end
