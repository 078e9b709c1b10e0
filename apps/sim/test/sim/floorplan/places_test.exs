defmodule Sim.Floorplan.PlacesTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Sim.Floorplan

  @moduletag :tmp_dir

  # A picture of pixels of 5 cm, from a function of a place in metres that says `true` or a shade
  # where it is not white.
  defp map(dir, {width, height}, dark, options \\ []) do
    {w, h} = {round(width / 0.05), round(height / 0.05)}

    pixels =
      for j <- 0..(h - 1), i <- 0..(w - 1), into: <<>> do
        case dark.((i + 0.5) * 0.05 - width / 2, height / 2 - (j + 0.5) * 0.05) do
          true -> <<0>>
          false -> <<options[:floor] || 255>>
          grey -> <<grey>>
        end
      end

    file = Path.join(dir, "map.pgm")
    File.write!(file, ["P5 #{w} #{h} 255\n", pixels])
    {:ok, map} = Floorplan.open("#{file}:#{width}x#{height}", 1, options[:grey] || :wall)
    map
  end

  defp fleet(count),
    do:
      for(k <- 1..count, do: if(rem(k, 2) == 0, do: {:"mag#{k}", 0.2}, else: {:"min#{k}", 0.292}))

  defp choose(map, count, seed \\ 1, asked \\ :default),
    do: Floorplan.places(map, fleet(count), seed, asked)

  # Whether a disc comes from everywhere to everywhere among these places, on a grid of 10 cm.
  defp connected?(map, [from | places], radius) do
    node = fn {x, y} -> {round(x * 10), round(y * 10)} end
    free? = &Floorplan.free?(map, &1, radius)
    reached = spread([node.(from)], MapSet.new([node.(from)]), free?)

    Enum.all?(places, fn place ->
      {i, j} = node.(place)
      Enum.any?(for(a <- -1..1, b <- -1..1, do: {i + a, j + b}), &MapSet.member?(reached, &1))
    end)
  end

  defp spread([], reached, _free?), do: reached

  defp spread([{i, j} | rest], reached, free?) do
    new =
      for {a, b} <- [{1, 0}, {-1, 0}, {0, 1}, {0, -1}],
          node = {i + a, j + b},
          not MapSet.member?(reached, node),
          free?.({(i + a) / 10, (j + b) / 10}),
          do: node

    spread(new ++ rest, MapSet.union(reached, MapSet.new(new)), free?)
  end

  defp check(map, landmark, poses, options \\ []) do
    places = Enum.map(poses, &Pose.point/1)
    assert :ok = Floorplan.check_landmark(map, landmark)

    for {place, k} <- Enum.with_index(places) do
      assert Floorplan.free?(map, place, options[:from_wall] || 0.7)
      assert Pose.distance(landmark, place) >= 1.2
      for other <- Enum.drop(places, k + 1), do: assert(Pose.distance(place, other) >= 1.0)
    end

    assert connected?(map, [landmark | places], 0.3)
  end

  defp box?(x, y, {left, low, right, high}), do: x > left and x < right and y > low and y < high

  test "a wall in the middle moves the landmark aside, into the nearest room with space", %{
    tmp_dir: dir
  } do
    map = map(dir, {12, 8}, fn x, _y -> abs(x) < 0.5 end)

    for count <- [1, 5, 8], seed <- 1..3 do
      {:ok, {x, y}, poses} = choose(map, count, seed)
      assert abs(x) > 1.0 and abs(x) < 2.5 and abs(y) < 0.5
      check(map, {x, y}, poses)
      assert Enum.all?(poses, &(&1.x > 0 == x > 0))
    end

    assert choose(map, 5) == choose(map, 5)
    refute choose(map, 5) == choose(map, 5, 2)
  end

  test "where the middle is free, it stays there", %{tmp_dir: dir} do
    map = map(dir, {12, 8}, fn x, _y -> x > 5.0 end)
    {:ok, starts} = Floorplan.starts(map, fleet(5), 3, {0.0, 0.0})
    assert choose(map, 5, 3) == {:ok, {0.0, 0.0}, starts}
  end

  test "nobody starts outside of a building with thin walls, in its margin", %{tmp_dir: dir} do
    # An L; the middle of the picture is outside of it, between its wings. A door leads out.
    inside? = fn x, y, grow ->
      box?(x, y, {-7.0 - grow, -6.0 - grow, -3.0 + grow, 6.0 + grow}) or
        box?(x, y, {-7.0 - grow, -6.0 - grow, 7.0 + grow, -2.5 + grow})
    end

    for door? <- [false, true] do
      map =
        map(dir, {20, 16}, fn x, y ->
          inside?.(x, y, 0.05) and not inside?.(x, y, 0.0) and
            not (door? and x > 6.9 and abs(y + 4) < 0.5)
        end)

      for count <- [1, 5, 8, 20] do
        {:ok, {x, y} = landmark, poses} = choose(map, count)
        assert inside?.(x, y, 0.0)
        for pose <- poses, do: assert(inside?.(pose.x, pose.y, 0.0))
        check(map, landmark, poses)
      end
    end
  end

  test "where there is nothing inside, they start outside", %{tmp_dir: dir} do
    map = map(dir, {14, 12}, fn x, y -> box?(x, y, {-3.0, -3.0, 3.0, 3.0}) end)
    {:ok, landmark, poses} = choose(map, 6)
    check(map, landmark, poses)
  end

  test "a fleet too large for a room starts in several, with doors between", %{tmp_dir: dir} do
    # Rooms of 3 x 3 m with doors of 0.9 m in a row; the middle is a wall between two of them.
    map =
      map(dir, {18, 3.4}, fn x, y ->
        (abs(x - 3 * round(x / 3)) < 0.1 and abs(y) > 0.45) or abs(y) > 1.5
      end)

    {:ok, one, poses} = choose(map, 1)
    check(map, one, poses)

    {:ok, landmark, poses} = choose(map, 8)
    check(map, landmark, poses)
    assert poses |> Enum.map(&floor(&1.x / 3)) |> Enum.uniq() |> length() > 2
  end

  test "corridors narrower than is comfortable will do where there is nothing else", %{
    tmp_dir: dir
  } do
    # 1.1 m wide, in the shape of an H.
    map =
      map(dir, {12, 8}, fn x, y ->
        not (abs(abs(x) - 4.0) < 0.55 or (abs(y) < 0.55 and abs(x) < 4.5))
      end)

    {:ok, landmark, poses} = choose(map, 8)
    check(map, landmark, poses, from_wall: 0.39)
  end

  test "speckles, shades and pictures of one bit make no difference", %{tmp_dir: dir} do
    wall? = fn x, y -> abs(x) > 5.8 or abs(y) > 3.8 or (abs(x - 1) < 0.1 and y < 2) end
    clean = map(dir, {12, 8}, wall?)
    # One pixel in fifty that has no neighbour.
    salt? = fn x, y -> rem(round(x * 20 - 0.5), 7) == 0 and rem(round(y * 20 - 0.5), 7) == 0 end

    salted =
      map(dir, {12, 8}, fn x, y ->
        wall?.(x, y) or (salt?.(x, y) and not wall?.(x + 0.1, y) and not wall?.(x - 0.1, y))
      end)

    shaded = map(dir, {12, 8}, fn x, y -> wall?.(x, y) && 100 end, floor: 215)

    for count <- [1, 5, 8, 20] do
      {:ok, landmark, poses} = choose(salted, count)
      assert shaded |> choose(count) |> Tuple.to_list() |> tl() == [landmark, poses]
      assert clean |> choose(count) |> Tuple.to_list() |> tl() == [landmark, poses]
      check(salted, landmark, poses)
    end
  end

  test "what map_server does not know is wall", %{tmp_dir: dir} do
    map =
      map(dir, {16, 12}, fn x, y ->
        cond do
          box?(x, y, {-6.0, 0.5, 6.0, 5.0}) -> 254
          box?(x, y, {-6.1, 0.4, 6.1, 5.1}) -> 0
          true -> 205
        end
      end)

    {:ok, {_x, y} = landmark, poses} = choose(map, 8)
    assert y > 0.5
    check(map, landmark, poses)
  end

  test "a landmark in a corridor leaves ways past it from robot to robot", %{tmp_dir: dir} do
    # A corridor of 1.6 m between rooms of 3.6 x 3.4 m, each with a door of 1 m to it.
    wall? = fn x, y ->
      beside = x - 4 * Float.round(x / 4)

      abs(y) > 4.4 or abs(x) > 7.9 or
        (abs(y) > 0.8 and abs(y) < 0.95 and abs(abs(beside) - 2.0) > 0.5) or
        (abs(y) > 0.8 and abs(beside) < 0.08)
    end

    map = map(dir, {16, 9}, wall?)

    for seed <- 1..6 do
      {:ok, {lx, ly} = landmark, [first | others]} = choose(map, 5, seed)
      check(map, landmark, [first | others], from_wall: 0.39)
      free? = &(Floorplan.free?(map, &1, 0.3) and Pose.distance(&1, {lx, ly}) > 0.45)
      node = fn pose -> {round(pose.x * 10), round(pose.y * 10)} end
      reached = spread([node.(first)], MapSet.new([node.(first)]), free?)

      for pose <- others do
        {i, j} = node.(pose)
        near = for a <- -1..1, b <- -1..1, do: {i + a, j + b}
        assert Enum.any?(near, &MapSet.member?(reached, &1)), "seed #{seed}"
      end
    end
  end

  test "the grey of a drawing is wall, unless it is said to be floor", %{tmp_dir: dir} do
    # A building in a grey margin, about a grey court in its middle.
    shade = fn x, y ->
      cond do
        box?(x, y, {-3.0, -2.0, 3.0, 2.0}) -> 178
        box?(x, y, {-3.1, -2.1, 3.1, 2.1}) -> 0
        box?(x, y, {-7.0, -5.0, 7.0, 5.0}) -> 255
        box?(x, y, {-7.1, -5.1, 7.1, 5.1}) -> 0
        true -> 178
      end
    end

    for seed <- 1..3 do
      map = map(dir, {18, 14}, shade)
      assert map.grey == 178
      # In the court and outside; not the walls, nor the floor.
      for {place, unknown?} <- [
            {{0.0, 0.0}, true},
            {{8.5, 0.0}, true},
            {{-3.05, 0.0}, false},
            {{5.0, 0.0}, false}
          ],
          do: assert({place, Floorplan.unknown?(map, place)} == {place, unknown?})

      {:ok, {x, y} = landmark, poses} = choose(map, 5, seed)
      refute box?(x, y, {-3.1, -2.1, 3.1, 2.1})
      assert box?(x, y, {-7.0, -5.0, 7.0, 5.0})
      check(map, landmark, poses)
      assert {:error, line} = Floorplan.check_landmark(map, {0.0, 0.0})
      assert line =~ ~r/there is a wall$/
    end

    map = map(dir, {18, 14}, shade, grey: :floor)
    assert {map.grey, map.unknown} == {nil, nil}
    assert {:ok, place, _poses} = choose(map, 5)
    assert place == {0.0, 0.0}
  end

  test "a landmark outside of a building that takes the fleet is refused", %{tmp_dir: dir} do
    wall? = fn x, y, door? ->
      box?(x, y, {-5.1, -4.1, 5.1, 4.1}) and not box?(x, y, {-5.0, -4.0, 5.0, 4.0}) and
        not (door? and y > 0 and abs(x) < 0.5)
    end

    for {door?, {x, y} = place} <- [
          {false, {7.0, 0.0}},
          {true, {0.0, 5.2}},
          {true, {5.4, 2.0}}
        ] do
      map = map(dir, {18, 14}, &wall?.(&1, &2, door?))
      {:error, line} = choose(map, 5, 1, place)

      assert line ==
               "the landmark cannot stand at #{x},#{y}: that is outside of the building in map #{map.name}"

      assert {:ok, place, _poses} = choose(map, 5, 1, {3.0, 0.0})
      assert place == {3.0, 0.0}
    end

    # No building for so many.
    map =
      map(
        dir,
        {10, 8},
        &(box?(&1, &2, {-2.1, -2.1, 2.1, 2.1}) and not box?(&1, &2, {-2.0, -2.0, 2.0, 2.0}))
      )

    assert {:ok, place, _poses} = choose(map, 20, 1, {4.0, 0.0})
    assert place == {4.0, 0.0}
  end

  test "a closet without room for the fleet is refused, with how many would fit", %{
    tmp_dir: dir
  } do
    # Of 2.6 x 2.6 m, in a hall.
    map =
      map(dir, {16, 12}, fn x, y ->
        box?(x, y, {2.9, -0.1, 5.7, 2.7}) and not box?(x, y, {3.0, 0.0, 5.6, 2.6})
      end)

    {:error, line} = choose(map, 5, 1, {4.3, 1.3})

    assert line =~
             ~r/^5 robots cannot start in map .*: there is room for \d, with ways to the landmark at 4.3,1.3$/

    assert {:ok, _landmark, _poses} = choose(map, 5)
  end

  test "a landmark that is given is reached round corners, through doors, close to a wall", %{
    tmp_dir: dir
  } do
    # A room, a door of 0.9 m, and a corridor of 1.3 m round two corners, at whose end it stands.
    corridor? = fn x, y ->
      box?(x, y, {-2.0, 0.0, 4.0, 1.3}) or box?(x, y, {2.7, -3.0, 4.0, 1.0}) or
        box?(x, y, {1.0, -3.0, 4.0, -1.7})
    end

    map =
      map(dir, {14, 8}, fn x, y ->
        not (box?(x, y, {-6.5, -3.5, -2.2, 3.5}) or corridor?.(x, y) or
               (abs(x + 2.1) < 0.15 and abs(y - 0.65) < 0.45))
      end)

    for place <- [{1.25, -2.3}, {1.6, -2.85}] do
      assert {:error, _line} = Floorplan.starts(map, fleet(5), 1, place)
      {:ok, ^place, poses} = choose(map, 5, 1, place)
      places = Enum.map(poses, &Pose.point/1)
      assert connected?(map, [{1.6, -2.3} | places], 0.3)
    end

    # In a wall it is refused as ever.
    assert {:error, line} = choose(map, 5, 1, {6.5, 0.0})
    assert line =~ "none has a free way to the landmark at 6.5,0.0"
  end

  test "without a landmark, robots start together all the same", %{tmp_dir: dir} do
    map = map(dir, {12, 8}, fn x, _y -> abs(x) < 0.5 end)
    {:ok, nil, poses} = choose(map, 5, 1, nil)
    assert poses |> Enum.map(&(&1.x > 0)) |> Enum.uniq() |> length() == 1
  end

  test "a fleet without room is told in one line how many have", %{tmp_dir: dir} do
    map = map(dir, {6, 5}, fn x, y -> abs(x) > 2.5 or abs(y) > 2.0 end)
    {:error, line} = choose(map, 40)

    assert [_, most] =
             Regex.run(~r/^40 robots cannot start in map .*: there is room for (\d+)$/, line)

    most = String.to_integer(most)
    assert most in 8..30
    {:ok, landmark, poses} = choose(map, most)
    check(map, landmark, poses, from_wall: 0.39)
    assert {:error, _line} = choose(map, most + 1)
  end

  test "a map too small for a robot is told which size would do", %{tmp_dir: dir} do
    map = map(dir, {8, 4}, fn _x, y -> abs(y) > 0.3 end)
    {:error, line} = choose(map, 1)

    assert line =~
             ~r/its widest place is 0.\d+ m across, and a robot needs 0.78 m; it would take a map of 1\d x \d m$/

    [_, width, height] = Regex.run(~r/of (\d+) x (\d+) m$/, line)
    [file, _size] = String.split(map.name, ":")
    {:ok, larger} = Floorplan.open("#{file}:#{width}x#{height}", 1)
    assert {:ok, _landmark, [_pose]} = choose(larger, 1)

    {:error, line} = dir |> map({8, 4}, fn _x, _y -> true end) |> choose(2)
    assert line =~ ~r/^2 robots cannot start in map .*: it is all wall$/
  end

  test "a drawing of 3000 x 1200 pixels is opened, and a fleet starts in it", %{tmp_dir: dir} do
    # Rooms of 5 m with doors, a corridor in the middle; rows that are alike are written once.
    row = fn j ->
      y = rem(j, 100)

      for i <- 0..2999, into: <<>> do
        corridor? = j in 580..620

        wall? =
          (y < 3 or rem(i, 100) < 3) and not corridor? and rem(i, 100) not in 40..62 and
            y not in 40..62

        if wall? or i < 3 or i > 2996 or j < 3 or j > 1196, do: <<0>>, else: <<255>>
      end
    end

    rows = Map.new(0..1199, &{{rem(&1, 100), &1 in 580..620, &1 < 3 or &1 > 1196}, &1})
    drawn = Map.new(rows, fn {kind, j} -> {kind, row.(j)} end)
    pixels = for j <- 0..1199, do: drawn[{rem(j, 100), j in 580..620, j < 3 or j > 1196}]
    file = Path.join(dir, "large.pgm")
    File.write!(file, ["P5 3000 1200 255\n", pixels])
    {:ok, map} = Floorplan.open("#{file}:150x60", 20)
    assert Floorplan.size(map) == {150.0, 60.0}
    assert {:ok, _landmark, poses} = choose(map, 20)
    assert length(poses) == 20
  end
end
