defmodule Robot.LocaliserTest do
  use ExUnit.Case, async: true
  doctest Robot.Sighting
  doctest Robot.Localiser.Belief
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.{Localiser, Percept, Sighting}
  alias Vision.Blob

  @view :math.pi() / 3
  @focal 160 / :math.tan(:math.pi() / 6)

  defp percept(odometry, at_ms, blobs \\ nil) do
    %Percept{
      robot: :mag1,
      at_ms: at_ms,
      profile: Profile.magellan(),
      odometry: %Odometry{pose: odometry, twist: Twist.zero()},
      ptz: %{pan: 0.0, tilt: 0.0, field_of_view: @view},
      blobs: blobs,
      blobs_at_ms: blobs && at_ms
    }
  end

  # What a camera at `pose` sees of a pole: painted by the same pinhole, from the outside.
  defp blob(colour, pose, place, radius) do
    bearing = Pose.bearing(pose, place)
    distance = Pose.distance(pose, place)
    x = 159.5 - @focal * :math.tan(bearing)
    half = @focal * radius / distance

    %Blob{
      colour: colour,
      area: 500,
      share: 0.0065,
      x: x,
      y: 120.0,
      left: max(round(x - half), 0),
      right: round(x + half) - 1,
      top: 60,
      bottom: 180,
      width: 320,
      height: 240,
      distance: distance
    }
  end

  @landmark %{colour: "Y", at: {4.0, 0.0}, sd: 0.05, range?: true, radius: nil}
  @leader %{colour: "R", at: {2.5, 0.8}, sd: 0.05, range?: false, radius: 0.2}

  defp settle(localiser, truth, anchors, ticks) do
    Enum.reduce(1..ticks, {nil, Localiser.anchors(localiser, anchors)}, fn k, {_, localiser} ->
      blobs = [blob("Y", truth, {4.0, 0.0}, 0.15), blob("R", truth, {2.5, 0.8}, 0.2)]
      Localiser.update(localiser, percept(Pose.new(0, 0), 100 * k, blobs))
    end)
  end

  test "without references the pose is the odometry's, from the start pose" do
    localiser = Localiser.new(Pose.new(1, 2, :math.pi() / 2))
    {percept, localiser} = Localiser.update(localiser, percept(Pose.new(0, 0), 0))
    assert percept.pose == Pose.new(1, 2, :math.pi() / 2)
    {percept, _} = Localiser.update(localiser, percept(Pose.new(1, 0.5, 0.1), 100))
    assert_in_delta percept.pose.x, 0.5, 1.0e-9
    assert_in_delta percept.pose.y, 3.0, 1.0e-9
    assert_in_delta percept.pose.heading, :math.pi() / 2 + 0.1, 1.0e-9
  end

  test "odometry that begins again at zero in another frame takes the robot nowhere" do
    framed = fn pose, frame, at_ms -> put_in(percept(pose, at_ms).odometry.frame, frame) end
    [one, other] = [make_ref(), make_ref()]
    localiser = Localiser.new(Pose.new(1, 2))
    {_, localiser} = Localiser.update(localiser, framed.(Pose.new(0, 0), one, 0))
    {before, localiser} = Localiser.update(localiser, framed.(Pose.new(3, 0), one, 100))
    assert before.pose == Pose.new(4, 2)

    # Its blobs are of a time that only poses of the old frame could tell of.
    again = %{framed.(Pose.new(0, 0), other, 900) | blobs: [], blobs_at_ms: 100}
    {percept, sure} = Localiser.update(localiser, again)
    assert percept.pose == before.pose
    assert percept.blobs_pose == before.pose
    assert elem(sure.belief.covariance, 0) > elem(localiser.belief.covariance, 0)

    {percept, _} = Localiser.update(sure, framed.(Pose.new(0.5, 0), other, 1_000))
    assert percept.pose == Pose.new(4.5, 2)
  end

  test "without odometry there is no pose" do
    {percept, _} =
      Localiser.update(Localiser.new(Pose.new(0, 0)), %{
        percept(Pose.new(0, 0), 0)
        | odometry: nil
      })

    assert percept.pose == nil
  end

  test "what agrees with the references stays" do
    {percept, _} = settle(Localiser.new(Pose.new(0, 0)), Pose.new(0, 0), [@landmark, @leader], 50)
    assert Pose.distance(percept.pose, {0.0, 0.0}) < 0.01
    assert abs(percept.pose.heading) < 0.01
  end

  test "a wrong estimate is turned until both references are where they are seen" do
    for _ <- 1..50 do
      truth = Pose.new(0.1 * (:rand.uniform() - 0.5), 0.1 * (:rand.uniform() - 0.5), 0.0)
      believed = Pose.new(0, 0, 0.08 * (:rand.uniform() - 0.5))
      localiser = Localiser.new(believed)
      # Odometry that has driven a little admits an error of its own.
      {_, localiser} = Localiser.update(localiser, percept(Pose.new(-2, 0, 1), 0))
      {_, localiser} = Localiser.update(localiser, percept(Pose.new(0, 0), 1))
      {percept, _} = settle(localiser, truth, [@landmark, @leader], 80)

      # Both are seen where they are expected: that much two bearings tell.
      for %{at: place} <- [@landmark, @leader] do
        error = Pose.bearing(percept.pose, place) - Pose.bearing(truth, place)
        assert abs(error) < 0.015
      end
    end
  end

  test "an estimate that pictures contradict for long is found again" do
    localiser = Localiser.new(Pose.new(0, 0, 0.5))
    {percept, _} = settle(localiser, Pose.new(0, 0), [@landmark], 100)
    assert abs(percept.pose.heading) < 0.25
  end

  test "a robot of the wrong size is not taken for the one that is expected" do
    thin = %{@leader | radius: 0.5}
    localiser = Localiser.new(Pose.new(0, 0, 0.1))
    {with_it, _} = settle(localiser, Pose.new(0, 0), [thin], 30)
    assert_in_delta with_it.pose.heading, 0.1, 1.0e-9
  end

  test "a picture is counted once, and by where the robot stood when it was taken" do
    localiser = Localiser.anchors(Localiser.new(Pose.new(0, 0)), [@landmark])
    {_, localiser} = Localiser.update(localiser, percept(Pose.new(0, 0, 0.0), 0))
    {_, localiser} = Localiser.update(localiser, percept(Pose.new(0, 0, 0.2), 100))
    blobs = [blob("Y", Pose.new(0, 0), {4.0, 0.0}, 0.15)]
    old = %{percept(Pose.new(0, 0, 0.4), 200, blobs) | blobs_at_ms: 0}
    {percept, localiser} = Localiser.update(localiser, old)
    assert_in_delta percept.pose.heading, 0.4, 1.0e-6
    assert_in_delta percept.blobs_pose.heading, 0.0, 1.0e-6
    belief = localiser.belief
    {_, localiser} = Localiser.update(localiser, %{old | at_ms: 201})
    assert localiser.belief == belief
  end

  test "nothing is said of the distance of what is hidden in part" do
    yellow = blob("Y", Pose.new(0, 0), {4.0, 0.0}, 0.15)
    assert Sighting.distance(yellow, [yellow]) == 4.0
    red = %{yellow | colour: "R", top: 170, bottom: 230}
    assert Sighting.distance(yellow, [yellow, red]) == nil
    assert Sighting.distance(%{yellow | clipped?: true}, [yellow]) == nil
  end
end
