defmodule Bench.Marks.Plot do
  @moduledoc "Draws how far off robots are over time, with and without marks, as SVG. Pure."
  alias Bench.Marks.Round
  alias Console.Picture.Svg

  @width 640
  @height 320
  @left 50
  @low 270
  @right 620
  @high 40
  @colours %{"without marks" => "#B4552D", "with twelve marks" => "#1F6FB2"}

  @typedoc "Runs of one kind by the words of the legend."
  @type runs :: [{String.t(), [[Round.tick()]]}]

  @doc "The drawing: for each second the mean of all robots of all runs (line), and what 95 % of them are within (dashes)."
  @spec svg(runs()) :: iodata()
  def svg(runs) do
    lines = for {words, ticks} <- runs, do: {words, seconds(ticks)}

    most_s =
      lines |> Enum.flat_map(fn {_, line} -> Enum.map(line, &elem(&1, 0)) end) |> Enum.max()

    most_m =
      lines |> Enum.flat_map(fn {_, line} -> Enum.map(line, &elem(&1, 2)) end) |> Enum.max()

    x = &(@left + &1 / most_s * (@right - @left))
    y = &(@low - min(&1 / most_m, 1.0) * (@low - @high))

    Svg.document(@width, @height, [
      grid(most_s, most_m, {x, y}),
      for({{words, line}, n} <- Enum.with_index(lines), do: curves(words, line, n, {x, y}))
    ])
  end

  defp curves(words, line, n, {x, y}) do
    colour = Map.get(@colours, words, "#444444")
    at = fn k -> Svg.points(for point <- line, do: {x.(elem(point, 0)), y.(elem(point, k))}) end
    look = [fill: "none", stroke: colour, stroke_width: 1.5]

    [
      Svg.element(:polyline, [points: at.(1)] ++ look),
      Svg.element(:polyline, [points: at.(2), stroke_dasharray: "3 3"] ++ look),
      Svg.text("#{words}: mean, and 95 % (dashes)", @left + 10 + 290 * n, 24,
        font_size: 12,
        fill: colour
      )
    ]
  end

  defp grid(most_s, most_m, {x, y}) do
    step = if most_m > 1.0, do: 0.5, else: 0.1

    rows =
      for k <- 0..floor(most_m / step),
          at = y.(k * step),
          do: [
            Svg.element(:line, x1: @left, y1: at, x2: @right, y2: at, stroke: "#DDDDDD"),
            Svg.text("#{Float.round(k * step, 1)}", @left - 8, at + 4,
              font_size: 11,
              text_anchor: "end"
            )
          ]

    columns =
      for s <- 0..floor(most_s)//60,
          do: Svg.text("#{s}", x.(s), @low + 18, font_size: 11, text_anchor: "middle")

    [
      rows,
      columns,
      Svg.text("seconds", @right, @low + 38, font_size: 12, text_anchor: "end"),
      Svg.text("m off", @left - 8, @high - 10, font_size: 12, text_anchor: "end")
    ]
  end

  # Time (s), mean and 95 % of what is off in that second.
  defp seconds(runs) do
    runs
    |> Enum.flat_map(fn ticks ->
      for {at_ms, all} <- ticks, {off, _} <- all, do: {div(at_ms - 1, 1_000) + 1, off}
    end)
    |> Enum.group_by(&elem(&1, 0), &elem(&1, 1))
    |> Enum.sort()
    |> Enum.map(fn {second, offs} ->
      {second, Enum.sum(offs) / length(offs), share(offs, 0.95)}
    end)
  end

  @doc "What this share of the numbers are within."
  @spec share([float(), ...], float()) :: float()
  def share(numbers, share) do
    sorted = Enum.sort(numbers)
    Enum.at(sorted, min(floor(share * length(sorted)), length(sorted) - 1))
  end
end
