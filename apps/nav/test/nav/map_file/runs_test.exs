defmodule Nav.MapFile.RunsTest do
  use ExUnit.Case, async: true
  alias Nav.MapFile.Runs
  doctest Nav.MapFile.Runs

  @marks Nav.MapFile.Runs.marks(&(&1 == 1))

  defp random(width, height, share) do
    for _ <- 1..height,
        do:
          for(_ <- 1..width, into: <<>>, do: if(:rand.uniform() < share, do: <<1>>, else: <<0>>))
  end

  # The areas as sets of cells, by filling from every cell that is not in one yet.
  defp filled(rows, steps) do
    cells =
      for {row, j} <- Enum.with_index(rows),
          {1, i} <- Enum.with_index(:binary.bin_to_list(row)),
          do: {i, j}

    filled(MapSet.new(cells), steps, [])
  end

  defp filled(left, steps, areas) do
    case Enum.take(left, 1) do
      [] ->
        Enum.sort(areas)

      [cell] ->
        area = spread([cell], MapSet.new([cell]), left, steps)
        filled(MapSet.difference(left, area), steps, [Enum.sort(area) | areas])
    end
  end

  defp spread([], area, _left, _steps), do: area

  defp spread([{i, j} | rest], area, left, steps) do
    new =
      for {di, dj} <- steps,
          cell = {i + di, j + dj},
          MapSet.member?(left, cell) and not MapSet.member?(area, cell),
          do: cell

    spread(new ++ rest, MapSet.union(area, MapSet.new(new)), left, steps)
  end

  test "runs are what is marked, and drawn again they are the row" do
    for _ <- 1..200 do
      [row] = random(:rand.uniform(40), 1, :rand.uniform())
      runs = Runs.of(row, @marks)
      assert Runs.row(Enum.shuffle(runs), byte_size(row)) == row

      for {{_, last}, {first, _}} <- Enum.zip(runs, Enum.drop(runs, 1)),
          do: assert(first > last + 1)
    end
  end

  test "runs that overlap are drawn as their union" do
    for _ <- 1..200 do
      runs =
        for _ <- 1..:rand.uniform(8), a = :rand.uniform(20) - 1, do: {a, a + :rand.uniform(9)}

      row =
        for i <- 0..29,
            into: <<>>,
            do: <<if(Enum.any?(runs, fn {a, b} -> i in a..b end), do: 1, else: 0)>>

      assert Runs.row(runs, 30) == row
    end
  end

  test "areas are those that filling finds" do
    sides = [{1, 0}, {-1, 0}, {0, 1}, {0, -1}]
    corners = [{1, 1}, {1, -1}, {-1, 1}, {-1, -1}]

    for _ <- 1..100, {touch, steps} <- [sides: sides, corners: sides ++ corners] do
      rows = random(:rand.uniform(24), :rand.uniform(16), 0.3 + 0.4 * :rand.uniform())
      areas = rows |> Enum.map(&Runs.of(&1, @marks)) |> Runs.areas(touch)

      found =
        for area <- areas, do: Enum.sort(for({j, {a, b}} <- area.runs, i <- a..b, do: {i, j}))

      assert Enum.sort(found) == filled(rows, steps)

      for {area, cells} <- Enum.zip(areas, found) do
        assert area.cells == length(cells)
        assert area.columns == cells |> Enum.map(&elem(&1, 0)) |> Enum.min_max()
        assert area.rows == cells |> Enum.map(&elem(&1, 1)) |> Enum.min_max()
      end
    end
  end
end
