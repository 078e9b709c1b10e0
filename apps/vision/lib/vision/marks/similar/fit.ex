defmodule Vision.Marks.Similar.Fit do
  @moduledoc false
  # Fits a self-similar pattern to the edges that are seen where a line of origins was found, operation by operation as
  # `similar_read.c` does. Pure.
  alias Vision.Marks.Similar.Pattern

  # Edges with their number, and how far the next ones are to the left and to the right.
  @edges for {[right, t, left], k} <-
               Enum.with_index(Enum.chunk_every(Pattern.edges(), 3, 1, :discard), 1),
             k <= 9,
             do: {t, t - left, right - t, if(rem(k, 2) == 1, do: -1.0, else: 1.0)}
  # So many cells of the barcode are followed in each round.
  @reaches [0, 0, 3, 6, 9]
  @nearest 1.8

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
  @typedoc """
  A pattern in a picture. u and v are x and y in pattern widths from a point of the line of origins, and the place in the pattern is
  t = (a u + b v + c) / (d u + e v + 1), as a plane seen in perspective has it.
  """
  @type t :: %{
          luma: luma(),
          chain: chain(),
          rows: Range.t(),
          x: float(),
          y: float(),
          m: {float(), float(), float(), float(), float()},
          threshold: float(),
          contrast: float()
        }

  @doc "Edges that are nearer to each other, in pixels, are not looked for."
  @spec nearest() :: float()
  def nearest, do: @nearest

  @doc "The pattern whose origins these are; `nil` if there is none."
  @spec fit(luma(), chain()) :: t() | nil
  def fit(luma, chain) do
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

    if sound?(m), do: refined(reader, @reaches)
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

  @doc "The luma in a row of the picture where the pattern is at t."
  @spec look(t(), float(), integer()) :: float()
  def look(reader, t, y), do: sample(reader.luma, column(reader, t, y), y)

  @doc "Where in a row of the picture the pattern is at t."
  @spec column(t(), float(), number()) :: float()
  def column(%{m: {a, b, c, d, e}, chain: %{width: width}} = reader, t, y) do
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
    next = min(before, behind)

    if next < @nearest do
      {sums, looked, met}
    else
      half = min(next / 2.0, 3.0 * reader.chain.scale)
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

  @doc "The sum from the left, as C has it."
  @spec sum([float()]) :: float()
  def sum(values), do: Enum.reduce(values, 0.0, &(&2 + &1))

  defp levels(reader) do
    [white, gap, black, bar] = levels = for t <- [0.7415, 1.05, 0.908, 1.15], do: mean(reader, t)
    contrast = (white + gap - black - bar) / 2.0

    if Enum.all?(levels, &(&1 >= 0.0)) and contrast >= 10.0,
      do: %{reader | threshold: (white + gap + black + bar) / 4.0, contrast: contrast}
  end
end
