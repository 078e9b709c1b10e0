defmodule Nav.GridTest do
  use ExUnit.Case, async: true
  alias Nav.{Grid, PathPlanner}
  alias Nav.Grid.{Native, Reference}
  doctest Nav.Grid
  doctest Nav.Grid.Way

  # 1 to 24 cells a side, from a few walls to a thicket.
  defp cells do
    {width, height, share} = {:rand.uniform(24), :rand.uniform(24), :rand.uniform() * 0.4}

    cells =
      for _ <- 1..(width * height),
          into: <<>>,
          do: <<if(:rand.uniform() < share, do: 1, else: 0)>>

    {cells, width, height}
  end

  defp discs do
    for _ <- 1..:rand.uniform(3)//1, into: <<>> do
      <<:rand.uniform() * 30 - 3::float-native, :rand.uniform() * 30 - 3::float-native,
        :rand.uniform() * 3::float-native>>
    end
  end

  test "clearances and ways in C are those of the reference" do
    assert Native.loaded?()

    for _ <- 1..150 do
      {cells, width, height} = cells()
      closed? = :rand.uniform(2) == 1
      clear = Reference.clearance(cells, width, height, 0.1, closed?)
      assert Native.clearance(cells, width, height, 0.1, closed?) == clear

      last = width * height - 1

      arguments = [
        :rand.uniform(6),
        discs(),
        :rand.uniform(last + 1) - 1,
        :rand.uniform(last + 1) - 1
      ]

      assert apply(Native, :way, [clear, width, height | arguments]) ==
               apply(Reference, :way, [clear, width, height | arguments])
    end
  end

  test "the costs of ways in C are those of the reference" do
    for _ <- 1..150 do
      {walls, width, height} = cells()
      times = for <<wall <- walls>>, into: <<>>, do: <<(1 - wall) * :rand.uniform(8)>>
      arguments = [times, width, height, :rand.uniform(width * height) - 1]
      assert apply(Native, :spread, arguments) == apply(Reference, :spread, arguments)
    end

    for {times, width, start} <- [
          {<<1, 1>>, 2, 2},
          {<<1, 1>>, 1, 0},
          {<<1, 9>>, 2, 0},
          {<<>>, 0, 0}
        ],
        do: assert_raise(ArgumentError, fn -> Native.spread(times, width, 1, start) end)
  end

  test "a window laid over a grid in C is that of the reference, also where it juts out" do
    for _ <- 1..150 do
      [{over, wide, high}, {clear, width, height}] =
        for {cells, width, height} <- [cells(), cells()],
            do: {Reference.clearance(cells, width, height, 0.1, false), width, height}

      {left, low} = {:rand.uniform(60) - 30, :rand.uniform(60) - 30}
      arguments = [clear, width, height, over, wide, high, left, low]
      assert apply(Native, :overlay, arguments) == apply(Reference, :overlay, arguments)
    end

    assert_raise ArgumentError, fn -> Native.overlay(<<1>>, 1, 1, <<1>>, 2, 1, 0, 0) end
    assert_raise ArgumentError, fn -> Native.overlay(<<1>>, 2, 1, <<1>>, 1, 1, 0, 0) end
  end

  test "walls laid over a grid leave the clearances of a grid with all of them" do
    for _ <- 1..50 do
      {cells, width, height} = cells()
      more = for _ <- 1..(width * height), into: <<>>, do: <<div(:rand.uniform(20), 20)>>

      both =
        for {a, b} <- Enum.zip(:binary.bin_to_list(cells), :binary.bin_to_list(more)),
            into: <<>>,
            do: <<max(a, b)>>

      [plan, window, all] =
        for walls <- [cells, more, both], do: Grid.new(walls, {width, height}, 0.1, {-1.3, 2.2})

      assert Grid.overlay(plan, window) == all
    end
  end

  test "the kernel refuses sizes that are not those of its cells" do
    for {cells, width, height} <- [
          {<<0>>, 2, 1},
          {<<0>>, 0, 0},
          {<<>>, 0, 0},
          {<<0>>, -1, -1},
          {"00", 1.0, 2}
        ],
        do:
          assert_raise(ArgumentError, fn -> Native.clearance(cells, width, height, 0.1, true) end)

    clear = <<9, 9, 9, 9>>

    for {need, discs, start, goal} <- [
          {0, <<>>, 0, 1},
          {256, <<>>, 0, 1},
          {1, <<0>>, 0, 1},
          {1, <<-1::64, -1::64, -1::64>>, 0, 1},
          {1, <<>>, 4, 1},
          {1, <<>>, 0, -1}
        ],
        do:
          assert_raise(ArgumentError, fn -> Native.way(clear, 2, 2, need, discs, start, goal) end)
  end

  # A building of rooms of 3 m, one door of 1 m in each wall between two.
  defp building do
    for j <- 0..92, i <- 0..92, into: <<>> do
      wall? =
        (rem(i, 31) == 0 and rem(j, 31) not in 10..19) or
          (rem(j, 31) == 0 and rem(i, 31) not in 10..19)

      edge? = i in [0, 92] or j in [0, 92]
      <<if(wall? or edge?, do: 1, else: 0)>>
    end
    |> Grid.new({93, 93}, 0.1, {-4.65, -4.65})
  end

  defp place(grid, radius) do
    point = {:rand.uniform() * 9 - 4.5, :rand.uniform() * 9 - 4.5}
    if Grid.free?(grid, point, radius), do: point, else: place(grid, radius)
  end

  test "from any room to any room a way leads through the doors, and keeps its clearance" do
    grid = building()

    for _ <- 1..200 do
      {from, goal} = {place(grid, 0.3), place(grid, 0.3)}
      assert [_ | _] = way = Grid.Way.find(grid, from, goal, 0.3)
      assert List.last(way) == goal

      for {a, b} <- Enum.zip([from | way], way), k <- 0..20 do
        point = between(a, b, k / 20)
        # The centre of its cell is at most 0.071 m away.
        assert Grid.clearance(grid, point) >= 0.3 - 0.072
      end
    end
  end

  test "a way goes round discs, and a door that one closes is none" do
    grid = building()
    {from, goal} = {{-3.1, -3.1}, {0.0, -3.1}}
    assert [^goal] = Grid.Way.find(grid, from, goal, 0.25)

    aside = [{-2.3, -3.1, 0.5}]
    assert [_, _ | _] = way = Grid.Way.find(grid, from, goal, 0.25, aside)

    for {a, b} <- Enum.zip([from | way], way),
        do: assert(PathPlanner.blocker(a, b, [{-2.3, -3.1, 0.4}]) == nil)

    closed = [{-1.55, -3.1, 0.6}]
    assert [_, _ | _] = round = Grid.Way.find(grid, from, goal, 0.25, closed)
    assert Enum.any?(round, fn {_x, y} -> y > -1.7 end)
  end

  test "a robot beside a wall gets off it, and one in a wall far from all room finds no way" do
    grid = building()
    assert [_ | _] = Grid.Way.find(grid, {-4.45, -3.0}, {-3.0, -3.0}, 0.3)
    thick = Grid.new(:binary.copy(<<1>>, 900), {30, 30}, 0.1, {0.0, 0.0})
    assert Grid.Way.find(thick, {1.5, 1.5}, {2.0, 2.0}, 0.2) == nil
  end

  test "outside is wall or free, as the grid says" do
    cells = :binary.copy(<<0>>, 400)
    open = Grid.new(cells, {20, 20}, 0.1, {0.0, 0.0}, closed?: false)
    closed = Grid.new(cells, {20, 20}, 0.1, {0.0, 0.0})

    assert Grid.free?(open, {9.0, 9.0}, 1.0) and
             Grid.free_line?(open, {1.0, 1.0}, {9.0, 9.0}, 0.5)

    refute Grid.free?(closed, {9.0, 9.0}, 0.1) or
             Grid.free_line?(closed, {1.0, 1.0}, {9.0, 9.0}, 0.1)
  end

  test "coarse grids of random plans are nowhere wider" do
    for _ <- 1..20 do
      {cells, width, height} = cells()
      grid = Grid.new(cells, {width, height}, 0.05, {0.0, 0.0})

      if width > 1 and height > 1 do
        coarse = Grid.coarsen(grid, 2)

        for _ <- 1..30 do
          point = {:rand.uniform() * coarse.width * 0.1, :rand.uniform() * coarse.height * 0.1}
          assert Grid.clearance(coarse, point) <= Grid.clearance(grid, point)
        end
      end
    end
  end

  defp between({ax, ay}, {bx, by}, share), do: {ax + share * (bx - ax), ay + share * (by - ay)}
end
