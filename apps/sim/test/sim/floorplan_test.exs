defmodule Sim.FloorplanTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Sim.Floorplan

  @moduletag :tmp_dir
  @signature <<0x89, "PNG\r\n", 0x1A, "\n">>

  defp chunk(type, data),
    do: <<byte_size(data)::32, type::binary, data::binary, :erlang.crc32([type, data])::32>>

  defp png({width, height, depth, type}, rows, options \\ []) do
    header = <<width::32, height::32, depth, type, 0, 0, options[:interlace] || 0>>
    data = options[:data] || :zlib.compress(rows)
    palette = options[:palette] || <<>>

    IO.iodata_to_binary([
      chunk("IHDR", header),
      if(palette == <<>>, do: [], else: chunk("PLTE", palette)),
      chunk("IDAT", data),
      chunk("IEND", <<>>)
    ])
  end

  # A row as PNG writes it, with the filter undone by the reader.
  defp filtered(filter, row, above, pixel) do
    a = List.duplicate(0, pixel) ++ row
    c = List.duplicate(0, pixel) ++ above

    bytes =
      for {x, a, b, c} <- Enum.zip([row, a, above, c]), into: <<>> do
        guess =
          case filter do
            0 -> 0
            1 -> a
            2 -> b
            3 -> div(a + b, 2)
            4 -> Enum.min_by([a, b, c], &abs(a + b - c - &1))
          end

        <<x - guess>>
      end

    <<filter>> <> bytes
  end

  defp write(dir, name, bytes), do: Path.join(dir, name) |> tap(&File.write!(&1, bytes))

  test "every drawing has room for its fleet: around the centre, starts apart, free and seeded" do
    for name <- ["hall", "hospital", "arena"], count <- [1, 6, 20, 100] do
      {:ok, map} = Floorplan.open(name, count)
      {width, height} = Floorplan.size(map)
      assert width >= 16.0 and height >= 12.0
      assert :ok = Floorplan.check_landmark(map, {0.0, 0.0})

      for k <- 0..15,
          {c, s} = Sim.Trig.cos_sin(k * :math.pi() / 8),
          do: assert(Floorplan.free?(map, {count * c, count * s}, 0.5))

      robots = for k <- 1..count, do: {:"mag#{k}", 0.2}
      {:ok, poses} = Floorplan.starts(map, robots, 7, {0.0, 0.0})
      assert {:ok, poses} == Floorplan.starts(map, robots, 7, {0.0, 0.0})
      refute {:ok, poses} == Floorplan.starts(map, robots, 8, {0.0, 0.0})
      assert length(poses) == count

      for {pose, i} <- Enum.with_index(poses) do
        assert Floorplan.free?(map, Pose.point(pose), 0.7)
        assert Pose.distance(pose, {0.0, 0.0}) >= 1.2
        for other <- Enum.drop(poses, i + 1), do: assert(Pose.distance(pose, other) >= 1.0)
      end
    end
  end

  test "a fleet that does not fit is an error of one line", %{tmp_dir: dir} do
    white = :binary.copy(<<0, 255, 255>>, 2)
    file = write(dir, "small.png", @signature <> png({2, 2, 8, 0}, white))
    {:ok, map} = Floorplan.open("#{file}:4x4", 30)
    assert {:error, line} = Floorplan.starts(map, for(k <- 1..30, do: {:"mag#{k}", 0.2}), 1, nil)

    assert line =~
             ~r/\Ano free place left for mag\d+: 30 robots do not fit into the start room of map .*\z/
  end

  test "nobody starts behind a wall that the fleet cannot pass", %{tmp_dir: dir} do
    # A wall across the whole map, one metre right of the centre.
    rows =
      for _ <- 1..20,
          into: <<>>,
          do: :binary.copy(<<255>>, 22) <> <<0>> <> :binary.copy(<<255>>, 17)

    file = write(dir, "cut.pgm", "P5 40 20 255\n" <> rows)
    {:ok, map} = Floorplan.open("#{file}:16x8", 6)

    for seed <- 1..10, side <- [{-3.0, 0.0}, {4.0, 0.0}] do
      {:ok, poses} = Floorplan.starts(map, for(k <- 1..6, do: {:"mag#{k}", 0.2}), seed, side)
      assert Enum.all?(poses, &(&1.x > 1.0 == elem(side, 0) > 1.0))
    end
  end

  test "clearance is the distance to the nearest wall" do
    {:ok, map} = Floorplan.open("hospital", 6)

    for _ <- 1..300 do
      point = {(:rand.uniform() - 0.5) * 38, (:rand.uniform() - 0.5) * 31}
      limit = :rand.uniform() * 1.5
      exact = Floorplan.near(map, point, 3.0) |> Enum.map(&elem(&1, 0)) |> Enum.min(fn -> 3.0 end)
      clearance = Floorplan.clearance(map, point, limit)
      assert clearance == exact or (clearance >= limit and exact >= limit)
      assert Floorplan.wall?(map, point) == (exact == 0.0)
      assert Floorplan.Clearance.at_least?(map, point, limit) == clearance >= limit
    end
  end

  test "PNGs of every kind and filter are read as they were written", %{tmp_dir: dir} do
    for {depth, type, channels} <- [
          {1, 0, 1},
          {8, 0, 1},
          {8, 2, 3},
          {8, 3, 1},
          {4, 3, 1},
          {8, 4, 2},
          {8, 6, 4}
        ],
        _ <- 1..2 do
      {width, height} = {:rand.uniform(20), :rand.uniform(12)}
      stride = div(width * depth * channels + 7, 8)
      rows = for _ <- 1..height, do: for(_ <- 1..stride, do: :rand.uniform(256) - 1)
      pixel = max(div(depth * channels, 8), 1)

      palette =
        for _ <- 1..256,
            into: <<>>,
            do: <<:rand.uniform(256) - 1, :rand.uniform(256) - 1, :rand.uniform(256) - 1>>

      {data, _} =
        Enum.map_reduce(rows, List.duplicate(0, stride), fn row, above ->
          {filtered(:rand.uniform(5) - 1, row, above, pixel), row}
        end)

      palette = if type == 3, do: palette, else: <<>>

      file =
        write(
          dir,
          "any.png",
          @signature <> png({width, height, depth, type}, data, palette: palette)
        )

      assert {:ok, {^width, ^height, greys}} = Nav.MapFile.picture(file, 1_000)
      walls = for row <- greys, do: for(<<grey <- row>>, into: <<>>, do: <<div(255 - grey, 128)>>)

      assert walls ==
               Enum.map(rows, &expected(:binary.list_to_bin(&1), depth, type, palette, width))
    end
  end

  defp expected(row, depth, type, palette, width) do
    grey = fn k -> if k, do: <<1>>, else: <<0>> end
    luma = fn <<r, g, b>> -> 0.299 * r + 0.587 * g + 0.114 * b end

    walls =
      case {depth, type} do
        {1, 0} ->
          for <<bit::1 <- row>>, into: <<>>, do: <<1 - bit>>

        {8, 0} ->
          for <<y <- row>>, into: <<>>, do: grey.(y < 128)

        {8, 2} ->
          for <<rgb::binary-size(3) <- row>>, into: <<>>, do: grey.(luma.(rgb) < 128 - 1.0e-9)

        {_, 3} ->
          bits = for <<bit::1 <- row>>, do: bit

          for k <- bits |> Enum.chunk_every(depth) |> Enum.map(&Integer.undigits(&1, 2)),
              into: <<>>,
              do: grey.(luma.(binary_part(palette, 3 * k, 3)) < 128 - 1.0e-9)

        {8, 4} ->
          for <<y, a <- row>>, into: <<>>, do: grey.(255 - a / 255 * (255 - y) < 128 - 1.0e-9)

        {8, 6} ->
          for <<rgb::binary-size(3), a <- row>>,
            into: <<>>,
            do: grey.(255 - a / 255 * (255 - luma.(rgb)) < 128 - 1.0e-9)
      end

    binary_part(walls, 0, width)
  end

  test "a bitmap has its centre at the origin, x right, y up", %{tmp_dir: dir} do
    # The upper left quarter is wall.
    file = write(dir, "quarter.png", @signature <> png({2, 2, 8, 0}, <<0, 0, 255, 0, 255, 255>>))
    {:ok, map} = Floorplan.open("#{file}:4x2", 1)
    assert Floorplan.size(map) == {4.0, 2.0}
    assert Floorplan.wall?(map, {-1.0, 0.5})
    for point <- [{1.0, 0.5}, {-1.0, -0.5}, {1.0, -0.5}], do: refute(Floorplan.wall?(map, point))
    pgm = write(dir, "quarter.pgm", "P5 2 2 255\n" <> <<0, 255, 255, 255>>)
    {:ok, same} = Floorplan.open("#{pgm}:4x2", 1)
    assert same.field == map.field
  end

  test "a thin line stays whole when pixels are smaller than cells", %{tmp_dir: dir} do
    rows =
      for j <- 0..199,
          into: <<>>,
          do: if(j == 77, do: :binary.copy(<<0>>, 200), else: :binary.copy(<<255>>, 200))

    file = write(dir, "line.pgm", "P5 200 200 255\n" <> rows)
    {:ok, map} = Floorplan.open("#{file}:2x2", 1)
    assert Floorplan.size(map) == {2.0, 2.0}
    {t, 1} = Sim.Compute.Rays.wall(Sim.Compute.pack(map), 0.01, -0.9, 0.0, 1.0, 5.0)
    assert_in_delta t, 0.9 + 0.2, 0.06
  end

  test "a file that cannot be read is an error of one line", %{tmp_dir: dir} do
    good = @signature <> png({2, 2, 8, 0}, <<0, 0, 255, 0, 255, 255>>)
    good_file = write(dir, "good.png", good)
    says = fn name, bytes -> Floorplan.open("#{write(dir, name, bytes)}:4x4", 1) end

    errors = [
      {Floorplan.open("mars", 6), ~r/map: expected hall.*, got mars$/},
      {Floorplan.open("", 6), ~r/map: expected hall.*, got $/},
      {Floorplan.open("#{dir}/none.png:4x4", 6), ~r/none.png: no such file/},
      {Floorplan.open("#{dir}:4x4", 6), ~r/a directory, not a file/},
      {Floorplan.open("/dev/zero:4x4", 6), ~r/a device, not a file/},
      {Floorplan.open("#{good_file}:4", 6), ~r/its size must be WIDTHxHEIGHT/},
      {Floorplan.open("#{good_file}:0x4", 6), ~r/its size must be/},
      {Floorplan.open("#{good_file}:-3x4", 6), ~r/its size must be/},
      {Floorplan.open("#{good_file}:1e300x1e300", 6), ~r/its size must be/},
      {Floorplan.open("#{good_file}:4x4m", 6), ~r/its size must be/},
      {Floorplan.open("#{good_file}:999999999x999999999", 6),
       ~r/too large, at most 64 million cells/},
      {says.("text.png", "hello"), ~r/is no picture that is known: PNG, PGM/},
      {says.("empty.png", ""), ~r/empty.png: is empty: PNG, PGM/},
      {says.("cut.png", binary_part(good, 0, byte_size(good) - 20)), ~r/damaged/},
      {says.("flipped.png", String.replace(good, "IDAT", "IDAX")), ~r/damaged/},
      {Floorplan.open(good_file, 6), ~r/such as good.png:16x12, got .*; its size is missing$/},
      {Floorplan.open("floor.jpg", 6), ~r/; .jpg is not read: save the picture as PNG$/},
      {Floorplan.open("ofices", 6), ~r/, got ofices; did you mean offices\?$/},
      {says.("a.jpg", <<0xFF, 0xD8, 0xFF, 0xE0>>), ~r/a.jpg: is a JPEG picture: PNG, PGM/},
      {says.("a.gif", "GIF89a"), ~r/is a GIF picture/},
      {says.("a.ppm", "P6 1 1 255 abc"), ~r/is a PPM picture/},
      {says.("odd.png", @signature <> png({2, 2, 8, 0}, <<>>, interlace: 2)), ~r/damaged/},
      {says.("deep.png", @signature <> png({2, 2, 16, 3}, <<>>)), ~r/damaged/},
      {says.("huge.png", @signature <> png({100_000, 100_000, 8, 0}, <<>>)), ~r/too many/},
      {says.("short.png", @signature <> png({2, 2, 8, 0}, <<0, 0>>)), ~r/damaged/},
      {says.("noise.png", @signature <> png({2, 2, 8, 0}, <<>>, data: "no zlib")), ~r/damaged/},
      {says.("stub.pgm", "P5 2 2"), ~r/damaged/},
      {says.("deep.pgm", "P5 2 2 65535\n1234567"), ~r/damaged/},
      {says.("deeper.pgm", "P5 2 2 65536\n12345678"), ~r/damaged/},
      {says.("huge.pgm", "P2 99999999 99999999 255\n"), ~r/too many/}
    ]

    for {answer, pattern} <- errors do
      assert {:error, line} = answer
      assert line =~ pattern
      refute line =~ "\n"
    end
  end

  test "damaged PNGs never crash the reader", %{tmp_dir: dir} do
    bytes = png({9, 7, 8, 2}, for(_ <- 1..7, do: [0, for(k <- 1..27, do: <<k>>)]))

    for _ <- 1..20 do
      at = :rand.uniform(byte_size(bytes)) - 1
      {before, <<_, rest::binary>>} = :erlang.split_binary(bytes, at)

      file = write(dir, "hit.png", [@signature, before, :rand.uniform(256) - 1, rest])
      assert {what, _} = Nav.MapFile.picture(file, 1_000)
      assert what in [:ok, :error]
    end
  end

  test "a landmark stands neither in a wall nor outside" do
    {:ok, map} = Floorplan.open("hospital", 6)
    assert {:error, line} = Floorplan.check_landmark(map, {500.0, 0.0})
    assert line =~ "is 39.4 x 32.4 m around its centre"
    assert {:error, line} = Floorplan.check_landmark(map, {9.1, 3.0})
    assert line =~ "there is a wall"
  end
end
