defmodule Nav.MapFile.PictureTest do
  use ExUnit.Case, async: true
  alias Nav.MapFile.Picture
  doctest Nav.MapFile.Picture
  doctest Nav.MapFile.Pgm

  defp picture(rows), do: {byte_size(hd(rows)), length(rows), rows}

  defp walls(picture, size) do
    rows = Picture.walls(picture, Picture.shades(picture), size)
    for row <- Enum.reverse(rows), do: for(<<wall <- row>>, do: wall == 1)
  end

  test "a cell is wall if any of its pixels is, whatever the sizes" do
    for _ <- 1..60 do
      {width, height} = {:rand.uniform(50), :rand.uniform(50)}
      {w, h} = {20 + :rand.uniform(40), 20 + :rand.uniform(40)}
      # Lines only, as specks are no walls.
      {row, column} = {:rand.uniform(height) - 1, :rand.uniform(width) - 1}

      rows =
        for j <- 0..(height - 1),
            do:
              for(
                i <- 0..(width - 1),
                into: <<>>,
                do: if(j == row or i == column, do: <<0>>, else: <<255>>)
              )

      expected =
        for y <- 0..(h - 1) do
          for x <- 0..(w - 1) do
            # The pixel and the cell have more than a side in common.
            (x * width < (column + 1) * w and column * w < (x + 1) * width) or
              (y * height < (row + 1) * h and row * h < (y + 1) * height)
          end
        end

      assert walls(picture(rows), {w * 0.05, h * 0.05}) == expected
    end
  end

  test "specks are no walls; lines, and spots of more than 0.15 m, are" do
    spotted = fn spots, width, height ->
      picture(
        for j <- 0..(height - 1),
            do:
              for(
                i <- 0..(width - 1),
                into: <<>>,
                do: if({i, j} in spots, do: <<0>>, else: <<255>>)
              )
      )
    end

    any? = fn picture, size -> picture |> walls(size) |> List.flatten() |> Enum.any?() end
    square = fn side -> for i <- 1..side, j <- 1..side, do: {i + 4, j + 4} end

    # Pixels of 5 cm.
    refute any?.(spotted.([{5, 5}], 40, 40), {2.0, 2.0})
    refute any?.(spotted.(square.(3), 40, 40), {2.0, 2.0})
    assert any?.(spotted.(square.(4), 40, 40), {2.0, 2.0})
    assert any?.(spotted.([{3, 3}, {4, 4}, {5, 5}, {6, 6}], 40, 40), {2.0, 2.0})
    # Of 1 cm and of 20 cm.
    refute any?.(spotted.(square.(3), 200, 200), {2.0, 2.0})
    assert any?.(spotted.(square.(4), 200, 200), {2.0, 2.0})
    assert any?.(spotted.([{5, 5}], 10, 10), {2.0, 2.0})
  end

  test "dark is wall; three shades are read as map_server means them" do
    wall? = fn rows, grey -> rows |> picture() |> Picture.shades() |> elem(grey) end

    for {rows, walls, floor} <- [
          {[<<0, 205, 254>>], [0, 127, 205], [128, 254, 255]},
          {[<<0, 205, 254, 255>>], [0, 127], [128, 205, 255]},
          {[<<0, 205>>], [0], [205]},
          {[<<90, 127, 128, 200>>], [90, 127], [128, 200]}
        ] do
      for grey <- walls, do: assert(wall?.(rows, grey), "#{grey} of #{inspect(rows)}")
      for grey <- floor, do: refute(wall?.(rows, grey), "#{grey} of #{inspect(rows)}")
    end
  end
end
