defmodule Nav.MapFile.Turn do
  @moduledoc """
  Turns the cells of a picture as the pose of its lower left corner says, counterclockwise, into rows of the map's
  frame. Pure.
  """

  # Where a cell is looked at, in parts of its width from its middle: close enough that no wall of one cell has a gap.
  @looks for y <- [-0.3, 0.3], x <- [-0.3, 0.3], do: {x, y}
  # Radians that make no difference of a cell within 500 m.
  @straight 1.0e-5

  @doc """
  Rows of cells `cell` metres wide, 1 is wall, from the lowest, whose lower left corner is at `{x, y}` and whose rows
  run in the direction `turn` (radians): as rows along the axes of the map, with the place of their lower left corner. What
  the turned picture does not cover is wall.

      iex> Nav.MapFile.Turn.turn([<<0, 0, 1>>, <<0, 1, 1>>], 1.0, {5.0, 0.0, :math.pi() / 2})
      {[<<0, 0>>, <<1, 0>>, <<1, 1>>], {3.0, 0.0}}
      iex> Nav.MapFile.Turn.turn([<<0, 0, 1>>, <<0, 1, 1>>], 1.0, {5.0, 0.0, 0.0})
      {[<<0, 0, 1>>, <<0, 1, 1>>], {5.0, 0.0}}
  """
  @spec turn([binary()], float(), {float(), float(), float()}) ::
          {[binary()], {left :: float(), low :: float()}}
  def turn(rows, cell, {x, y, turn}) do
    quarters = round(turn / (:math.pi() / 2))

    cond do
      abs(turn - quarters * :math.pi() / 2) > @straight ->
        slanted(rows, cell, {x, y}, {:math.cos(turn), :math.sin(turn)})

      Integer.mod(quarters, 4) == 0 ->
        {rows, {x, y}}

      true ->
        quarters(rows, cell, {x, y}, Integer.mod(quarters, 4))
    end
  end

  # Cell by cell, as nothing lies between them.
  defp quarters(rows, cell, {x, y}, times) do
    {width, height} = {cell * byte_size(hd(rows)), cell * length(rows)}

    corner =
      case times do
        1 -> {x - height, y}
        2 -> {x - width, y - height}
        3 -> {x, y - width}
      end

    {Enum.reduce(1..times, rows, fn _time, rows -> quarter(rows) end), corner}
  end

  # The first column, from the top, becomes the lowest row.
  defp quarter(rows) do
    upwards = Enum.reverse(rows)
    columns = byte_size(hd(rows))
    for i <- 0..(columns - 1), do: for(row <- upwards, into: <<>>, do: <<:binary.at(row, i)>>)
  end

  defp slanted(rows, cell, {x, y}, {cos, sin}) do
    {width, height} = {byte_size(hd(rows)), length(rows)}
    # Of the four corners, in cells from the first.
    {xs, ys} =
      Enum.unzip(
        for i <- [0, width], j <- [0, height], do: {i * cos - j * sin, i * sin + j * cos}
      )

    {left, low} = {Enum.min(xs), Enum.min(ys)}
    {columns, lines} = {ceil(Enum.max(xs) - left), ceil(Enum.max(ys) - low)}
    picture = {IO.iodata_to_binary(rows), width, height}
    looks = for {dx, dy} <- @looks, do: {dx * cos + dy * sin, dy * cos - dx * sin}

    turned =
      for j <- 0..(lines - 1) do
        for i <- 0..(columns - 1), into: <<>> do
          {dx, dy} = {left + i + 0.5, low + j + 0.5}
          <<cell(picture, {dx * cos + dy * sin, dy * cos - dx * sin}, looks)>>
        end
      end

    {turned, {x + left * cell, y + low * cell}}
  end

  defp cell(_picture, _middle, []), do: 0

  defp cell({cells, width, height} = picture, {x, y}, [{dx, dy} | looks]) do
    {i, j} = {floor(x + dx), floor(y + dy)}

    if i >= 0 and j >= 0 and i < width and j < height and
         :binary.at(cells, j * width + i) == 0,
       do: cell(picture, {x, y}, looks),
       else: 1
  end
end
