defmodule Vision.Marks.PoseTest do
  use ExUnit.Case, async: true
  alias Vision.Marks.Pose
  doctest Vision.Marks.Pose

  @camera %{
    width: 640,
    height: 480,
    field_of_view: :math.pi() / 3,
    pan: 0.0,
    tilt: 0.0
  }
  @focal 320 / :math.tan(:math.pi() / 6)

  # The corners of a mark at a place on the floor before the camera, so high above its eye, turned by yaw to the left.
  defp corners({ahead, left, up}, yaw, size, camera \\ @camera) do
    for {x, y} <- [{-1, -1}, {1, -1}, {1, 1}, {-1, 1}] do
      forward = ahead + x * size / 2 * :math.sin(yaw)
      right = -left + x * size / 2 * :math.cos(yaw)
      down = -up + y * size / 2
      {c, s} = {:math.cos(camera.tilt), :math.sin(camera.tilt)}
      {z, y} = {forward * c - down * s, forward * s + down * c}
      {319.5 + @focal * right / z, 239.5 + @focal * y / z}
    end
  end

  test "corners of a pose give that pose again" do
    for ahead <- [0.5, 2.0, 6.0],
        left <- [-0.2, 0.0, 0.4],
        up <- [-0.1, 0.0, 0.3],
        yaw <- [-1.0, -0.3, 0.0, 0.2, 0.9],
        tilt <- [0.0, 0.2],
        pan <- [0.0, 1.0] do
      camera = %{@camera | tilt: tilt, pan: pan}
      seen = for {u, v} <- corners({ahead, left, up}, yaw, 0.3, camera), do: {u, v}
      pose = Pose.reading(seen, camera, 0.3)
      assert_in_delta pose.range, :math.sqrt(ahead * ahead + left * left), 1.0e-9
      assert_in_delta pose.bearing, pan + :math.atan2(left, ahead), 1.0e-9
      # Seen straight on, both poses are the same one, and of a small mark neither counts.
      if pose.yaw, do: assert_in_delta(pose.yaw, pan + yaw, 1.0e-6)
      assert pose.yaw == nil == (pose.yaw_sd == nil)
    end
  end

  test "the poses that fit are mirrored at the line of sight" do
    seen =
      for {u, v} <- corners({4.0, 0.0, 0.0}, 0.5, 0.16),
          do: {(u - 319.5) / @focal, (v - 239.5) / @focal}

    assert [{{_, _, {x, _, z}}, _, error}, {{_, _, {x2, _, z2}}, _, worse}] =
             Pose.solve(seen, 0.16)

    assert error < 1.0e-9 and worse > error
    assert_in_delta :math.atan2(-x, z), 0.5, 1.0e-6
    assert_in_delta :math.atan2(-x2, z2), -0.5, 0.05
  end

  test "a mark seen straight on, 20 pixels wide, has no yaw; a large turned one has" do
    :rand.seed(:exsss, 3)

    for _ <- 1..100 do
      far = corners({@focal * 0.16 / 20, 0.0, 0.0}, 0.0, 0.16)
      assert Pose.reading(shaken(far, 0.2), @camera, 0.16).yaw == nil
      near = corners({@focal * 0.16 / 100, 0.0, 0.0}, 0.5, 0.16)
      pose = Pose.reading(shaken(near, 0.2), @camera, 0.16)
      assert_in_delta pose.yaw, 0.5, 0.05
    end
  end

  test "the deviations are those of corners that are off by 0.2 pixels" do
    :rand.seed(:exsss, 4)

    for {wide, yaw} <- [{20, 0.5}, {60, 0.5}, {100, -0.6}] do
      exact = corners({@focal * 0.16 / wide, 0.1, 0.05}, yaw, 0.16)
      told = Pose.reading(exact, @camera, 0.16)
      all = for _ <- 1..400, do: Pose.reading(shaken(exact, 0.2), @camera, 0.16)
      assert_in_delta spread(all, & &1.range) / told.range_sd, 1.0, 0.25
      assert_in_delta spread(all, & &1.bearing) / told.bearing_sd, 1.0, 0.25

      if wide > 40 do
        known = Enum.filter(all, & &1.yaw)
        assert length(known) > 380
        assert_in_delta spread(known, & &1.yaw) / told.yaw_sd, 1.0, 0.25
      end
    end
  end

  test "what is behind the camera, or has no area, is no mark" do
    assert Pose.reading([{1.0, 1.0}, {2.0, 2.0}, {3.0, 3.0}, {4.0, 4.0}], @camera, 0.16) == nil
  end

  defp shaken(corners, px),
    do: for({u, v} <- corners, do: {u + px * :rand.normal(), v + px * :rand.normal()})

  defp spread(all, of) do
    values = Enum.map(all, of)
    mean = Enum.sum(values) / length(values)
    :math.sqrt(Enum.sum(for(v <- values, do: (v - mean) * (v - mean))) / length(values))
  end
end
