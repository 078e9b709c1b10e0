defmodule Vision.Marks.Similar.Reading do
  @moduledoc false
  # Reads a self-similar mark where a line of origins was found, operation by operation as `similar_read.c` does. Pure.
  alias Vision.Marks.Similar.Pattern

  @traces [0.575, 0.605, 0.636, 0.85, 0.908, 0.965, 1.125, 1.15, 1.175]
  @least_traces 5
  @quiet [0.575, 0.605, 0.74, 0.88, 0.95, 1.05, 1.15, 1.35, 1.65, 1.95]
  # Edges with their number, and how far the next ones are to the left and to the right.
  @edges for {[right, t, left], k} <-
               Enum.with_index(Enum.chunk_every(Pattern.edges(), 3, 1, :discard), 1),
             k <= 9,
             do: {t, t - left, right - t, if(rem(k, 2) == 1, do: -1.0, else: 1.0)}
  @stripes for {[right, left], k} <-
                 Enum.with_index(Enum.chunk_every(Pattern.edges(), 2, 1, :discard)),
               k in 2..6,
               do: {left, right, 1 - rem(k, 2)}
  # So many cells of the barcode are followed in each round.
  @reaches [0, 0, 3, 6, 9]

  @type luma :: %{width: pos_integer(), height: pos_integer(), bytes: binary()}
  @typedoc "As `struct similar_chain`."
  @type chain :: %{
          x0: float(),
          slope: float(),
          width: float(),
          contrast: float(),
          first: non_neg_integer(),
          last: non_neg_integer(),
          scale: pos_integer()
        }

  @doc "The mark whose origins these are; `nil` if there is none that can be read."
  @spec read(luma(), chain()) :: Vision.Marks.Native.found() | nil
  def read(luma, chain) do
    last = min(chain.last, luma.height - 1)
    y = (chain.first + last) / 2.0
    m = {1.0, -chain.slope, 0.0, 0.0, 0.0}

    reader = %{
      luma: luma,
      chain: chain,
      rows: chain.first..last//chain.scale,
      x: chain.x0 + chain.slope * y,
      y: y,
      m: m,
      threshold: 0.0,
      contrast: 0.0
    }

    with true <- sound?(m),
         %{} = reader <- refined(reader, @reaches),
         {_, _} = top <- ending(reader, -1),
         {_, _} = bottom <- ending(reader, 1),
         reader = Map.merge(reader, %{top: top, bottom: bottom}),
         [{x0, y0}, {x1, y1}, {x2, y2}, {x3, y3}] = corners <- corners(reader),
         true <- whole?(corners) and quiet?(reader),
         id when id != nil <- id(reader) do
      {id, 0, reader.contrast / 2.0, {(x0 + x1 + x2 + x3) / 4.0, (y0 + y1 + y2 + y3) / 4.0},
       corners}
    else
      _none -> nil
    end
  end

  defp refined(reader, []), do: reader

  defp refined(reader, [cells | reaches]) do
    with %{} = reader <- refine(reader, cells),
         %{} = reader <- levels(reader),
         do: refined(reader, reaches)
  end

  # The luma between pixels of a row; -1 outside of the picture.
  defp sample(%{width: width, height: height, bytes: bytes}, x, y) do
    if x >= 0.0 and x < width - 1 and y >= 0 and y < height do
      k = trunc(x)
      part = x - k
      at = y * width + k
      (1.0 - part) * :binary.at(bytes, at) + part * :binary.at(bytes, at + 1)
    else
      -1.0
    end
  end

  defp look(reader, t, y), do: sample(reader.luma, column(reader, t, y), y)

  # Where in a row of the picture the pattern is at t.
  defp column(%{m: {a, b, c, d, e}, chain: %{width: width}} = reader, t, y) do
    v = (y - reader.y) / width
    reader.x + width * ((t - c - (b - t * e) * v) / (a - t * d))
  end

  defp sound?({a, b, c, d, e}) do
    a > 0.3 and a < 3.0 and a - 2.1 * d > 0.1 and abs(b) < 1.0 and abs(c) < 0.5 and
      abs(d) < 0.6 and abs(e) < 0.6
  end

  defp edge(%{luma: %{width: width}}, from, to, _y, _sign) when from < 0 or to >= width, do: nil

  defp edge(%{luma: luma, chain: chain}, from, to, y, sign) do
    row = for j <- from..to, do: :binary.at(luma.bytes, y * luma.width + j) * 1.0
    change = List.last(row) - hd(row)

    if change * sign >= chain.contrast / 4.0 do
      steps = Enum.zip(row, tl(row))

      sum =
        for {{value, next}, j} <- Enum.with_index(steps, from), reduce: 0.0 do
          sum -> sum + (j + 0.5) * (next - value)
        end

      sum / change
    end
  end

  # Fits the pattern to the edges in all rows.
  defp refine(reader, cells) do
    colours =
      for k <- 0..cells,
          do: if(mean(reader, 1.15 + 0.1 * k) < reader.threshold, do: -1.0, else: 1.0)

    code =
      for {[left, right], k} <- Enum.with_index(Enum.chunk_every(colours, 2, 1, :discard)),
          left != right,
          do: {1.2 + 0.1 * k, 0.1, 0.1, right}

    pull =
      for i <- 0..4,
          do: for(j <- 0..5, do: if(i == j and i >= 3, do: 0.002, else: 0.0))

    {sums, looked, met} =
      for y <- reader.rows, edge <- @edges ++ code, reduce: {pull, 0, 0} do
        sums -> add(reader, edge, y, sums)
      end

    with true <- met >= 12 and 2 * met >= looked,
         [a, b, c, d, e] <- solve(sums, 0),
         m = {a, b, c, d, e},
         true <- sound?(m) do
      %{reader | m: m}
    else
      _none -> nil
    end
  end

  defp add(reader, {t, left, right, sign}, y, {sums, looked, met}) do
    here = column(reader, t, y)
    before = here - column(reader, t - left, y)
    behind = column(reader, t + right, y) - here
    half = min(before, behind) / 2.0

    if half < 0.9 do
      {sums, looked, met}
    else
      half = min(half, 3.0 * reader.chain.scale)
      {from, to} = {floor(here - half + 0.5), floor(here + half + 0.5)}
      at = if to - from >= 2, do: edge(reader, from, to, y, sign)

      if at == nil or abs(at - here) > half do
        {sums, looked + 1, met}
      else
        {u, v} = {(at - reader.x) / reader.chain.width, (y - reader.y) / reader.chain.width}
        row = [u, v, 1.0, -t * u, -t * v, t]

        sums =
          for {a, sum} <- Enum.zip(row, sums),
              do: for({b, value} <- Enum.zip(row, sum), do: value + a * b)

        {sums, looked + 1, met + 1}
      end
    end
  end

  # Solves a symmetric positive system by elimination; `nil` if it has no solution.
  defp solve([], _k), do: []

  defp solve([row | rows], k) do
    pivot = Enum.at(row, k)

    if pivot > 1.0e-9 do
      rest = for other <- rows, do: eliminate(other, row, k, Enum.at(other, k) / pivot)

      with solved when solved != nil <- solve(rest, k + 1) do
        {known, [right]} = row |> Enum.drop(k + 1) |> Enum.split(-1)
        [Enum.zip_reduce(known, solved, right, fn a, x, sum -> sum - a * x end) / pivot | solved]
      end
    end
  end

  defp eliminate(other, row, k, factor) do
    for {{value, above}, j} <- Enum.with_index(Enum.zip(other, row)),
        do: if(j < k, do: value, else: value - factor * above)
  end

  # The mean luma along the pattern's line at t; -1 if it leaves the picture.
  defp mean(reader, t) do
    values = for y <- reader.rows, do: look(reader, t, y)
    if Enum.any?(values, &(&1 < 0.0)), do: -1.0, else: sum(values) / Enum.count(values)
  end

  # From the left, with no compensation.
  defp sum(values), do: Enum.reduce(values, 0.0, &(&2 + &1))

  defp levels(reader) do
    [white, gap, black, bar] = levels = for t <- [0.7415, 1.05, 0.908, 1.15], do: mean(reader, t)
    contrast = (white + gap - black - bar) / 2.0

    if Enum.all?(levels, &(&1 >= 0.0)) and contrast >= 10.0,
      do: %{reader | threshold: (white + gap + black + bar) / 4.0, contrast: contrast}
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
    here = look(reader, t, y)

    with true <- here >= 0.0 and here < reader.threshold,
         y when y != nil <- white(reader, t, y + step, step, 0),
         scale = reader.chain.scale,
         {from, to} = {y - step - step * (2 * scale + 1), y - step + step * scale},
         values = for(j <- from..to//step, do: look(reader, t, j)),
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
      {(column(reader, t, at) - reader.x) / width, (at - reader.y) / width}
    else
      _none -> nil
    end
  end

  # The second of two white rows.
  defp white(reader, t, y, step, seen) do
    value = look(reader, t, y)

    cond do
      value < 0.0 -> nil
      value < reader.threshold -> white(reader, t, y + step, step, 0)
      seen == 1 -> y
      true -> white(reader, t, y + step, step, 1)
    end
  end

  defp line(points) do
    n = length(points) * 1.0
    su = sum(for {u, _v} <- points, do: u)
    sv = sum(for {_u, v} <- points, do: v)
    suu = sum(for {u, _v} <- points, do: u * u)
    suv = sum(for {u, v} <- points, do: u * v)
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

  # Else a part of it is hidden.
  defp whole?([{x0, y0}, {x1, y1}, {x2, y2}, {x3, y3}]) do
    {wide, left, right} = {(x1 + x2 - x0 - x3) / 2.0, y3 - y0, y2 - y1}

    left > 0.0 and right > 0.0 and wide > 0.0 and left + right >= 1.8 * wide and
      left + right <= 6.0 * wide and left < 1.7 * right and right < 1.7 * left
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
        look(reader, t, floor(reader.y + reader.chain.width * v + 0.5))
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
         values = for(y <- first..last//reader.chain.scale, do: look(reader, t, y)),
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
    if Enum.all?(@stripes, &stripe?(reader, &1)) and majority(reader, -0.05) != 1 and
         majority(reader, 1.05) == 0 and majority(reader, 1.15) == 1 and
         majority(reader, 2.05) != 1 do
      Pattern.id(for k <- 0..7, do: majority(reader, 1.25 + 0.1 * k))
    end
  end

  # Stripes that are less than two pixels wide are not looked at.
  defp stripe?(reader, {left, right, black}) do
    wide = column(reader, right, reader.y) - column(reader, left, reader.y)
    wide < 2.0 or majority(reader, (left + right) / 2.0) == black
  end
end
