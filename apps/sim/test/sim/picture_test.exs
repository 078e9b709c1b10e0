defmodule Sim.PictureTest do
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Sim.{Floorplan, World}

  @focal 160 / :math.tan(:math.pi() / 6)

  defp robots(poses),
    do:
      for(
        {pose, k} <- Enum.with_index(poses, 1),
        do: %{id: :"mag#{k}", profile: Profile.magellan(), pose: pose}
      )

  defp painted(world, id) do
    frame = World.frame(world, id)
    assert {:ok, byte_size(frame.bytes)} == Hal.Frame.byte_size(:i420, 320, 240)
    {:ok, blobs} = Vision.blobs(frame, World.colours())
    blobs
  end

  defp alone(landmark, options \\ []) do
    {:ok, map} = Floorplan.open("hall", 12)

    World.new!(
      [map: map, robots: robots([Pose.new(0, 0)]), landmark: landmark, seed: 5] ++ options
    )
  end

  test "the blob finder finds the painted landmark, its bearing and its distance" do
    for distance <- [2.0, 3.0, 4.0, 6.0, 8.0], bearing <- [-0.3, -0.05, 0.0, 0.2] do
      world = alone({distance * :math.cos(bearing), distance * :math.sin(bearing)})

      assert [%{colour: "YellowLandmark", clipped?: false} = blob] =
               Enum.filter(painted(world, :mag1), &(&1.area > 100))

      assert_in_delta :math.atan((159.5 - blob.x) / @focal), bearing, 0.01
      # A pinhole camera shows objects off its axis larger.
      assert_in_delta blob.distance / :math.pow(:math.cos(bearing), 1.5),
                      distance,
                      0.06 * distance
    end
  end

  test "twice the distance gives a quarter of the area" do
    [near] = painted(alone({2.0, 0.0}, noise: :off), :mag1)
    [far] = painted(alone({4.0, 0.0}, noise: :off), :mag1)
    assert_in_delta near.area / far.area, 4.0, 0.4
  end

  test "neither an empty hall nor a landmark behind the camera shows anything" do
    for step <- 1..20, do: assert(painted(%{alone(nil) | step: step}, :mag1) == [])
    assert painted(alone({-3.0, 0.0}), :mag1) == []
  end

  test "the picture is taken with the pan and tilt that the camera has" do
    world = alone({0.0, 3.0}) |> World.look(:mag1, 1.57, 0.2)
    world = Enum.reduce(1..40, world, fn _, world -> World.step(world) end)
    frame = World.frame(world, :mag1)
    assert_in_delta frame.pan, 1.57, 1.0e-6
    assert_in_delta frame.tilt, 0.2, 1.0e-6
    [blob] = painted(world, :mag1)
    assert_in_delta blob.x, 159.5, 2.0
    # Looking up moves objects down.
    [level] = painted(alone({3.0, 0.0}), :mag1)
    assert_in_delta blob.y - level.y, @focal * :math.tan(0.2), 5.0
  end

  test "noise has the spread it should have, and differs from step to step" do
    clean = World.frame(alone({3.0, 0.0}, noise: :off), :mag1).bytes
    noisy = World.frame(alone({3.0, 0.0}), :mag1).bytes
    later = World.frame(%{alone({3.0, 0.0}) | step: 1}, :mag1).bytes
    refute noisy == later

    spread = fn from, count ->
      pairs =
        Enum.zip(:binary.bin_to_list(noisy, from, count), :binary.bin_to_list(clean, from, count))

      :math.sqrt(Enum.sum(for {a, b} <- pairs, abs(a - b) < 15, do: (a - b) * (a - b)) / count)
    end

    assert_in_delta spread.(0, 76_800), 3.0, 0.2
    assert_in_delta spread.(76_800, 38_400), 2.0, 0.2

    salt =
      for {a, b} <- Enum.zip(:binary.bin_to_list(noisy), :binary.bin_to_list(clean)),
          abs(a - b) >= 15,
          do: a

    assert length(salt) in 60..77 and Enum.uniq(Enum.sort(salt)) == [16, 235]
  end

  test "blobs by geometry are those of the blob finder" do
    {:ok, map} = Floorplan.open("hospital", 6)
    ids = for k <- 1..6, do: {:"mag#{k}", 0.2}

    pairs =
      for seed <- 1..25,
          {:ok, poses} = Floorplan.starts(map, ids, seed, {0.0, 0.0}),
          world = World.new!(map: map, seed: seed, landmark: {0.0, 0.0}, robots: robots(poses)),
          {id, _} <- ids do
        direct = World.blobs(world, id)
        painted = painted(world, id)
        # Both in the order of colours, and the largest first.
        for blobs <- [direct, painted],
            do: assert(blobs == Enum.sort_by(blobs, &{&1.colour == "RedRobot", -&1.area}))

        for blob <- painted, blob.area >= 300 do
          twin =
            direct |> Enum.filter(&(&1.colour == blob.colour)) |> Enum.min_by(&abs(&1.x - blob.x))

          assert_in_delta twin.x, blob.x, 2.0
          assert_in_delta twin.y, blob.y, 2.5
          assert twin.clipped? == blob.clipped? or abs(twin.left - blob.left) <= 2
          twin.area / blob.area
        end
      end

    ratios = List.flatten(pairs)
    assert length(ratios) > 50
    assert_in_delta Enum.sum(ratios) / length(ratios), 1.0, 0.03
    assert Enum.count(ratios, &(abs(&1 - 1) < 0.1)) >= 0.95 * length(ratios)
  end

  test "walls hide what is behind them" do
    {:ok, map} = Floorplan.open("hospital", 6)

    world =
      World.new!(
        map: map,
        robots: robots([Pose.new(0, 4), Pose.new(10.5, 4, :math.pi())]),
        landmark: {3.0, 4.0}
      )

    assert [%{colour: "YellowLandmark"}] = World.blobs(world, :mag1)
    assert World.blobs(world, :mag2) == []
    assert painted(world, :mag2) == []

    through_the_door =
      World.displace(world, :mag2, Pose.new(10.5, 0, :math.pi()))
      |> World.place_landmark({3.0, 0.0})

    assert [%{colour: "YellowLandmark"} | _] = painted(through_the_door, :mag2)
  end
end
