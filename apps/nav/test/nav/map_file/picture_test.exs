defmodule Nav.MapFile.PictureTest do
  use ExUnit.Case, async: true
  alias Nav.MapFile.Picture
  doctest Nav.MapFile.Picture
  doctest Nav.MapFile.Pgm

  defp picture(rows), do: {byte_size(hd(rows)), length(rows), rows}

  defp walls(picture, size) do
    rows = Picture.walls(picture, Picture.shades(nil), size)
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
    for {rows, walls, floor} <- [
          {[<<0, 205, 254>>], [0, 127, 205], [206, 254, 255]},
          {[<<0, 205, 254>> <> :binary.copy(<<254>>, 97)], [0, 127, 205], [206, 254, 255]},
          {[<<0, 205>>], [0, 127], [128, 205]},
          {[<<90, 127, 200, 200>>], [90, 127], [128, 200]}
        ] do
      for grey <- walls, do: assert(wall?(rows, grey), "#{grey} of #{inspect(rows)}")
      for grey <- floor, do: refute(wall?(rows, grey), "#{grey} of #{inspect(rows)}")
    end
  end

  defp wall?(rows, grey),
    do: rows |> picture() |> Picture.unknown() |> Picture.shades() |> elem(grey)

  test "one light grey beside floor and wall is what is unknown, if there is enough of it" do
    # So many pixels of each shade, of a hundred.
    rows = fn shades ->
      [for({shade, n} <- shades, into: <<>>, do: :binary.copy(<<shade>>, n))]
    end

    for grey <- [150, 178, 204, 205, 230] do
      plan = rows.([{0, 10}, {grey, 30}, {255, 60}])
      for dark <- [0, 127, 128, grey], do: assert(wall?(plan, dark))
      for light <- [grey + 1, 255], do: refute(wall?(plan, light))
    end

    for {shades, why} <- [
          {[{0, 10}, {178, 4}, {255, 86}], "an edge between black and white"},
          {[{0, 10}, {178, 90}], "floor that is drawn grey"},
          {[{0, 10}, {178, 86}, {255, 4}], "the same with words in white"},
          {[{0, 10}, {178, 30}, {220, 30}, {255, 30}], "rooms in several shades"},
          {[{0, 10}, {248, 30}, {255, 60}], "paper that is not quite white"},
          {[{0, 10}, {100, 30}, {255, 60}], "walls in grey"}
        ],
        do: refute(wall?(rows.(shades), 178), why)
  end

  test "of a large picture a part of its rows tells" do
    row = :binary.copy(<<204>>, 800) <> :binary.copy(<<255>>, 1_200)
    assert Picture.unknown({2_000, 2_000, List.duplicate(row, 2_000)}) == 204
  end
end
