defmodule Robot.Localiser.Walls.FacingTest do
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Robot.Localiser.Walls.Facing
  alias Nav.Grid
  alias Robot.Room

  @cone :math.pi() / 6
  @size {6.0, 4.0}

  test "finds the wall of a room that a sonar faces squarely, and how far it is" do
    plan = Room.plan(@size)
    # One of ten thousand is off by up to 0.153 m, in a corner.
    :rand.seed(:exsss, 1)

    found =
      for _ <- 1..400 do
        {x, y} = {0.4 + 5.2 * :rand.uniform(), 0.4 + 3.2 * :rand.uniform()}
        sonar = Pose.new(x, y, 2 * :math.pi() * :rand.uniform())

        with {distance, {nx, ny}} <- Facing.find(plan, sonar, @cone, 4.5) do
          aside = abs(Pose.wrap(:math.atan2(-ny, -nx) - sonar.heading))
          assert aside <= @cone / 2 + 1.0e-9
          assert min(abs(nx), abs(ny)) < 0.05
          # The nearest ray is that along the normal, but for what is little nearer in a corner.
          error = abs(distance - Room.hear(@size, sonar, @cone))
          assert error < 0.15
          error
        end
      end

    # A third of all directions are within 15 degrees of a normal; some are too far away, or in a corner.
    errors = Enum.reject(found, &is_nil/1)
    assert length(errors) > 60
    assert Enum.sum(errors) / length(errors) < 0.03
  end

  test "expects nothing of a wall that throws the echo elsewhere, is too far away, or ends in the cone" do
    plan = Room.plan(@size)
    assert {_distance, _normal} = Facing.find(plan, Pose.new(2.0, 2.0, 0.2), @cone, 4.5)
    assert Facing.find(plan, Pose.new(2.0, 2.0, 0.4), @cone, 4.5) == nil
    assert Facing.find(plan, Pose.new(2.0, 2.0, 0.2), @cone, 3.5) == nil
    assert Facing.find(plan, Pose.new(2.0, 3.9, 0.0), @cone, 4.5) == nil
  end

  test "expects nothing where something nearer is in the cone" do
    row = fn j ->
      for i <- 0..59,
          into: <<>>,
          do: if(i > 50 or (i in 20..22 and j in 24..26), do: <<1>>, else: <<0>>)
    end

    with_post = Grid.new(for(j <- 0..39, into: <<>>, do: row.(j)), {60, 40}, 0.1, {0.0, 0.0})
    at = fn y -> Facing.find(with_post, Pose.new(0.6, y, 0.0), @cone, 5.0) end
    # The post is beside the axis from the first place, and out of the cone from the second one.
    assert at.(2.15) == nil
    assert {distance, _normal} = at.(1.2)
    assert_in_delta distance, 4.5, 0.1
  end
end
