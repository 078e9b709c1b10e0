defmodule Vision.Marks.Similar.Reading do
  @moduledoc false
  # Reads a self-similar mark where a line of origins was found, operation by operation as `similar_read.c` does. Pure.
  alias Vision.Marks.Similar.{Fit, Pattern}

  @traces [0.575, 0.605, 0.636, 0.85, 0.908, 0.965, 1.125, 1.15, 1.175]
  @least_traces 5
  @least_wide 20.0
  @quiet [0.575, 0.605, 0.74, 0.88, 0.95, 1.05, 1.15, 1.35, 1.65, 1.95]
  @stripes for {[right, left], k} <-
                 Enum.with_index(Enum.chunk_every(Pattern.edges(), 2, 1, :discard)),
               k in 2..6,
               do: {left, right, 1 - rem(k, 2)}

  @doc "The mark whose origins these are; `nil` if there is none that can be read."
  @spec read(Fit.luma(), Fit.chain()) :: Vision.Marks.Native.found() | nil
  def read(luma, chain) do
    with %{} = reader <- Fit.fit(luma, chain),
         {_, _} = top <- ending(reader, -1),
         {_, _} = bottom <- ending(reader, 1),
         reader = Map.merge(reader, %{top: top, bottom: bottom}),
         [{x0, y0}, {x1, y1}, {x2, y2}, {x3, y3}] = corners <- corners(reader),
         true <- whole?(reader, corners) and quiet?(reader),
         id when id != nil <- id(reader) do
      {id, 0, reader.contrast / 2.0, {(x0 + x1 + x2 + x3) / 4.0, (y0 + y1 + y2 + y3) / 4.0},
       corners}
    else
      _none -> nil
    end
  end

  # The line v = a + b u where the stripes end above (-1) or below (1).
  defp ending(reader, step) do
    most = reader.chain.scale / reader.chain.width
    points = for t <- @traces, point = trace(reader, t, step), do: point

    with {a, b} <- line(points),
         near = Enum.filter(points, fn {u, v} -> abs(v - (a + b * u)) <= most end),
         {_a, b} = line when abs(b) < 1.5 <- line(near) do
      line
    else
      _none -> nil
    end
  end

  defp trace(reader, t, step) do
    y = floor(reader.y)
    here = Fit.look(reader, t, y)

    with true <- here >= 0.0 and here < reader.threshold,
         y when y != nil <- white(reader, t, y + step, step, 0),
         scale = reader.chain.scale,
         {from, to} = {y - step - step * (2 * scale + 1), y - step + step * scale},
         values = for(j <- from..to//step, do: Fit.look(reader, t, j)),
         true <- Enum.all?(values, &(&1 >= 0.0)),
         change = List.last(values) - hd(values),
         true <- change >= reader.contrast / 3.0 do
      sum =
        for {[value, next], k} <- Enum.with_index(Enum.chunk_every(values, 2, 1, :discard)),
            reduce: 0.0 do
          sum -> sum + (from + k * step + 0.5 * step) * (next - value)
        end

      at = sum / change
      width = reader.chain.width
      {(Fit.column(reader, t, at) - reader.x) / width, (at - reader.y) / width}
    else
      _none -> nil
    end
  end

  # The second of two white rows.
  defp white(reader, t, y, step, seen) do
    value = Fit.look(reader, t, y)

    cond do
      value < 0.0 -> nil
      value < reader.threshold -> white(reader, t, y + step, step, 0)
      seen == 1 -> y
      true -> white(reader, t, y + step, step, 1)
    end
  end

  defp line(points) do
    n = length(points) * 1.0
    su = Fit.sum(for {u, _v} <- points, do: u)
    sv = Fit.sum(for {_u, v} <- points, do: v)
    suu = Fit.sum(for {u, _v} <- points, do: u * u)
    suv = Fit.sum(for {u, v} <- points, do: u * v)
    det = n * suu - su * su

    if n >= @least_traces and det > 1.0e-3 do
      b = (n * suv - su * sv) / det
      {(sv - b * su) / n, b}
    end
  end

  # Where the pattern's line at t meets an end of the stripes.
  defp meet(%{m: {a, b, c, d, e}}, t, {from, slope}) do
    across = a - t * d + (b - t * e) * slope

    if across > 0.05 do
      u = (t - c - (b - t * e) * from) / across
      {u, from + slope * u}
    end
  end

  defp corners(reader) do
    corners =
      for {t, ending} <- [
            {0.0, reader.top},
            {1.0, reader.top},
            {1.0, reader.bottom},
            {0.0, reader.bottom}
          ],
          {u, v} <- [meet(reader, t, ending)],
          do: {reader.x + reader.chain.width * u, reader.y + reader.chain.width * v}

    if length(corners) == 4, do: corners
  end

  # The square is wide enough for its barcode, and at least about as high as it seems to be wide: else a part of it is
  # hidden. It is higher where the stripes say that it is nearer: heights go with 1 + d u.
  defp whole?(%{m: {_, _, _, d, _}} = reader, [{x0, y0}, {x1, y1}, {x2, y2}, {x3, y3}]) do
    width = reader.chain.width
    first = 1.0 + d * ((x0 + x3) / 2.0 - reader.x) / width
    second = 1.0 + d * ((x1 + x2) / 2.0 - reader.x) / width
    {wide, left, right} = {(x1 + x2 - x0 - x3) / 2.0, y3 - y0, y2 - y1}

    left > 0.0 and right > 0.0 and wide >= @least_wide and left + right >= 1.8 * wide and
      left + right <= 6.0 * wide and left * second < 1.2 * right * first and
      right * first < 1.2 * left * second
  end

  # Whether there is white above and below.
  defp quiet?(reader), do: Enum.all?([-1, 1], &quiet?(reader, &1))

  defp quiet?(reader, side) do
    values =
      for t <- @quiet,
          {_u, top} <- [meet(reader, t, reader.top)],
          {_u, bottom} <- [meet(reader, t, reader.bottom)] do
        away = 0.06 * (bottom - top)
        v = if side < 0, do: top - away, else: bottom + away
        Fit.look(reader, t, floor(reader.y + reader.chain.width * v + 0.5))
      end

    length(values) == 10 and Enum.count(values, &(&1 >= reader.threshold)) >= 8
  end

  # 1 if the pattern's line at t is black in at least seven of ten rows, 0 if it is white, else -1.
  defp majority(reader, t) do
    with {_u, top} <- meet(reader, t, reader.top),
         {_u, bottom} <- meet(reader, t, reader.bottom),
         {width, inside} = {reader.chain.width, (bottom - top) * 0.08},
         first = ceil(reader.y + width * (top + inside)),
         last = floor(reader.y + width * (bottom - inside)),
         values = for(y <- first..last//reader.chain.scale, do: Fit.look(reader, t, y)),
         rows = length(values),
         true <- rows >= 8 and Enum.all?(values, &(&1 >= 0.0)),
         black = Enum.count(values, &(&1 < reader.threshold)) do
      cond do
        10 * black >= 7 * rows -> 1
        10 * black <= 3 * rows -> 0
        true -> -1
      end
    else
      _outside -> -1
    end
  end

  defp id(reader) do
    if Enum.all?(@stripes, &stripe?(reader, &1)) and followed?(reader) and
         majority(reader, -0.05) != 1 and
         majority(reader, 1.05) == 0 and majority(reader, 1.15) == 1 and
         majority(reader, 2.05) != 1 do
      Pattern.id(for k <- 0..7, do: majority(reader, 1.25 + 0.1 * k))
    end
  end

  # Where the last cells are narrower, the fit has not followed the barcode to its end.
  defp followed?(reader),
    do: Fit.column(reader, 2.0, reader.y) - Fit.column(reader, 1.9, reader.y) >= Fit.nearest()

  # Stripes that are less than two pixels wide are not looked at.
  defp stripe?(reader, {left, right, black}) do
    wide = Fit.column(reader, right, reader.y) - Fit.column(reader, left, reader.y)
    wide < 2.0 or majority(reader, (left + right) / 2.0) == black
  end
end
