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

    runs =
      for row <- 0..(ceil((top - bottom) / cell) - 1)//1,
          y = top - (row + 0.5) * cell,
          {kind, from, count} <- runs(ground, columns, &(left + (&1 + 0.5) * cell), y),
          do: {kind, {row, from, count}}

    for {kind, colour} <- [unknown: @unknown, wall: @wall] do
      Svg.group(
        [fill: colour, shape_rendering: "crispEdges"],
        for({^kind, run} <- runs, do: rectangle(run, cell * scale))
      )
    end
  end

  # Cells of one row that touch become one rectangle.
  defp rectangle({row, from, count}, side) do
    Svg.element(:rect,
      x: from * side,
      y: row * side,
      width: count * side,
      height: side + 0.3
    )
  end

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
