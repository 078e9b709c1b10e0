defmodule Nav.OccupancyGridTest do
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Nav.{Grid, KnownWalls, OccupancyGrid}
  alias Nav.OccupancyGrid.{Native, Reference}
  doctest Nav.Grid.Packed

  @tangent :math.tan(:math.pi() / 12)

  defp draw(low, high), do: low + :rand.uniform() * (high - low)

  defp cones(size) do
    for _ <- 1..:rand.uniform(5), into: <<>> do
      {x, y, angle} = {draw(-3, size + 3), draw(-3, size + 3), draw(-4, 4)}

      <<x::float-native, y::float-native, :math.cos(angle)::float-native,
        :math.sin(angle)::float-native, draw(-2, size)::float-native, draw(0, size)::float-native,
        :rand.uniform(2) - 1.0::float-native>>
    end
  end

  defp discs(size) do
    for _ <- 1..(:rand.uniform(3) - 1)//1, into: <<>> do
      <<draw(-5, size + 5)::float-native, draw(-5, size + 5)::float-native,
        draw(0, 5)::float-native>>
    end
  end

  test "the kernels in C give the bytes of the reference" do
    assert Native.loaded?()

    for _ <- 1..120 do
      size = :rand.uniform(24)
      cells = for _ <- 1..(size * size), into: <<>>, do: <<:rand.uniform(101) - 41::signed>>
      {right, up} = {:rand.uniform(9) - 5, :rand.uniform(9) - 5}
      decay = :rand.uniform(4) - 1
      thick = draw(0.3, 1.5)

      arguments = [cells, size, right, up, decay, cones(size), @tangent, thick, discs(size), 30]

      {added, changes} = apply(Reference, :add, arguments)
      assert apply(Native, :add, arguments) == {added, changes}

      angle = draw(-4, 4)
      at = {draw(-5, size), draw(-5, size), :math.cos(angle), :math.sin(angle)}
      assert Native.walls(added, size, at, 30) == Reference.walls(added, size, at, 30)
    end
  end

  test "the kernels refuse what is not of their sizes" do
    cone = for k <- 1..7, into: <<>>, do: <<k * 1.0::float-native>>
    good = [<<0, 0, 0, 0>>, 2, 0, 0, 0, cone, 0.2, 0.7, <<>>, 30]
    assert {<<_::32>>, _changes} = apply(Native, :add, good)

    for {at, bad} <- [
          {0, <<0>>},
          {1, 0},
          {1, -2},
          {1, 2.0},
          {2, 5000},
          {4, -1},
          {5, <<0>>},
          {5, <<-1::64, 0::384>>},
          {6, 0.0},
          {7, 1.0e9},
          {8, <<1>>},
          {9, 0}
        ],
        do:
          assert_raise(ArgumentError, fn ->
            apply(Native, :add, List.replace_at(good, at, bad))
          end)

    for at <- [{0.0, 0.0, 1.0}, {1.0e9, 0.0, 1.0, 0.0}, :nowhere],
        do: assert_raise(ArgumentError, fn -> Native.walls(<<0>>, 1, at, 30) end)
  end

  test "a grid that was packed is the same, whatever its walls are" do
    for _ <- 1..40 do
      {width, height} = {:rand.uniform(20), :rand.uniform(20)}
      cells = for _ <- 1..(width * height), into: <<>>, do: <<div(:rand.uniform(12), 12)>>
      grid = Grid.new(cells, {width, height}, 0.1, {-3.5, 2.0}, closed?: :rand.uniform(2) == 1)
      assert grid |> Grid.Packed.pack() |> Grid.Packed.unpack() == {:ok, grid}
    end

    assert Grid.Packed.pack(nil) == nil and Grid.Packed.unpack(nil) == {:ok, nil}

    for bad <- [
          :other,
          {2, 2, 0.1, 0.0, 0.0, false, <<1>>},
          {2, 2, 0.1, 0.0, 0.0, false, <<2::32, 1::32>>},
          {5000, 5000, 0.1, 0.0, 0.0, false, <<>>}
        ],
        do: assert(Grid.Packed.unpack(bad) == :error)
  end

  # A room of one wall: a Magellan's sonars (their axes) among segments of walls, in the true frame.
  defp ranges(pose, walls) do
    for sonar <- Profile.magellan().sonars do
      {x, y} = Pose.place(pose, {sonar.x, sonar.y})
      heading = pose.heading + sonar.heading

      -2..2
      |> Enum.map(&(heading + &1 * :math.pi() / 24))
      |> Enum.map(&nearest(x, y, :math.cos(&1), :math.sin(&1), walls))
      |> Enum.min()
    end
  end

  # Walls are vertical: {x, from y, to y}.
  defp nearest(x, y, c, s, walls) do
    for {wall, low, high} <- walls,
        abs(c) > 1.0e-9,
        far = (wall - x) / c,
        far > 0,
        across = y + far * s,
        across >= low and across <= high,
        reduce: 5.1 do
      least -> min(least, far)
    end
  end

  defp percept(at_ms, pose, sonar, options \\ []) do
    %{
      at_ms: at_ms,
      profile: Profile.magellan(),
      pose: pose,
      uncertainty: nil,
      odometry: %Odometry{
        pose: options[:odometry] || pose,
        twist: Twist.new(0.2, options[:turn] || 0.0),
        frame: options[:frame]
      },
      sonar: sonar,
      peers: options[:peers] || %{}
    }
  end

  # Drives along x = 0, beside these walls, from y = -2 to y = 2.
  defp drive(grid, walls, options \\ []) do
    for k <- 0..100, reduce: grid do
      grid ->
        pose = Pose.new(0, -2 + k * 0.04, :math.pi() / 2)
        sonar = ranges(pose, walls)
        OccupancyGrid.update(grid, percept(k * 100, pose, sonar, options), options[:discs] || [])
    end
  end

  @door [{1.0, -4.0, -0.6}, {1.0, 0.6, 4.0}]

  test "a wall beside the way is known, with the door in it" do
    grid = OccupancyGrid.new() |> drive(@door) |> OccupancyGrid.grid()

    for y <- [-1.8, -1.2, 1.2, 1.8] do
      assert Grid.clearance(grid, {1.0, y}) < 0.1 or Grid.clearance(grid, {1.1, y}) < 0.1
      refute Grid.passes?(grid, {0.2, y}, {2.0, y}, 0.23)
    end

    assert Grid.passes?(grid, {0.0, 0.0}, {2.0, 0.0}, 0.23)
    assert Grid.free?(grid, {0.3, -1.0}, 0.3)
    assert [{x, _y} | _] = Grid.Way.find(grid, {0.0, -1.5}, {2.5, -1.5}, 0.23)
    assert x > 0.2
  end

  test "one echo is no wall, and what is seen through is none any more" do
    pose = Pose.new(0, 0)
    silent = List.duplicate(5.1, 16)
    echo = List.replace_at(silent, 11, 1.0)

    grid =
      OccupancyGrid.new()
      |> OccupancyGrid.update(percept(0, pose, echo), [])
      |> OccupancyGrid.update(percept(5_000, pose, silent), [])

    assert OccupancyGrid.grid(grid) == nil

    see = fn grid, times, from_ms, sonar ->
      for k <- times, reduce: grid do
        grid -> OccupancyGrid.update(grid, percept(from_ms + k * 1_000, pose, sonar), [])
      end
    end

    grid = see.(grid, 1..20, 5_000, echo)
    assert Grid.clearance(OccupancyGrid.grid(grid), {1.25, 0.0}) < 0.1
    assert OccupancyGrid.grid(see.(grid, 1..40, 25_000, silent)) == nil
  end

  test "the same reading again, and readings of a robot that turns fast, count for little" do
    {pose, silent} = {Pose.new(0, 0), List.duplicate(5.1, 16)}
    echo = List.replace_at(silent, 11, 1.0)

    stands =
      for k <- 0..19,
          reduce: OccupancyGrid.new(),
          do: (grid -> OccupancyGrid.update(grid, percept(k * 100, pose, echo), []))

    assert OccupancyGrid.grid(stands) == nil

    turns =
      for k <- 0..300, reduce: OccupancyGrid.new() do
        grid -> OccupancyGrid.update(grid, percept(k * 100, pose, echo, turn: 2.5), [])
      end

    assert turns.at_ms in [nil, 0] and OccupancyGrid.grid(turns) == nil
  end

  test "other robots and known discs are no walls" do
    # A body that shows its edge at x = 0.8 to who passes.
    body = [{0.8, -0.15, 0.15}]

    peer = %{
      pose: Pose.new(1.0, 0),
      twist: Twist.zero(),
      radius: 0.2,
      at_ms: 0,
      mode: :holding
    }

    assert OccupancyGrid.new() |> drive(body) |> OccupancyGrid.grid() != nil

    for options <- [[peers: %{mag2: peer}], [discs: [{1.0, 0.0, 0.2}]]],
        do: assert(OccupancyGrid.new() |> drive(body, options) |> OccupancyGrid.grid() == nil)
  end

  test "a correction of the pose moves all walls, another frame of the odometry forgets them" do
    grid = OccupancyGrid.new() |> drive(@door)
    odometry = Pose.new(0, 2, :math.pi() / 2)
    # The robot learns that it is 3 m farther on and turned to the left by 90 degrees.
    pose = Pose.new(3, 2, :math.pi())
    silent = percept(12_000, pose, nil, odometry: odometry)
    moved = grid |> OccupancyGrid.update(silent, []) |> OccupancyGrid.grid()

    # What was at its right is above it now.
    refute Grid.passes?(moved, {4.0, 2.2}, {4.0, 4.0}, 0.23)
    assert Grid.passes?(moved, {5.0, 2.0}, {5.0, 4.0}, 0.23)

    other = percept(12_000, pose, nil, odometry: odometry, frame: make_ref())
    assert grid |> OccupancyGrid.update(other, []) |> OccupancyGrid.grid() == nil
  end

  test "the window follows, and forgets what is far behind or long ago" do
    grid = OccupancyGrid.new() |> drive(@door)
    size = byte_size(grid.cells)
    silent = List.duplicate(5.1, 16)

    far =
      for k <- 1..120, reduce: grid do
        grid ->
          OccupancyGrid.update(
            grid,
            percept(10_000 + k * 200, Pose.new(0, 2 + k / 4), silent),
            []
          )
      end

    assert byte_size(far.cells) == size
    assert OccupancyGrid.grid(far) == nil

    later = percept(10_000 + 200_000, Pose.new(0, 2), silent)
    assert grid |> OccupancyGrid.update(later, []) |> OccupancyGrid.grid() == nil
  end

  describe "with a floor plan" do
    # A wall at x = 1 with a door in it, its cells not those of the window.
    defp plan do
      {left, low} = {-2.03, -4.02}

      cells =
        for j <- 0..79, i <- 0..49, into: <<>> do
          {x, y} = {left + (i + 0.5) * 0.1, low + (j + 0.5) * 0.1}
          <<if(x > 1.0 and x < 1.1 and abs(y) > 0.6, do: 1, else: 0)>>
        end

      Grid.new(cells, {50, 80}, 0.1, {left, low}, closed?: true)
    end

    defp know(walls, options \\ []) do
      for k <- 0..100, reduce: KnownWalls.new(plan()) do
        known ->
          pose = Pose.new(0.3, -2 + k * 0.04, :math.pi() / 2)
          percept = percept(k * 100, pose, ranges(pose, walls), options)
          percept = %{percept | uncertainty: %{radius: options[:unsure] || 0.1}}
          KnownWalls.update(known, percept, options[:discs] || [])
      end
    end

    test "what it shows is not kept again" do
      known = know(@door)
      assert KnownWalls.known(known) == plan()
      assert KnownWalls.ways(known) == nil
      assert known.sensed.cells == nil
    end

    test "a door that is shut is a wall for ways alone" do
      known = know([{1.0, -4.0, 4.0}])
      assert KnownWalls.known(known) == plan()
      ways = KnownWalls.ways(known)
      elsewhere = percept(12_000, Pose.new(0.3, 2), nil)
      assert known |> KnownWalls.update(elsewhere, [], false) |> KnownWalls.ways() == nil
      assert {ways.width, ways.left, ways.closed?} == {50, -2.03, true}
      assert Grid.passes?(plan(), {0.3, 0.0}, {2.0, 0.0}, 0.23)
      assert Grid.Way.find(ways, {0.3, 0.0}, {2.0, 0.0}, 0.23) == nil
      # Nothing is added but in the door.
      for <<was, now <- interleave(plan().clear, ways.clear)>>, do: assert(now <= was)
      assert Grid.clearance(ways, {-1.5, -3.0}) == Grid.clearance(plan(), {-1.5, -3.0})
    end

    test "a robot that may be elsewhere takes no wall for something else" do
      off = for {x, low, high} <- @door, do: {x - 0.35, low, high}
      assert KnownWalls.ways(know(off)) != nil
      assert KnownWalls.ways(know(off, unsure: 0.5)) == nil
    end

    test "bodies that are known are nothing else, and what is long ago is forgotten whole" do
      body = [{0.9, -0.15, 0.15}]
      known = know(body)
      assert KnownWalls.ways(known) != nil
      assert KnownWalls.ways(know(body, discs: [{1.1, 0.0, 0.2}])) == nil

      silent = List.duplicate(5.1, 16)
      learnt = percept(12_000, Pose.new(0.3, 2.1), silent)
      assert known |> KnownWalls.update(learnt, [{1.1, 0.0, 0.2}]) |> KnownWalls.ways() == nil
      assert known |> KnownWalls.update(learnt, []) |> KnownWalls.ways() != nil

      later = percept(10_000 + 181_000, Pose.new(0.3, 2), silent)
      known = KnownWalls.update(known, later, [])
      assert {KnownWalls.ways(known), known.sensed.cells} == {nil, nil}
    end

    defp interleave(a, b) do
      for {x, y} <- Enum.zip(:binary.bin_to_list(a), :binary.bin_to_list(b)),
          into: <<>>,
          do: <<x, y>>
    end
  end

  test "without a pose or odometry nothing changes" do
    grid = OccupancyGrid.new() |> drive(@door)
    blind = percept(20_000, Pose.new(0, 0), List.duplicate(1.0, 16))
    assert OccupancyGrid.update(grid, %{blind | pose: nil}, []) == grid
    assert OccupancyGrid.update(grid, %{blind | odometry: nil}, []) == grid
  end
end
