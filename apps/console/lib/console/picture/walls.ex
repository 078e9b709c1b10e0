defmodule Console.Picture.Walls do
  @moduledoc false
  # Draws the walls of a part of a map, and in another tone what is not known of it. Pure.
  alias Console.Picture.{MapView, Svg}

  @wall "#4A4F57"
  @unknown "#C3C7CE"
  # Cells across the drawing at most, and their least width in metres.
  @most 360
  @least 0.05

  @doc "The colour of walls."
  @spec wall() :: String.t()
  def wall, do: @wall

  @doc "The colour of what is not known."
  @spec unknown() :: String.t()
  def unknown, do: @unknown

  @doc "The walls in a box with `scale` pixels per metre, its upper left corner at 0,0."
  @spec draw(MapView.t(), MapView.box(), float()) :: iodata()
  def draw(ground, {left, bottom, right, top}, scale) do
    cell = max(@least, (right - left) / @most)
    columns = ceil((right - left) / cell)

    rows =
      for row <- 0..(ceil((top - bottom) / cell) - 1)//1,
          do: runs(ground, columns, &(left + (&1 + 0.5) * cell), top - (row + 0.5) * cell)

    bands = bands(rows)

    for {kind, colour} <- [unknown: @unknown, wall: @wall] do
      Svg.group(
        [fill: colour, shape_rendering: "crispEdges"],
        for({row, high, runs} <- bands, {^kind, from, wide} <- runs) do
          side = cell * scale

          Svg.element(:rect,
            x: from * side,
            y: row * side,
            width: wide * side,
            height: high * side + 0.3
          )
        end
      )
    end
  end

  # Rows that are alike are one: `{first, count, runs}`.
  defp bands(rows) do
    rows
    |> Enum.chunk_by(& &1)
    |> Enum.map_reduce(0, fn [runs | _] = alike, row ->
      {{row, length(alike), runs}, row + length(alike)}
    end)
    |> elem(0)
  end

  # Cells of one row that are alike: `{kind, first, count}`.
  defp runs(ground, columns, x, y) do
    0..(columns - 1)
    |> Enum.map(&MapView.kind(ground, x.(&1), y))
    |> Enum.chunk_by(& &1)
    |> Enum.map_reduce(0, fn chunk, from ->
      {{hd(chunk), from, length(chunk)}, from + length(chunk)}
    end)
    |> elem(0)
  end
end
