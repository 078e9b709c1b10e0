defmodule Nav.MapFile.Picture do
  @moduledoc """
  Describes what a picture shows of walls, and the cells they fill. Pure.

  Pixels darker than half are wall, and so is the grey of what is unknown (`unknown/1`) with all that is darker. Specks are
  no walls: dark pixels that touch no others, and lie within 3 x 3 pixels and 0.15 x 0.15 m.
  """
  alias Nav.MapFile.Runs

  @typedoc "Rows from the top, one byte a pixel: 0 is black, 255 is white."
  @type t :: {width :: pos_integer(), height :: pos_integer(), rows :: [binary()]}

  @cell 0.05
  @speck_pixels 3
  @speck_m 0.15

  # A light shade of at least this share of all pixels is an area, and no edge between two others; of so many pixels the share
  # is taken. Shades of one area differ by less than this.
  @share 0.05
  @sample 1_000_000
  @alike 10

  # A row takes its time however short it is.
  @most_side 20_000

  @doc "Whether a picture of so many pixels is read, by its head; `most` is how many it may have. The error is one line."
  @spec size(integer(), integer(), most :: pos_integer()) :: :ok | {:error, String.t()}
  def size(width, height, most) do
    cond do
      width < 1 or height < 1 ->
        {:error, "the picture is damaged"}

      width > @most_side or height > @most_side or width * height > most ->
        {:error,
         "#{width} x #{height} pixels are too many: up to #{@most_side} a side and #{div(most, 1_000_000)} " <>
           "million in all are read"}

      true ->
        :ok
    end
  end

  @doc """
  The grey that stands for what is unknown in a picture without a description, `nil` if there is none.

  It is 205 in a picture of exactly the three shades that map_server writes, 0 for wall, 205 for unknown and 254 for floor.
  In any other it is a light grey of at least 5 % of all pixels, if a lighter shade, that of floor, has as many, and no third
  light one.

      iex> plan = fn grey -> {10, 2, [<<0, 0, 255, 255, 255, 255, 255, 255, grey, grey>>, <<255::80>>]} end
      iex> for grey <- [178, 230, 250, 100], do: Nav.MapFile.Picture.unknown(plan.(grey))
      [178, 230, nil, nil]
  """
  @spec unknown(t()) :: byte() | nil
  def unknown({_width, _height, rows} = picture) do
    if Enum.reduce_while(rows, {false, false}, &three_shades/2) == {true, true},
      do: 205,
      else: picture |> light_areas() |> third()
  end

  # Of floor, the lightest, and one other.
  defp third([]), do: nil

  defp third([floor | others]) do
    case Enum.drop_while(others, &(&1 > floor - @alike)) do
      [grey | darker] -> if Enum.all?(darker, &(&1 > grey - @alike)), do: grey
      [] -> nil
    end
  end

  # The lightest first.
  defp light_areas({width, height, rows}) do
    pixels =
      rows
      |> Enum.take_every(max(div(width * height, @sample), 1))
      |> Enum.flat_map(&:binary.bin_to_list/1)

    least = @share * length(pixels)
    areas = for {shade, n} <- Enum.frequencies(pixels), shade >= 128 and n >= least, do: shade
    Enum.sort(areas, :desc)
  end

  @doc "Which shades are wall in a picture without a description, given the grey of what is unknown in it."
  @spec shades(unknown :: byte() | nil) :: Runs.marks()
  def shades(unknown), do: Runs.marks(&(&1 < 128 or (unknown != nil and &1 <= unknown)))

  # Whether 205 and 254 were seen, as long as there is no other shade than these and 0.
  defp three_shades(row, {unknown?, floor?}) do
    if three_shades?(row),
      do: {:cont, {unknown? or has?(row, 205), floor? or has?(row, 254)}},
      else: {:halt, :more}
  end

  defp three_shades?(<<grey, rest::binary>>) when grey in [0, 205, 254], do: three_shades?(rest)
  defp three_shades?(rest), do: rest == <<>>

  defp has?(row, grey), do: :binary.match(row, <<grey>>) != :nomatch

  @doc "The length of a cell's side in metres."
  @spec cell() :: float()
  def cell, do: @cell

  @doc """
  The rows of cells of a picture that is so large in metres, from the lowest: one byte a cell, 1 is wall. A cell is wall if
  any of its pixels is, so that thin walls have no gaps.

      iex> picture = {3, 2, [<<0, 0, 0>>, <<255, 255, 0>>]}
      iex> marks = Nav.MapFile.Picture.shades(nil)
      iex> Nav.MapFile.Picture.walls(picture, marks, {0.6, 0.4}) |> Enum.map(&binary_part(&1, 0, 12))
      [<<0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1>>, <<0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1>>,
       <<0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1>>, <<0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1>>,
       <<1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1>>, <<1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1>>,
       <<1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1>>, <<1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1>>]
  """
  @spec walls(t(), Runs.marks(), {float(), float()}) :: [binary()]
  def walls({width, height, rows}, shades, {metres_x, metres_y} = size) do
    {cells_x, cells_y} = cells(size)

    walls =
      rows
      |> Enum.map(&Runs.of(&1, shades))
      |> without_specks(metres_x / width, metres_y / height)
      |> List.to_tuple()

    {drawn, _last} =
      Enum.map_reduce((cells_y - 1)..0//-1, {nil, nil}, fn j, {last, row} ->
        case part(j, cells_y, height) do
          ^last -> {row, {last, row}}
          part -> part |> lay(walls, width, cells_x) |> then(&{&1, {part, &1}})
        end
      end)

    drawn
  end

  @doc "How many cells a picture of this size in metres takes."
  @spec cells({float(), float()}) :: {pos_integer(), pos_integer()}
  def cells({metres_x, metres_y}),
    do: {max(round(metres_x / @cell), 1), max(round(metres_y / @cell), 1)}

  defp without_specks(rows, pixel_x, pixel_y) do
    {most_x, most_y} = {most(pixel_x), most(pixel_y)}

    specks =
      for %{columns: {left, right}, rows: {top, bottom}} = area <- Runs.areas(rows, :corners),
          right - left < most_x and bottom - top < most_y,
          run <- area.runs,
          do: run

    specks = Enum.group_by(specks, &elem(&1, 0), &elem(&1, 1))
    for {row, j} <- Enum.with_index(rows), do: row -- Map.get(specks, j, [])
  end

  # How many pixels of this size a speck may be wide.
  defp most(pixel), do: min(@speck_pixels, floor(@speck_m / pixel + 1.0e-6))

  # The pixels in cell `j` of `cells`: the first, and the last.
  defp part(j, cells, pixels),
    do: {div(j * pixels, cells), div((j + 1) * pixels + cells - 1, cells) - 1}

  # Every cell that a run of pixels reaches into.
  defp lay({first, last}, walls, width, cells) do
    runs =
      for k <- first..last, {a, b} <- elem(walls, k) do
        {div(a * cells, width), div((b + 1) * cells + width - 1, width) - 1}
      end

    Runs.row(runs, cells)
  end
end
