defmodule Console.Picture.Plot do
  @moduledoc "Draws the lower part of a run's picture: the formation error over time, with the stages. Pure."
  alias Console.Cli.Format
  alias Console.Picture.{RunTrack, Svg}
  alias Console.Picture.Labels

  @ink "#22262B"
  @soft "#8A8F98"
  @max "#D55E00"
  @mean "#0072B2"
  @limit 0.25
  # Of the axis of errors, in metres.
  @marks [0, 0.1, 0.5, 1, 2, 4, 8, 16, 32, 64, 128, 256, 512]
  # Of a curve, at most so many points are drawn.
  @most 1_500
  # Two errors that are farther apart are of two leaders.
  @gap_s 0.75

  @doc """
  The plot in a field of this size, with its upper left corner at 0,0; axis labels are outside.
  """
  @spec draw(RunTrack.t(), float(), float()) :: iodata()
  def draw(track, width, height) do
    end_s = max(track.last.at_ms / 1000, 1.0)
    top = top(track.errors)
    x = fn at_s -> at_s / end_s * width end
    # A square-root scale shows both the first metres of the error and the last centimetres.
    y = fn metres -> height - :math.sqrt(metres / top) * height end

    [
      Svg.element(:rect, width: width, height: height, fill: "#FBFBF9"),
      horizontal(top, width, y),
      vertical(end_s, height, x),
      limit(width, y),
      stages(track, height, x),
      curve(track, x, y, 2, @max),
      curve(track, x, y, 1, @mean),
      Svg.element(:rect,
        width: width,
        height: height,
        fill: "none",
        stroke: @soft,
        stroke_width: 1
      ),
      key(track, width),
      Svg.text("simulated time (s)", width / 2, height + 36, label(text_anchor: "middle")),
      Svg.text(
        "formation error (m)",
        -height / 2,
        -42,
        label(text_anchor: "middle", transform: "rotate(-90)")
      )
    ]
  end

  # The axis ends at the first mark beyond the largest error.
  defp top([]), do: 1.0

  defp top(errors) do
    largest = errors |> Enum.map(&elem(&1, 2)) |> Enum.max()
    Enum.find(@marks, largest, &(&1 >= max(largest, 0.5)))
  end

  defp horizontal(top, width, y) do
    for metres <- @marks, metres <= top do
      at = y.(metres)

      [
        Svg.element(:line, x1: 0, y1: at, x2: width, y2: at, stroke: "#E9E9E4", stroke_width: 1),
        Svg.text("#{metres}", -6, at + 4, label(text_anchor: "end"))
      ]
    end
  end

  defp vertical(end_s, height, x) do
    step = step(end_s, 12)
    last = floor(end_s / step)
    # The end has a mark, too, unless it would be written over the one before.
    ends = if end_s - last * step > 0.5 * step, do: [end_s], else: []

    for at_s <- Enum.map(0..last, &(&1 * step)) ++ ends do
      at = x.(at_s)

      [
        Svg.element(:line,
          x1: at,
          y1: height,
          x2: at,
          y2: height + 4,
          stroke: @soft,
          stroke_width: 1
        ),
        Svg.text(tick(at_s, step), at, height + 17, label(text_anchor: "middle"))
      ]
    end
  end

  # Steps of 1, 2 or 5 times a power of ten, at most `most` of them.
  defp step(span, most) do
    Enum.find(
      for(power <- [0.1, 1.0, 10.0, 100.0, 1000.0], unit <- [1, 2, 5], do: power * unit),
      &(span / &1 <= most)
    )
  end

  defp tick(value, step), do: Format.decimals(value, if(step < 1, do: 1, else: 0))

  defp limit(width, y) do
    at = y.(@limit)

    [
      Svg.element(:line,
        x1: 0,
        y1: at,
        x2: width,
        y2: at,
        stroke: @soft,
        stroke_width: 1,
        stroke_dasharray: "6 4"
      ),
      Svg.text("formed: #{@limit} m", 6, at - 4, label(font_size: 10))
    ]
  end

  defp stages(track, height, x) do
    track.marks
    |> Enum.reverse()
    |> Enum.with_index(1)
    |> Enum.map_reduce(-100.0, fn {{stage, _place}, number}, last ->
      at = x.(stage.at_s)
      # Badges of stages in quick succession stand side by side.
      spot = max(at, last + 17)

      {[
         Svg.element(:line,
           x1: at,
           y1: 0,
           x2: at,
           y2: height,
           stroke: @ink,
           stroke_width: 1,
           stroke_dasharray: "1 3"
         ),
         Labels.badge(number, spot, -10.0)
       ], spot}
    end)
    |> elem(0)
  end

  # Without a leader there is no error, so the curve has a gap there.
  defp curve(track, x, y, index, colour) do
    track.errors
    |> Enum.reverse()
    |> Enum.chunk_while([], &chunk/2, fn part -> {:cont, part, []} end)
    |> Enum.map(fn part ->
      points = part |> thin() |> Enum.map(&{x.(elem(&1, 0)), y.(elem(&1, index))})

      Svg.element(:polyline,
        points: Svg.points(points),
        fill: "none",
        stroke: colour,
        stroke_width: 2,
        stroke_linejoin: "round"
      )
    end)
  end

  defp chunk(error, []), do: {:cont, [error]}

  defp chunk({at_s, _, _} = error, [{last_s, _, _} | _] = part) do
    if at_s - last_s > @gap_s, do: {:cont, part, [error]}, else: {:cont, [error | part]}
  end

  # Of neighbours the worst is drawn, so that no peak is missing.
  defp thin(part) when length(part) > @most,
    do: part |> Enum.chunk_every(div(length(part), div(@most, 2))) |> Enum.map(&worst/1)

  defp thin(part), do: part

  defp worst(errors), do: Enum.max_by(errors, &elem(&1, 2))

  defp key(%{errors: []}, width) do
    Svg.text(
      "no leader, so no formation",
      width / 2,
      40,
      label(text_anchor: "middle", font_size: 13)
    )
  end

  defp key(_track, width) do
    for {name, colour, k} <- [{"worst robot", @max, 0}, {"mean", @mean, 1}] do
      x = width - 190 + 105 * k

      [
        Svg.element(:rect, x: x - 6, y: 6, width: 98, height: 18, fill: "#FFFFFF", opacity: 0.75),
        Svg.element(:line, x1: x, y1: 15, x2: x + 20, y2: 15, stroke: colour, stroke_width: 2.5),
        Svg.text(name, x + 25, 19, label([]))
      ]
    end
  end

  defp label(more), do: Keyword.merge([font_size: 11, fill: @ink], more)
end
