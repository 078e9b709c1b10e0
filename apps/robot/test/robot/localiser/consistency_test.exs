defmodule Robot.Localiser.ConsistencyTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Robot.Localiser.{Belief, Consistency, Frame}
  alias Robot.Percept
  alias Robot.Percept.Sighting
  alias Vision.{Blob, Detections}

  @view :math.pi() / 3
  @here Pose.new(0, 0)
  @radius 0.2

  defp robot(key, at, sd \\ 0.02, radius \\ @radius) do
    %{
      key: key,
      kind: :robot,
      colour: "R",
      at: at,
      sd: {sd, sd, 0.0},
      common: {0.0, 0.0},
      reference?: true,
      radius: radius
    }
  end

  defp blob({x, y}, colour \\ "R") do
    focal = 160 / :math.tan(@view / 2)
    column = 159.5 - focal * y / x
    half = Sighting.width(@radius, :math.sqrt(x * x + y * y), 320, @view) / 2

    %Blob{
      colour: colour,
      area: 500,
      share: 0.0065,
      x: column,
      y: 120.0,
      left: max(round(column - half), 0),
      right: min(round(column + half) - 1, 319),
      top: 60,
      bottom: 180,
      width: 320,
      height: 240
    }
  end

  defp judge(robots, blobs, belief \\ Belief.new(@here), back \\ @here, grid \\ nil) do
    Consistency.judge(
      belief,
      robots,
      %Percept{
        robot: :mag1,
        at_ms: 0,
        profile: Profile.magellan(),
        grid: grid,
        detections: %Detections{at_ms: 0, blobs: blobs, field_of_view: @view}
      },
      back
    )
  end

  @robots [{1.2, 0.35}, {1.6, -0.5}]

  defp robots, do: for({at, n} <- Enum.with_index(@robots), do: robot(n, at))

  test "a picture that shows each robot about where it was told is consistent" do
    assert judge(robots(), Enum.map(@robots, &blob/1)) == :consistent
    assert judge(robots(), for({x, y} <- @robots, do: blob({x, y + 0.05}))) == :consistent
  end

  test "a robot where none can be contradicts, whatever else fits" do
    assert judge(robots(), Enum.map([{2.0, -0.1} | @robots], &blob/1)) == :contradicted
  end

  test "a near robot that must be seen and is not contradicts, if nothing hides it" do
    [_one, other] = @robots
    assert judge(robots(), [blob(other)]) == :contradicted
    assert judge(robots(), []) == :contradicted
    # The landmark stands before it.
    assert judge(robots(), [blob({0.8, 0.23}, "L"), blob(other)]) == :consistent
  end

  test "a robot that is far away may stand behind a wall" do
    assert judge([robot(1, {3.5, 0.0}, 0.02, 0.6)], []) == :unknown
    assert judge([robot(1, {2.5, 0.0}, 0.02, 0.6)], []) == :contradicted
  end

  # A wall across the way at x = 0.8 m, where `wall?` says so of y.
  defp wall(wall?) do
    cells =
      for j <- 0..79, i <- 0..79, into: <<>> do
        if i == 48 and wall?.(-4.0 + 0.1 * (j + 0.5)), do: <<1>>, else: <<0>>
      end

    Nav.Grid.new(cells, {80, 80}, 0.1, {-4.0, -4.0}, closed?: true)
  end

  test "a near robot of which a wall hides a part need not be seen where that is" do
    for {grid, verdict} <- [
          {nil, :contradicted},
          {wall(fn _y -> false end), :contradicted},
          {wall(&(&1 > 0.0)), :unknown}
        ],
        do: assert(judge([robot(1, {1.2, 0.0})], [], Belief.new(@here), @here, grid) == verdict)
  end

  test "a robot that is seen past a wall contradicts only where it cannot be seen from anywhere near" do
    grid = wall(&(abs(&1) < 0.4))
    seen = [blob({1.6, 0.0})]
    # By 0.3 m to either side, where a line past the wall needs 0.6 m.
    unsure = Frame.reframe(Belief.new(@here), {4.0, 0.0}, 0.0, 0.0056)
    assert judge([robot(1, {1.6, 0.0})], seen, unsure, @here, grid) == :consistent
    assert judge([robot(1, {1.6, 0.0})], seen, Belief.new(@here), @here, grid) == :contradicted
  end

  test "a robot whose place is not known well may be seen anywhere about, or not at all" do
    vague = [robot(1, {2.0, 0.0}, 0.4)]
    assert judge(vague, [blob({2.0, 0.8})]) == :consistent
    assert judge(vague, []) == :unknown
    assert judge([robot(1, {2.0, 0.0}, 0.02)], [blob({2.0, 0.8})]) == :contradicted
  end

  test "who does not know well where it is itself allows more" do
    far = Enum.map(@robots, fn {x, y} -> blob({x, y + 0.5}) end)
    assert judge(robots(), far) == :contradicted
    # Turned about where it stands, by an angle that it knows by 0.2 rad.
    unsure = Frame.reframe(Belief.new(@here), {0.0, 0.0}, 0.0, 0.04)
    assert judge(robots(), far, unsure) == :consistent
  end

  test "the picture counts from where it was taken" do
    turned = Pose.new(0, 0, 0.4)

    seen =
      Enum.map(
        @robots,
        &blob(Pose.point(Pose.relative(turned, Pose.new(elem(&1, 0), elem(&1, 1)))))
      )

    assert judge(robots(), seen, Belief.new(@here), turned) == :consistent
    assert judge(robots(), seen) == :contradicted
  end

  test "without told robots, or with nothing to see, nothing is known" do
    assert judge([], [blob({2.0, 0.0})]) == :unknown
    assert judge([robot(1, {-2.0, 0.0})], []) == :unknown
    assert judge([robot(1, {-2.0, 0.0})], [blob({2.0, 0.0}, "L")]) == :unknown
  end
end
