defmodule Nav.MapFileTest do
  use ExUnit.Case, async: true
  alias Nav.{Grid, MapFile}
  doctest MapFile
  doctest MapFile.Turn
  doctest MapFile.Writer

  @moduletag :tmp_dir

  # 4 x 3 m, surrounded by 1 m of what is unknown; a wall in the lower left corner of the floor.
  defp picture do
    rows =
      for y <- 0..99 do
        for x <- 0..119, into: <<>> do
          cond do
            x < 20 or x >= 100 or y < 20 or y >= 80 -> <<205>>
            x < 40 and y >= 70 -> <<0>>
            true -> <<254>>
          end
        end
      end

    ["P5 120 100 255\n", rows]
  end

  defp yaml(dir, changes) do
    keys =
      Keyword.merge([image: "floor.pgm", resolution: "0.05", origin: "[-2.0, 5.0, 0.0]"], changes)

    file = Path.join(dir, "map.yaml")
    File.write!(file, for({key, value} <- keys, do: "#{key}: #{value}\n"))
    file
  end

  test "the origin says where the floor lies; what surrounds it takes no cells", %{tmp_dir: dir} do
    File.write!(Path.join(dir, "floor.pgm"), picture())
    file = yaml(dir, [])
    assert {:ok, %MapFile{file: ^file, grid: grid}} = MapFile.open(file)

    assert {grid.width, grid.height} == {40, 30}
    assert_in_delta grid.cell, 0.1, 1.0e-9
    assert_in_delta grid.left, -1.0, 1.0e-9
    assert_in_delta grid.low, 6.0, 1.0e-9

    for {place, wall?} <- [
          {{-0.5, 6.25}, true},
          {{0.5, 6.25}, false},
          {{-0.5, 7.0}, false},
          {{-1.1, 7.0}, true},
          {{1.0, 9.1}, true}
        ],
        do: assert(Grid.clearance(grid, place) == 0.0 == wall?, inspect(place))

    assert [{x, y}] = Grid.Way.find(grid, {-0.5, 7.5}, {2.5, 7.5}, 0.2)
    assert {x, y} == {2.5, 7.5}
  end

  # Of 8 bits of grey; rows are compressed, each behind its filter.
  defp png(width, height, rows, type \\ 0, more \\ []) do
    header = {"IHDR", <<width::32, height::32, 8, type, 0, 0, 0>>}

    chunks =
      for {kind, data} <- [header] ++ more ++ [{"IDAT", rows}, {"IEND", ""}],
          do: [<<byte_size(data)::32>>, kind, data, <<:erlang.crc32([kind, data])::32>>]

    [<<0x89, "PNG\r\n", 0x1A, "\n">> | chunks]
  end

  # 4 x 3 m of floor in a frame of what is transparent, in each kind of picture that can have it.
  defp clear(type) do
    {bytes, more} =
      case type do
        0 ->
          {%{true: <<254>>, false: <<7>>}, [{"tRNS", <<7::16>>}]}

        2 ->
          {%{true: <<254, 254, 254>>, false: <<255, 255, 254>>},
           [{"tRNS", <<255::16, 255::16, 254::16>>}]}

        3 ->
          {%{true: <<0>>, false: <<1>>},
           [{"PLTE", <<254, 254, 254, 255, 255, 255>>}, {"tRNS", <<255, 0>>}]}

        4 ->
          {%{true: <<254, 255>>, false: <<255, 0>>}, []}

        6 ->
          {%{true: <<254, 254, 254, 255>>, false: <<255, 255, 255, 0>>}, []}
      end

    rows =
      for y <- 0..99,
          do: [0 | for(x <- 0..119, do: bytes[x in 20..99 and y in 20..79])]

    png(120, 100, :zlib.compress(rows), type, more)
  end

  test "what is transparent is unknown, and so wall, in each kind of picture, whatever its colour",
       %{
         tmp_dir: dir
       } do
    for type <- [0, 2, 3, 4, 6],
        changes <- [
          [],
          [mode: "scale"],
          [mode: "raw", free_thresh: "1.0"],
          [negate: 1, free_thresh: "0.99"]
        ] do
      # In these two, light is occupied.
      floor? = changes == [] or changes[:mode] == "scale"
      File.write!(Path.join(dir, "clear.png"), clear(type))
      result = dir |> yaml([image: "clear.png"] ++ changes) |> MapFile.open()

      if floor? do
        assert {:ok, %MapFile{grid: grid}} = result
        assert {type, {grid.width, grid.height}} == {type, {40, 30}}
      else
        assert {:error, line} = result
        assert line =~ "shows no floor"
      end
    end

    # Without a description there is no such thing as unknown: white paper is floor.
    assert {:ok, {120, 100, [first | _]}} = MapFile.picture(Path.join(dir, "clear.png"), 12_000)
    assert first == :binary.copy(<<255>>, 120)
  end

  # Where map_server puts the pixel in this column and row from below: its lower left corner is at the origin's
  # place, and the picture is turned round that.
  defp place({x, y, turn}, {i, j}) do
    {dx, dy} = {(i + 0.5) * 0.05, (j + 0.5) * 0.05}

    {x + dx * :math.cos(turn) - dy * :math.sin(turn),
     y + dx * :math.sin(turn) + dy * :math.cos(turn)}
  end

  test "a turned origin turns the picture counterclockwise round its lower left corner", %{
    tmp_dir: dir
  } do
    File.write!(Path.join(dir, "floor.pgm"), picture())
    quarter = :math.pi() / 2

    for {x, y, turn} = origin <- [
          {-2.0, 5.0, quarter},
          {-2.0, 5.0, -quarter},
          {25.9, 48.5, 2 * quarter},
          {25.9, 48.5, 3.14},
          {-2.0, 5.0, 0.5},
          {3.0, -1.0, -2.0}
        ] do
      assert {:ok, %MapFile{grid: grid}} =
               MapFile.open(yaml(dir, origin: "[#{x}, #{y}, #{turn}]"))

      # Whole cells of the plan are 10 cm wide, and a wall fills each that it reaches into.
      for i <- 0..119//3, j <- 0..99//3 do
        inner? = i in 24..95 and j in 24..75 and not (i < 44 and j < 34)
        outer? = i < 18 or i > 101 or j < 18 or j > 81 or (i < 38 and j < 28)
        clear? = Grid.clearance(grid, place(origin, {i, j})) > 0.0
        if inner?, do: assert({origin, i, j, clear?} == {origin, i, j, true})
        if outer?, do: assert({origin, i, j, clear?} == {origin, i, j, false})
      end
    end
  end

  test "a wall of one cell has no gap, however it is turned", %{tmp_dir: dir} do
    rows = for y <- 0..99, do: for(_x <- 0..99, into: <<>>, do: <<if(y == 50, do: 0, else: 254)>>)
    File.write!(Path.join(dir, "line.pgm"), ["P5 100 100 255\n", rows])

    for tenth <- 1..15 do
      file = yaml(dir, image: "line.pgm", origin: "[0, 0, #{tenth / 10}]")
      {:ok, %MapFile{grid: grid}} = MapFile.open(file)
      [from, to, beside] = for j <- [20, 80, 21], do: place({0.0, 0.0, tenth / 10}, {50, j})
      assert [_ | _] = Grid.Way.find(grid, from, beside, 0.01)
      assert Grid.Way.find(grid, from, to, 0.01) in [nil, []]
    end
  end

  test "a BMP picture is read as the same one in PNG, and one that is cut short is refused", %{
    tmp_dir: dir
  } do
    source = "testsrc2=size=64x64,format=rgb24,crop=37:23:8:8"

    for format <- ~w(gray rgb24 bgr24 bgra pal8 monob) do
      [bmp, png] =
        for {name, format} <- [
              {"a.bmp", format},
              {"a.png", if(format in ~w(bgr24 bgra), do: "rgb24", else: format)}
            ] do
          file = Path.join(dir, name)

          arguments =
            ~w(-v error -y -f lavfi -i #{source} -frames:v 1 -update 1 -pix_fmt #{format})

          {"", 0} = System.cmd("ffmpeg", arguments ++ [file], stderr_to_stdout: true)
          assert {:ok, {37, 23, rows}} = MapFile.picture(file, 10_000)
          rows |> IO.iodata_to_binary() |> :binary.bin_to_list()
        end

      assert Enum.all?(Enum.zip(bmp, png), fn {a, b} -> abs(a - b) <= 1 end), format
    end

    bytes = File.read!(Path.join(dir, "a.bmp"))
    file = Path.join(dir, "b.bmp")

    for n <- 0..(byte_size(bytes) - 1)//7 do
      File.write!(file, binary_part(bytes, 0, n))
      assert {:error, _line} = MapFile.picture(file, 10_000)
    end

    # Of another order than most.
    arguments = ~w(-v error -y -f lavfi -i #{source} -frames:v 1 -update 1 -pix_fmt bgr565le)
    {"", 0} = System.cmd("ffmpeg", arguments ++ [file], stderr_to_stdout: true)
    assert {:ok, {37, 23, _rows}} = MapFile.picture(file, 10_000)
  end

  test "a map that robots made is read as it was written", %{tmp_dir: dir} do
    # 5.1 x 2 m with a wall of one cell; what is unknown is wall for who reads it.
    cells =
      for j <- 0..19, i <- 0..50, into: <<>> do
        cond do
          i == 0 or j == 0 or i == 50 or j == 19 -> <<0>>
          i == 20 and j < 10 -> <<2>>
          true -> <<1>>
        end
      end

    map = %{cells: cells, width: 51, height: 20, left: -37, low: 12, cell: 0.1}
    file = Path.join(dir, "found.yaml")
    assert MapFile.save(file, map) == :ok
    assert {:ok, %MapFile{grid: grid}} = MapFile.open(file)

    for j <- 0..19, i <- 0..50 do
      free? = Grid.clearance(grid, {(i - 36.5) * 0.1, (j + 12.5) * 0.1}) > 0.0
      assert free? == (:binary.at(cells, j * 51 + i) == 1), inspect({i, j})
    end

    nowhere = Path.join([dir, "none", "found.yaml"])
    assert {:error, line} = MapFile.save(nowhere, map)
    assert line =~ "none/found.pgm: no such file or directory"
  end

  test "a map that will not do is one line that names the file and what is allowed", %{
    tmp_dir: dir
  } do
    write = &File.write!(Path.join(dir, &1), &2)
    write.("floor.pgm", picture())
    write.("dark.pgm", "P5 60 60 255\n" <> :binary.copy(<<0>>, 3600))
    write.("huge.pgm", "P5 5000 5000 255\n")
    write.("wide.pgm", ["P5 101 101 255\n", :binary.copy(<<254>>, 101 * 101)])
    write.("text.png", "hello")
    write.("tall.pgm", "P5 1 16000000 255\n")
    write.("tall.png", png(1, 16_000_000, :zlib.compress(:binary.copy(<<0>>, 32_000_000))))
    # A file with a hole takes no room.
    {:ok, file} = :file.open(Path.join(dir, "long.pgm"), [:write, :raw])
    :ok = :file.pwrite(file, 100_000_000, "\n")
    :ok = :file.close(file)

    for {changes, pattern} <- [
          {[image: "none.png"], ~r/none.png: no such file or directory$/},
          {[image: "text.png"],
           ~r/text.png: is no picture that is known: PNG, PGM \(P2, P5\) and BMP are read/},
          {[image: "huge.pgm"], ~r/huge.pgm: 5000 x 5000 pixels are too many/},
          {[image: "dark.pgm"], ~r/map.yaml: shows no floor/},
          {[image: "wide.pgm", resolution: "1.0"],
           ~r/has floor on 101 x 101 m: up to 100 x 100 m, .* are allowed$/},
          {[image: "wide.pgm", resolution: "10"],
           ~r/is 1010.0 x 1010.0 m: 0.1 to 500 m are allowed/},
          {[resolution: "0"], ~r/map.yaml: resolution: expected a number from 0.001/},
          {[resolution: ".nan"], ~r/map.yaml: resolution: expected a number from 0.001/},
          {[image: "tall.pgm"],
           ~r/tall.pgm: 1 x 16000000 pixels are too many: up to 20000 a side/},
          {[image: "tall.png"],
           ~r/tall.png: 1 x 16000000 pixels are too many: up to 20000 a side/},
          {[image: "long.pgm"], ~r/long.pgm: has 100000001 bytes: up to 100000000 are read/},
          {[negate: String.duplicate("0", 70_000)],
           ~r/map.yaml: has \d+ bytes: up to 65536 are read/}
        ] do
      assert {:error, line} = dir |> yaml(changes) |> MapFile.open()
      assert line =~ pattern
      refute line =~ "\n"
    end

    assert MapFile.open(dir) == {:error, "#{dir}: is a directory, not a file"}
  end
end
