defmodule Console.MapSheet do
  @moduledoc """
  Draws the built-in maps side by side (SVG), for the user guide. Pure.

  All are drawn as they are for six robots, each as large as its frame allows.
  """
  alias Console.Cli.Format
  alias Console.Picture.Svg
  alias Sim.Floorplan
  alias Sim.Floorplan.Maps

  @fleet 6
  # Metres a cell of the drawing, and cells.
  @cell 0.1
  @columns 5
  @frame {200, 216}
  @margin 8
  @label 28
  @ink "#22262B"
  @wall "#4A4F57"

  @doc "The drawing."
  @spec draw() :: iodata()
  def draw do
    {wide, high} = @frame
    maps = Maps.names() |> Enum.with_index()
    rows = div(length(maps) + @columns - 1, @columns)

    [
      Svg.element(
        :svg,
        [
          xmlns: "http://www.w3.org/2000/svg",
          width: 1000,
          viewBox: "0 0 #{@columns * wide} #{rows * high}",
          font_family: "DejaVu Sans, Verdana, Helvetica, sans-serif"
        ],
        [
          Svg.element(:rect, width: @columns * wide, height: rows * high, fill: "#FFFFFF"),
          for {name, k} <- maps do
            {x, y} = {rem(k, @columns) * wide, div(k, @columns) * high}
            Svg.group([transform: "translate(#{x + @margin} #{y + @margin})"], one(name))
          end
        ]
      ),
      "\n"
    ]
  end

  defp one(name) do
    {:ok, map} = Floorplan.open(name, @fleet)
    {width, height} = Floorplan.size(map)
    {columns, rows} = {round(width / @cell), round(height / @cell)}

    walls =
      for j <- 0..(rows - 1) do
        y = height / 2 - (j + 0.5) * @cell
        for i <- 0..(columns - 1), do: Floorplan.wall?(map, {(i + 0.5) * @cell - width / 2, y})
      end

    {wide, high} = @frame
    scale = min((wide - 2 * @margin) / columns, (high - 2 * @margin - @label) / rows)
    label = "#{name}, #{Format.decimals(width, 0)} x #{Format.decimals(height, 0)} m"

    [
      Svg.group([transform: "scale(#{Format.decimals(scale, 4)})"], [
        Svg.element(:rect, width: columns, height: rows, fill: "#FBFBF9", stroke: @wall),
        Svg.element(:path, d: path(walls), fill: @wall)
      ]),
      Svg.text(label, 0, rows * scale + 18, font_size: 14, fill: @ink)
    ]
  end

  # Rows that are alike are one, and so are walls that touch in a row.
  defp path(rows) do
    rows
    |> Enum.chunk_by(& &1)
    |> Enum.map_reduce(0, fn [row | _] = alike, y ->
      {Enum.map(runs(row), &rectangle(&1, y, length(alike))), y + length(alike)}
    end)
    |> elem(0)
    |> IO.iodata_to_binary()
  end

  defp rectangle({x, width}, y, height), do: "M#{x} #{y}h#{width}v#{height}h-#{width}z"

  defp runs(row) do
    row
    |> Enum.chunk_by(& &1)
    |> Enum.map_reduce(0, fn chunk, x -> {{hd(chunk), x, length(chunk)}, x + length(chunk)} end)
    |> elem(0)
    |> then(&for {true, x, width} <- &1, do: {x, width})
  end
end
