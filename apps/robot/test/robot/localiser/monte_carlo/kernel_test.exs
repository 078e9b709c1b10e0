defmodule Robot.Localiser.MonteCarlo.KernelTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Robot.Localiser.MonteCarlo.{Native, Readings, Reference}
  alias Robot.{Percept, Room}

  @size {5.0, 3.0}

  defp draw(low, high), do: low + :rand.uniform() * (high - low)
  defp floats(numbers), do: for(number <- numbers, into: <<>>, do: <<number::float-native>>)

  defp plan do
    grid = Room.plan(@size)
    {grid.clear, grid.width, grid.height, grid.cell, grid.left, grid.low}
  end

  defp poses(count, far),
    do: floats(for _ <- 1..count, n <- [far, far, 4.0, 0.1], do: draw(-n, n))

  defp readings do
    sonar = for _ <- 1..16, do: draw(0.1, 5.1)
    percept = %Percept{robot: :mag1, at_ms: 0, profile: Profile.magellan(), sonar: sonar}
    Readings.pack(percept, Pose.new(0, 0))
  end

  test "the kernels in C give the bytes that the reference gives, in the room and outside" do
    assert Native.loaded?()

    for _ <- 1..60 do
      bits = :rand.uniform(4_294_967_296) - 1
      poses = poses(:rand.uniform(30), 7.0)
      step = floats([draw(-1, 1), draw(-1, 1), draw(-7, 7), draw(0, 2), 0.02, 0.01, 0.05])
      {readings, _counting} = readings()

      for {function, arguments} <- [
            {:move, [poses, step, bits]},
            {:scatter, [:rand.uniform(40), plan(), :rand.uniform(60), 0.05, bits]},
            {:weigh, [poses, plan(), readings, Readings.tables()]}
          ],
          do: assert(apply(Native, function, arguments) == apply(Reference, function, arguments))
    end
  end

  test "they refuse what is not of their sizes" do
    {readings, _counting} = readings()
    {clear, width, height, cell, left, low} = plan()
    nan = <<0, 0, 0, 0, 0, 0, 0xF8, 0x7F>>

    good = %{
      move: [poses(2, 1.0), floats(List.duplicate(0.1, 7)), 5],
      scatter: [3, plan(), 5, 0.05, 5],
      weigh: [poses(2, 1.0), plan(), readings, Readings.tables()]
    }

    for {function, arguments} <- good, do: assert(is_binary(apply(Native, function, arguments)))

    for {function, at, bad} <- [
          {:move, 0, poses(1_001, 1.0)},
          {:move, 0, floats([1, 2, 3])},
          {:move, 0, nan <> floats([1, 2, 3])},
          {:move, 1, floats([1, 2, 3])},
          {:move, 2, -1},
          {:move, 2, 4_294_967_296},
          {:scatter, 0, 1_001},
          {:scatter, 1, {clear <> <<0>>, width, height, cell, left, low}},
          {:scatter, 1, {clear, width, height, 0.0, left, low}},
          {:scatter, 1, {clear, 0, height, cell, left, low}},
          {:scatter, 2, 256},
          {:scatter, 3, -0.1},
          {:weigh, 2, floats([1, 2])},
          {:weigh, 2, floats(List.duplicate(1.0e3, 15))},
          {:weigh, 2, String.duplicate(binary_part(readings, 0, 120), 65)},
          {:weigh, 3, <<0, 0>>}
        ] do
      arguments = List.replace_at(good[function], at, bad)
      assert_raise(ArgumentError, fn -> apply(Native, function, arguments) end)
    end
  end

  test "random places are free, and all over the room" do
    places = Reference.unpack(Native.scatter(400, plan(), 12, 0.05, 7))
    {clear, width, _height, cell, left, low} = plan()

    for {x, y, heading, _slip} <- places do
      at = floor((y - low) / cell) * width + floor((x - left) / cell)
      assert :binary.at(clear, at) >= 12
      assert heading > -:math.pi() and heading <= :math.pi()
    end

    {xs, ys, headings} =
      {Enum.map(places, &elem(&1, 0)), Enum.map(places, &elem(&1, 1)),
       Enum.map(places, &elem(&1, 2))}

    assert Enum.max(xs) - Enum.min(xs) > 3.5 and Enum.max(ys) - Enum.min(ys) > 1.7
    assert Enum.max(headings) - Enum.min(headings) > 6.0
  end

  test "the readings of a place fit it better than all others" do
    truth = Pose.new(1.2, 0.9, 0.4)
    percept = Room.percept(@size, truth, Pose.new(0, 0), 0, Room.plan(@size))
    {readings, counting} = Readings.pack(percept, truth)
    here = Reference.pack({truth.x, truth.y, truth.heading, 0.0})

    beside =
      for d <- [-0.4, 0.4],
          {x, y, h} <- [{d, 0.0, 0.0}, {0.0, d, 0.0}, {0.0, 0.0, d}],
          into: <<>>,
          do: Reference.pack({truth.x + x, truth.y + y, truth.heading + h, 0.0})

    weighed = Native.weigh(here <> beside, plan(), readings, Readings.tables())

    [{best, fits} | others] =
      for <<sum::32-signed-native, fits::32-signed-native <- weighed>>, do: {sum, fits}

    assert fits >= 0.9 * counting
    for {sum, fewer} <- others, do: assert(sum < best - 1_000 and fewer < fits)
  end
end
