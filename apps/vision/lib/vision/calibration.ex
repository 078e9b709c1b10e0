defmodule Vision.Calibration do
  @moduledoc """
  Derives the limits of a colour from places in a picture that show it. Pure.

  A box that a person draws contains other things too: background in its corners, glare, a shaded
  edge. Therefore:

  1. The **middle** is the most common chroma of the sample: the median of the 3 by 3 cells with
     the most pixels, in a grid with cells of 8 by 8 values of U and V. If there are points, only
     they count here.
  2. Pixels farther from it than 4 standard deviations (by the median of the distances, which a
     few outliers hardly change) or 6 values, whichever is more, are **outliers**.
  3. The limits are the 1st and 99th **percentile** of U and V, and the 2nd and 98th of Y, of the
     remaining pixels.
  4. **Margins** are added: 3 values for U and V, 6 for Y, and the effect of a change of light,
     which makes red, green and blue grow or shrink alike, and with them Y, and the distances of U
     and V from 128. The tolerance of light is the requested one, or the widest of those tried
     with which the picture shows the same blobs as without (`Vision.Calibration.Match.same?/2`).
  """
  alias Hal.Frame
  alias Vision.Calibration.{Match, Sample}
  alias Vision.{Colours, Rgb}

  @tolerances [0.4, 0.3, 0.2, 0.15, 0.1, 0.05, 0.0]
  @margin 3
  @margin_y 6
  @nearest 6
  @fewest 9

  @typedoc "`share` is the part of the sample that was not an outlier."
  @type found :: %{
          class: map(),
          middle: Rgb.yuv(),
          tolerance: float(),
          pixels: pos_integer(),
          share: float(),
          match: Match.t()
        }

  @doc """
  The class `name` from these places (`Vision.Calibration.Sample`) of frames of one size; it is
  judged by the last one. Options: `tolerance` (`:auto`, or 0.0 to 0.9), `min_area` (20, of
  blobs).
  """
  @spec find([Frame.t(), ...], [Sample.place(), ...], String.t(), keyword()) ::
          {:ok, found()} | {:error, String.t()}
  def find(frames, places, name, options \\ []) do
    options = Keyword.validate!(options, tolerance: :auto, min_area: 20)

    with {:ok, {points, boxes}} <- Sample.take(frames, places),
         sample = points ++ boxes,
         middle = middle(if(points == [], do: boxes, else: points)),
         {:ok, kept} <- keep(sample, middle) do
      limits = limits(kept)
      frame = List.last(frames)
      blobs = &Match.blobs(frame, class(name, limits, &1), places, options[:min_area])
      tolerance = tolerance(options[:tolerance], blobs)
      class = class(name, limits, tolerance)

      {:ok,
       %{
         class: class,
         middle: round_all(middle_of(kept)),
         tolerance: tolerance,
         pixels: length(sample),
         share: length(kept) / length(sample),
         match: Match.judge(frame, class, places, options[:min_area])
       }}
    end
  end

  defp tolerance(:auto, blobs) do
    strict = blobs.(0.0)
    Enum.find(@tolerances, 0.0, fn tolerance -> Match.same?(blobs.(tolerance), strict) end)
  end

  defp tolerance(wanted, _blobs), do: wanted * 1.0

  @doc """
  A class with the margins for a tolerance of light, from limits without margins.

      iex> class = Vision.Calibration.class("Grey", %{y: {100, 120}, u: {128, 128}, v: {128, 148}}, 0.1)
      iex> {class.y, class.u, class.v}
      {{84, 138}, {125, 131}, {125, 153}}
  """
  @spec class(
          String.t(),
          %{y: Colours.limits(), u: Colours.limits(), v: Colours.limits()},
          float()
        ) ::
          map()
  def class(name, %{y: {y0, y1}, u: u, v: v} = limits, tolerance) do
    %{
      name: name,
      rgb: Rgb.from_yuv(round_all(centre(limits))),
      merge: 0.5,
      expected: 10,
      y: bounded(y0 * (1 - tolerance) - @margin_y, y1 * (1 + tolerance) + @margin_y),
      u: chroma(u, tolerance),
      v: chroma(v, tolerance)
    }
  end

  defp centre(%{y: {a, b}, u: {c, d}, v: {e, f}}), do: {(a + b) / 2, (c + d) / 2, (e + f) / 2}

  defp chroma({low, high}, tolerance) do
    values =
      for value <- [low, high], k <- [1 - tolerance, 1 + tolerance], do: 128 + (value - 128) * k

    bounded(Enum.min(values) - @margin, Enum.max(values) + @margin)
  end

  defp bounded(low, high), do: {max(floor(low), 0), min(ceil(high), 255)}

  # The median of the pixels in the best cell and its neighbours.
  defp middle(pixels) do
    cells = Enum.frequencies_by(pixels, fn {_y, u, v} -> {div(u, 8), div(v, 8)} end)
    around = fn {a, b} -> for i <- -1..1, j <- -1..1, do: {a + i, b + j} end
    weight = fn cell -> cell |> around.() |> Enum.map(&Map.get(cells, &1, 0)) |> Enum.sum() end
    best = cells |> Map.keys() |> Enum.sort() |> Enum.max_by(weight)
    near = around.(best)
    middle_of(for {_y, u, v} = pixel <- pixels, {div(u, 8), div(v, 8)} in near, do: pixel)
  end

  defp middle_of(pixels) do
    {ys, us, vs} = columns(pixels)
    {median(ys), median(us), median(vs)}
  end

  defp keep(pixels, {_y, mu, mv}) do
    near = for {_y, u, v} <- pixels, abs(u - mu) <= 16, abs(v - mv) <= 16, do: {u, v}
    su = spread(for {u, _v} <- near, do: abs(u - mu))
    sv = spread(for {_u, v} <- near, do: abs(v - mv))
    kept = for {_y, u, v} = pixel <- pixels, abs(u - mu) <= su, abs(v - mv) <= sv, do: pixel

    if length(kept) >= @fewest,
      do: {:ok, kept},
      else: {:error, "only #{length(kept)} pixels of the sample are alike: #{@fewest} are needed"}
  end

  # In a normal distribution the median of the distances is 0.6745 of the standard deviation.
  defp spread([]), do: @nearest
  defp spread(distances), do: max(4 * median(distances) / 0.6745, @nearest)

  defp limits(pixels) do
    {ys, us, vs} = columns(pixels)
    %{y: percentiles(ys, 0.02), u: percentiles(us, 0.01), v: percentiles(vs, 0.01)}
  end

  defp percentiles(values, share) do
    sorted = values |> Enum.sort() |> List.to_tuple()
    last = tuple_size(sorted) - 1
    {elem(sorted, round(share * last)), elem(sorted, round((1 - share) * last))}
  end

  defp median(values) do
    sorted = Enum.sort(values)
    Enum.at(sorted, div(length(sorted), 2))
  end

  defp columns(pixels) do
    {for({y, _, _} <- pixels, do: y), for({_, u, _} <- pixels, do: u),
     for({_, _, v} <- pixels, do: v)}
  end

  defp round_all({y, u, v}), do: {round(y), round(u), round(v)}
end
