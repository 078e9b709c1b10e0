defmodule Robot.Localiser.SilhouettesTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Robot.Localiser.{Belief, Frame, Silhouettes}
  alias Robot.Percept
  alias Vision.{Blob, Detections}

  @view :math.pi() / 3
  @focal 160 / :math.tan(@view / 2)
  @here Pose.new(0, 0)
  @radius 0.2

  defp draw(low, high), do: low + :rand.uniform() * (high - low)
  defp floats(numbers), do: for(number <- numbers, into: <<>>, do: <<number::float-native>>)

  test "the kernel in C gives what the reference gives, near and far, sure and unsure" do
    alias Silhouettes.{Native, Reference}
    assert Native.loaded?()

    for _ <- 1..300 do
      bodies =
        for _ <- 1..:rand.uniform(12),
            into: <<>>,
            do: floats([draw(-3, 3), draw(-3, 3), draw(0, 0.4), draw(0, 1)])

      poses = for _ <- 1..2, do: [draw(-1, 1), draw(-1, 1), draw(-7, 7)]
      line = [draw(-1, 1), draw(-1, 1), draw(-2, 2), draw(-1.5, 1.5), draw(20, 80)]
      search = floats(List.flatten([poses, line]))
      seen = :rand.uniform(1_048_576) * :rand.uniform(524_288)
      ways = floats(for k <- -5..5, do: k * draw(0, 0.5))
      arguments = [search, seen, bodies, ways]
      assert apply(Native, :fits, arguments) == apply(Reference, :fits, arguments)
    end
  end

  test "the kernel refuses what is not of its sizes" do
    good = [floats(List.duplicate(1.0, 11)), 5, floats([1, 2, 3, 4]), floats([0.5])]
    assert [{_wrong, _clear}] = apply(Silhouettes.Native, :fits, good)
    nan = <<0, 0, 0, 0, 0, 0, 0xF8, 0x7F>>

    for {at, bad} <- [
          {0, floats([1.0])},
          {0, 5},
          {1, -1},
          {1, 0x800000000000000},
          {1, 1.0},
          {2, floats([1, 2, 3])},
          {2, nan <> floats([1, 2, 3])},
          {2, floats(List.duplicate(1.0, 4 * 1_025))},
          {3, <<1>>},
          {3, floats([1.0e10])},
          {3, floats(List.duplicate(1.0, 257))}
        ],
        do:
          assert_raise(ArgumentError, fn ->
            apply(Silhouettes.Native, :fits, List.replace_at(good, at, bad))
          end)
  end

  # A column ahead of a robot that believes to stand behind it.
  @column for n <- 1..4,
              do: %{
                key: n,
                kind: :robot,
                colour: "R",
                at: {1.0 * n, 0.0},
                sd: {0.05, 0.05, 0.0},
                common: {0.0, 0.0},
                reference?: true,
                radius: @radius
              }

  # What is to be seen of them from where it truly is: one blob of all that touch, cut at the picture's border.
  defp picture(marks, truth, pan \\ 0.0) do
    [{first, last} | rest] =
      for %{at: at} <- marks, distance = Pose.distance(truth, at) do
        bearing = Pose.bearing(truth, at) - pan
        half = :math.asin(@radius / distance)
        {column(bearing + half), column(bearing - half)}
      end
      |> Enum.sort()

    spans =
      Enum.reduce(rest, [{first, last}], fn {left, right}, [{l, r} | others] ->
        if left <= r + 1,
          do: [{l, max(r, right)} | others],
          else: [{left, right}, {l, r} | others]
      end)

    blobs =
      for {left, right} <- spans, right >= 0 and left <= 319 do
        %Blob{
          colour: "R",
          area: 500,
          share: 0.0065,
          x: (left + right) / 2,
          y: 120.0,
          left: max(left, 0),
          right: min(right, 319),
          top: 60,
          bottom: 180,
          width: 320,
          height: 240
        }
      end

    %Percept{
      robot: :mag1,
      at_ms: 0,
      profile: Profile.magellan(),
      detections: %Detections{at_ms: 0, blobs: blobs, pan: pan, field_of_view: @view}
    }
  end

  defp column(bearing), do: round(159.5 - @focal * :math.tan(bearing))

  # Turned about the first of the column by an angle that it knows by this standard deviation.
  defp unsure(sd), do: Frame.reframe(Belief.new(@here), {4.0, 0.0}, 0.0, sd * sd)

  # Where it is that was turned about the first of the column by that angle.
  defp turned(angle),
    do: Pose.compose(Pose.new(4, 0, angle), Pose.new(-4, 0))

  test "a robot beside the column is found by the one wide blob that it is, cut or not" do
    for angle <- [-0.12, -0.05, 0.0, 0.07, 0.13], pan <- [0.0, 3 * angle] do
      truth = turned(angle)
      found = Silhouettes.align(unsure(0.1), @column, picture(@column, truth, pan), @here)
      assert Pose.distance(found.pose, truth) < 0.12, inspect({angle, pan, found.pose, truth})
      {sd, _, _} = Belief.sd(found)
      assert sd < 0.2 and sd > 0.1
    end
  end

  test "where the camera looks aside, what little it sees may be told of no place, but of no wrong one" do
    for angle <- [-0.12, -0.05, 0.07, 0.13], pan <- [-3 * angle, -5 * angle] do
      truth = turned(angle)
      before = unsure(0.1)
      found = Silhouettes.align(before, @column, picture(@column, truth, pan), @here)
      assert found == before or Pose.distance(found.pose, truth) < 0.12
    end
  end

  test "robots behind the walls of a plan are not missed" do
    # A wall from -4 to 4 at 2 m ahead, of one cell.
    cells = for _j <- 1..80, i <- 1..80, into: <<>>, do: if(i == 61, do: <<1>>, else: <<0>>)
    plan = Nav.Grid.new(cells, {80, 80}, 0.1, {-4.0, -4.0}, closed?: false)

    [first | _] = @column
    near = %{first | at: {1.5, 0.0}}
    hidden = for {y, key} <- [{1.2, 2}, {-1.2, 3}, {0.5, 4}], do: %{near | at: {3.0, y}, key: key}

    for angle <- [-0.12, 0.05, 0.12] do
      truth = turned(angle)
      picture = picture([near], truth)
      look = &Silhouettes.align(unsure(0.1), [near | hidden], %{picture | grid: &1}, @here).pose
      assert Pose.distance(look.(plan), truth) < 0.12
      assert look.(nil) == @here
    end
  end

  test "one that is sure enough, sees nobody, or is told of nobody stays where it is" do
    picture = picture(@column, turned(0.1))
    sure = unsure(0.045)
    assert Silhouettes.align(sure, @column, picture, @here) == sure
    unsure = unsure(0.1)
    empty = put_in(picture.detections.blobs, [])
    assert Silhouettes.align(unsure, @column, empty, @here) == unsure
    assert Silhouettes.align(unsure, [], picture, @here) == unsure
  end

  test "one that fits over a range of places is no surer than that range" do
    # Robots abreast, without a gap, that fill the picture from wherever the robot may be.
    near = for n <- -4..4, do: %{hd(@column) | key: n, at: {0.5, 0.3 * n}}
    unsure = unsure(0.1)
    found = Silhouettes.align(unsure, near, picture(near, @here), @here)
    assert found.pose == @here
    {sd, _, _} = Belief.sd(found)
    assert sd > 0.2
  end

  test "one that is unsure of its heading by half a radian stays where it is: any blob fits somewhere" do
    one = Enum.take(@column, 1)
    picture = picture(one, turned(-0.1))
    [vague, less] = for sd <- [0.55, 0.45], do: unsure(sd)
    assert Silhouettes.align(vague, one, picture, @here) == vague
    assert Silhouettes.align(less, one, picture, @here) != less
  end

  test "where two places fit, or none does, it stays where it is" do
    unsure = unsure(0.1)
    # Two abreast, of which it sees one: that may be either.
    abreast = for y <- [0.2, -0.2], do: %{hd(@column) | key: y, at: {1.0, y}}
    one = picture([%{hd(@column) | at: {1.0, 0.0}}], @here)
    assert Silhouettes.align(unsure, abreast, one, @here) == unsure
    # Robots stand where nobody told of one.
    strangers = for n <- 1..2, do: %{hd(@column) | key: n, at: {1.2, 0.9 * (n - 1.5)}}
    assert Silhouettes.align(unsure, @column, picture(strangers, @here), @here) == unsure
    # And one of whom nobody knows where it is may be all that it sees.
    anywhere = [%{hd(@column) | at: {1.0, 0.0}, sd: {1.0, 1.0, 0.0}}]
    assert Silhouettes.align(unsure, anywhere, picture(@column, turned(0.1)), @here) == unsure
  end
end
