defmodule Sim.ComputeTest do
  use ExUnit.Case, async: true
  alias Sim.Compute
  alias Sim.Compute.{Rays, Reference}
  alias Sim.Compute.CameraFrustum

  # A plan of 10 to 60 cells a side with a few walls in it, and things to look at.
  defp plan do
    {width, height} = {9 + :rand.uniform(50), 9 + :rand.uniform(50)}
    share = :rand.uniform() * 0.2

    walls =
      for _ <- 1..(width * height),
          into: <<>>,
          do: if(:rand.uniform() < share, do: <<1>>, else: <<0>>)

    {walls, width, height}
  end

  defp map({walls, width, height}),
    do: {Reference.field(walls, width, height), width, height, 0.05 + :rand.uniform() * 0.2}

  # Somewhere in the plan or just outside it.
  defp place({_field, width, height, cell}),
    do:
      {(:rand.uniform() - 0.5) * 1.1 * width * cell,
       (:rand.uniform() - 0.5) * 1.1 * height * cell}

  # Directions along the axes and the diagonals are the hard ones.
  defp heading,
    do:
      if(:rand.uniform(3) == 1,
        do: (:rand.uniform(8) - 4) * :math.pi() / 4,
        else: :rand.uniform() * 7
      )

  defp direction, do: Sim.Trig.cos_sin(heading())

  defp noise,
    do:
      if(:rand.uniform(4) > 1,
        do: {:rand.uniform(0xFFFFFFFF), :rand.uniform(1000), :rand.uniform(9)}
      )

  defp discs(map, count) do
    for _ <- 1..count//1, {x, y} = place(map), into: <<>> do
      <<x::float-native, y::float-native, 0.1 + :rand.uniform() / 3::float-native>>
    end
  end

  defp rings(map, count) do
    for index <- 0..(count - 1)//1 do
      {x, y} = place(map)
      {c, s} = direction()

      geometry =
        for _ <- 1..4, into: <<>> do
          for(
            {a, b} <- Enum.map(1..5, fn _ -> direction() end),
            into: <<>>,
            do: <<a::float-native, b::float-native>>
          )
          |> then(
            &(<<:rand.uniform() - 0.5::float-native, :rand.uniform() - 0.5::float-native>> <> &1)
          )
        end

      {index, x, y, c, s, 0.15, 5.1, geometry}
    end
  end

  defp sight(map) do
    {x, y} = place(map)
    {c, s} = direction()
    horizon = if :rand.uniform(2) == 1, do: 23.5, else: :rand.uniform() * 60

    {x, y, c, s, 0.6, 20.0 + :rand.uniform() * 50, horizon, 2 * :rand.uniform(40),
     2 * :rand.uniform(30)}
  end

  defp poles(map, count) do
    poles =
      for _ <- 1..count//1, {x, y} = place(map) do
        case :rand.uniform(4) do
          4 ->
            halves = {0.1 + :rand.uniform(), 0.05 + :rand.uniform() / 2}
            quarter = Enum.random([0.0, :math.pi() / 2, 7 * :rand.uniform()])
            {Hal.Pose.new(x, y, quarter), halves, 0.1 + :rand.uniform(), :box}

          round ->
            kind = Enum.at([:landmark, :robot, :ball], round - 1)
            {x, y, 0.05 + :rand.uniform() / 2, 0.2 + :rand.uniform(), kind}
        end
      end

    Compute.pack(poles)
  end

  # Some are near the camera, so that pictures are full of them.
  defp marks(map, sight, count) do
    for _ <- 1..count//1 do
      {x, y} = place(map)
      {c, s} = direction()
      reach = Enum.random([1, 30])
      [rows, columns] = for _ <- 1..2, do: :rand.uniform(11)
      white = for _ <- 1..(rows * columns), into: <<>>, do: <<:rand.uniform(2) - 1>>
      edges = Enum.sort(for _ <- 0..columns, do: 2 * :rand.uniform() - 0.8)
      edges = for edge <- edges, into: <<>>, do: <<edge::float-native>>

      {elem(sight, 0) + x / reach, elem(sight, 1) + y / reach, c, s, :rand.uniform() * 1.5,
       0.01 + :rand.uniform() / 5, rows, edges, white}
    end
  end

  test "the library is loaded" do
    assert Compute.Native.loaded?()
  end

  test "both compute the same distance fields, in moves of a chess king" do
    for _ <- 1..60 do
      {walls, width, height} = plan()
      field = Compute.Native.field(walls, width, height)
      assert field == Reference.field(walls, width, height)

      for _ <- 1..20 do
        {i, j} = {:rand.uniform(width) - 1, :rand.uniform(height) - 1}
        assert :binary.at(field, j * width + i) == king(walls, width, height, i, j)
      end
    end
  end

  defp king(walls, width, height, i, j) do
    border = Enum.min([i + 1, width - i, j + 1, height - j])

    for y <- 0..(height - 1),
        x <- 0..(width - 1),
        :binary.at(walls, y * width + x) != 0,
        reduce: border do
      least -> min(least, max(abs(x - i), abs(y - j)))
    end
  end

  test "for sonars, native and reference agree to the bit" do
    for _ <- 1..150 do
      map = map(plan())
      count = :rand.uniform(6) - 1
      {discs, rings, noise} = {discs(map, count), rings(map, count), noise()}
      ranges = Compute.Native.sonar_few(map, discs, rings, noise)
      assert ranges == Reference.sonar_few(map, discs, rings, noise)
      assert ranges == Compute.Native.sonar_many(map, discs, rings, noise)
    end
  end

  # A mount and rays, of which some are along the axes.
  defp lidars(map, count) do
    for index <- 0..(count - 1)//1 do
      {x, y} = place(map)
      {c, s} = direction()

      rays =
        for _ <- 1..60, {a, b} = direction(), into: <<>>, do: <<a::float-native, b::float-native>>

      mount = <<:rand.uniform() - 0.5::float-native, :rand.uniform() - 0.5::float-native>>
      {index, x, y, c, s, 0.12, 3.5, mount <> rays}
    end
  end

  test "for lidars, native and reference agree to the bit, and measure what sonars hear" do
    for _ <- 1..150 do
      map = map(plan())
      discs = discs(map, 6)
      lidars = lidars(map, 3)
      noise = noise()
      scans = Compute.Native.scan_few(map, discs, lidars, noise)
      assert scans == Reference.scan_few(map, discs, lidars, noise)
      assert scans == Compute.Native.scan_many(map, discs, lidars, noise)

      # A sonar whose five directions are one ray.
      [
        {index, x, y, c, s, least, most,
         <<mount::binary-size(16), ray::binary-size(16), _::binary>>}
        | _
      ] = lidars

      ring = {index, x, y, c, s, 0.0, most, mount <> :binary.copy(ray, 5)}
      [[range]] = Compute.Native.sonar_few(map, discs, [ring], nil)
      [<<mm::16, _::binary>> | _] = Compute.Native.scan_few(map, discs, lidars, nil)
      assert mm == if(range < least or range >= most, do: 65_535, else: trunc(range * 1000 + 0.5))
    end
  end

  test "a lidar loses one ray in fifty, and errs by 0.7 %" do
    map = {Reference.field(:binary.copy(<<0>>, 200 * 200), 200, 200), 200, 200, 0.05}
    # Walls are 5 m away in each direction along the axes; 2 m where a disc is.
    discs =
      <<0.0::float-native, 0.0::float-native, 0.1::float-native, 2.5::float-native,
        0.0::float-native, 0.5::float-native>>

    rays = :binary.copy(<<1.0::float-native, 0.0::float-native>>, 4_000)

    lidar =
      {0, 0.0, 0.0, 1.0, 0.0, 0.12, 3.5, <<0.0::float-native, 0.0::float-native, rays::binary>>}

    [scan] = Compute.Native.scan_few(map, discs, [lidar], {7, 1, 0})
    heard = for <<mm::16 <- scan>>, mm < 65_535, do: mm / 1000
    assert_in_delta length(heard), 3_920, 40
    mean = Enum.sum(heard) / length(heard)
    assert_in_delta mean, 2.0, 0.001
    variance = Enum.sum(for r <- heard, do: (r - mean) * (r - mean)) / length(heard)
    assert_in_delta :math.sqrt(variance), 0.014, 0.001
  end

  test "a jumping ray meets the wall that a creeping one meets" do
    for _ <- 1..300 do
      {_field, width, height, cell} = map = map(plan())
      {x, y} = place(map)
      {rx, ry} = direction()
      {t, _axis} = Rays.wall(map, x, y, rx, ry, 50.0)

      wall? = fn t ->
        {px, py} = {x + rx * t + width * cell / 2, y + ry * t + height * cell / 2}
        {i, j} = {floor(px / cell), floor(py / cell)}

        i < 0 or j < 0 or i >= width or j >= height or
          :binary.at(elem(map, 0), j * width + i) == 0
      end

      # There is wall just behind the hit, and none before it, except for corners cut by less than
      # a step.
      assert t == 0.0 or Enum.any?([1.0e-9, 1.0e-6], &wall?.(t + &1))
      crept = Enum.count(1..trunc(t / 0.01)//1, &wall?.(&1 * 0.01 - 0.005))
      assert crept == 0
    end
  end

  test "for joining pieces to regions, native and reference agree, in the same order" do
    for _ <- 1..300 do
      columns = Enum.sort(for _ <- 1..:rand.uniform(60), do: :rand.uniform(40))

      # Within a column from below to above, as the camera sees what is behind something.
      pieces =
        for column <- Enum.uniq(columns), into: <<>> do
          rows = Enum.sort(Enum.take_random(0..30, 2 * :rand.uniform(4)), :desc)

          for [bottom, top] <- Enum.chunk_every(rows, 2), into: <<>> do
            <<column::16-native, top::16-native, bottom::16-native, :rand.uniform(4) - 1,
              :rand.uniform(255)>>
          end
        end

      least = for _ <- 1..4, into: <<>>, do: <<:rand.uniform(120)>>
      assert Compute.Native.join(pieces, least) == Reference.join(pieces, least)
    end

    for wrong <- [<<0>>, <<0::48, 2, 0>>, <<0::16, 9::16-native, 1::16-native, 0, 0>>],
        do: assert_raise(ArgumentError, fn -> Compute.Native.join(wrong, <<0, 0>>) end)
  end

  test "for looking, native and reference agree" do
    for _ <- 1..150 do
      map = map(plan())
      {sight, poles} = {sight(map), poles(map, :rand.uniform(9) - 1)}
      assert Compute.Native.look(map, sight, poles) == Reference.look(map, sight, poles)
    end
  end

  test "for painting, native and reference agree to the byte" do
    for _ <- 1..60 do
      map = map(plan())
      {sight, poles, noise} = {sight(map), poles(map, :rand.uniform(9) - 1), noise()}
      marks = marks(map, sight, :rand.uniform(5) - 1)
      picture = Compute.Native.paint(map, sight, poles, marks, noise, Compute.tables())
      assert picture == Reference.paint(map, sight, poles, marks, noise, Compute.tables())
      {width, height} = {elem(sight, 7), elem(sight, 8)}
      assert {:ok, byte_size(picture)} == Hal.Frame.byte_size(:i420, width, height)
    end
  end

  test "wrong terms are refused, not computed with" do
    map = map({<<0::80>>, 5, 2})
    {field, _, _, cell} = map
    sight = sight(map)
    tables = Compute.tables()
    badarg = fn call -> assert_raise ArgumentError, call end
    badarg.(fn -> Compute.Native.field(<<0::80>>, 5, 3) end)
    badarg.(fn -> Compute.Native.field(<<>>, 0, 0) end)
    badarg.(fn -> Compute.Native.sonar_few({field, 5, 3, cell}, <<>>, [], nil) end)
    badarg.(fn -> Compute.Native.sonar_few(map, <<1>>, [], nil) end)
    badarg.(fn -> Compute.Native.sonar_few(map, <<>>, [:no], nil) end)

    badarg.(fn ->
      Compute.Native.sonar_few(map, <<>>, [{0, 1.0e9, 0.0, 1.0, 0.0, 0.1, 5.0, <<>>}], nil)
    end)

    badarg.(fn ->
      Compute.Native.sonar_few(map, <<>>, [{0, 0.0, 0.0, 1.0, 0.0, 0.1, 5.0, <<1>>}], nil)
    end)

    badarg.(fn -> Compute.Native.sonar_few(map, <<-1::64>>, [], nil) end)

    for geometry <- [<<>>, <<1>>, <<0::64>>, <<-1::128>>, :binary.copy(<<0::128>>, 4_098)] do
      badarg.(fn ->
        Compute.Native.scan_few(map, <<>>, [{0, 0.0, 0.0, 1.0, 0.0, 0.1, 5.0, geometry}], nil)
      end)
    end

    mount = <<0::128>>

    badarg.(fn ->
      Compute.Native.scan_few(map, <<>>, [{0, 0.0, 0.0, 1.0, 0.0, 0.1, 66.0, mount}], nil)
    end)

    badarg.(fn -> Compute.Native.scan_few(map, <<1>>, [], nil) end)
    badarg.(fn -> Compute.Native.scan_few(map, <<>>, [] ++ :tail, nil) end)

    assert [<<>>] ==
             Compute.Native.scan_few(map, <<>>, [{0, 0.0, 0.0, 1.0, 0.0, 0.1, 5.0, mount}], nil)

    badarg.(fn -> Compute.Native.sonar_few(map, <<>>, [], {-1, 0, 0}) end)
    badarg.(fn -> Compute.Native.sonar_few(map, <<>>, [] ++ :tail, nil) end)
    badarg.(fn -> Compute.Native.look(map, put_elem(sight, 7, 5000), <<>>) end)
    badarg.(fn -> Compute.Native.look(map, put_elem(sight, 8, 3), <<>>) end)
    badarg.(fn -> Compute.Native.look(map, sight, <<0::544>>) end)
    badarg.(fn -> Compute.Native.paint(map, sight, <<>>, [], nil, <<tables::binary, 0>>) end)
    badarg.(fn -> Compute.Native.paint(map, put_elem(sight, 5, 0.0), <<>>, [], nil, tables) end)
    edges = &for(edge <- &1, into: <<>>, do: <<edge * 1.0::float-native>>)
    mark = {1.0, 0.0, -1.0, 0.0, 0.3, 0.02, 2, edges.([-1, 0, 1]), <<0, 1, 1, 0>>}

    for wrong <- [
          :no,
          put_elem(mark, 0, 1.0e9),
          put_elem(mark, 2, 2.0),
          put_elem(mark, 5, 0.0),
          put_elem(mark, 6, 3),
          put_elem(mark, 7, edges.([-1, 1])),
          put_elem(mark, 7, edges.([1, 0, 1])),
          put_elem(mark, 7, edges.([-1, 0, 1.0e9])),
          put_elem(mark, 7, <<edges.([-1, 0, 1])::binary, 0>>),
          {1.0, 0.0, -1.0, 0.0, 0.3, 0.02, 33, edges.([0, 1]), :binary.copy(<<0>>, 33)},
          {1.0, 0.0, -1.0, 0.0, 0.3, 0.02, 1, edges.(0..33), :binary.copy(<<0>>, 33)}
        ],
        do: badarg.(fn -> Compute.Native.paint(map, sight, <<>>, [mark, wrong], nil, tables) end)

    badarg.(fn -> Compute.Native.paint(map, sight, <<>>, [mark] ++ :tail, nil, tables) end)
    assert is_binary(Compute.Native.paint(map, sight, <<>>, [mark], nil, tables))
    assert Compute.Native.look(map, sight, <<>>) == <<>>
  end

  test "draws are uniform, normal, and independent of each other" do
    draws = for k <- 1..20_000, do: Sim.Noise.gauss(Sim.Noise.hash(1, 2, 3, k))
    mean = Enum.sum(draws) / 20_000
    assert_in_delta mean, 0.0, 0.03
    assert_in_delta Enum.sum(Enum.map(draws, &(&1 * &1))) / 20_000, 1.0, 0.05
    next = Enum.zip_with(draws, tl(draws), &(&1 * &2))
    assert_in_delta Enum.sum(next) / 20_000, 0.0, 0.03
    steps = for step <- 1..20_000, do: Sim.Noise.unit(Sim.Noise.hash(1, step, 3, 4))
    assert_in_delta Enum.sum(steps) / 20_000, 0.5, 0.01
  end

  test "a camera sees what is in front of it" do
    body =
      Sim.World.Body.new(
        %{id: :mag1, profile: Hal.Profile.magellan(), pose: Hal.Pose.new(1, 2)},
        0,
        1,
        :off
      )

    assert %CameraFrustum{x: 1.0, y: 2.0, width: 320, height: 240, horizon: 119.5} =
             CameraFrustum.of(body)

    assert_in_delta CameraFrustum.of(body).focal, 277.128, 0.001
  end
end
