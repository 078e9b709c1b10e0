defmodule Robot.LocaliserTest do
  use ExUnit.Case, async: true
  doctest Robot.Percept.Sighting
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.{Localiser, Percept}
  alias Robot.Percept.Sighting
  alias Robot.Localiser.{Anchors, Belief}
  alias Vision.{Blob, Detections}

  @view :math.pi() / 3
  @focal 160 / :math.tan(:math.pi() / 6)

  defp percept(odometry, at_ms, blobs \\ nil) do
    %Percept{
      robot: :mag1,
      at_ms: at_ms,
      profile: Profile.magellan(),
      odometry: %Odometry{pose: odometry, twist: Twist.zero()},
      ptz: %{pan: 0.0, tilt: 0.0, field_of_view: @view},
      detections: blobs && %Detections{at_ms: at_ms, blobs: blobs}
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

  @landmark %{
    key: :landmark,
    kind: :landmark,
    colour: "Y",
    at: {4.0, 0.0},
    sd: {0.05, 0.05, 0.0},
    common: {0.0, 0.0},
    reference?: true,
    radius: 0.15
  }
  @leader %{
    key: :mag2,
    kind: :robot,
    colour: "R",
    at: {2.5, 0.8},
    sd: {0.05, 0.05, 0.0},
    common: {0.0, 0.0},
    reference?: true,
    radius: 0.2
  }

  defp told(localiser, marks, frame \\ nil),
    do: Localiser.anchors(localiser, %Anchors{frame: frame, marks: marks})

  defp settle(localiser, truth, anchors, ticks) do
    Enum.reduce(1..ticks, {nil, told(localiser, anchors)}, fn k, {_, localiser} ->
      blobs = [blob("Y", truth, {4.0, 0.0}, 0.15), blob("R", truth, {2.5, 0.8}, 0.2)]
      Localiser.update(localiser, percept(Pose.new(0, 0), 100 * k, blobs))
    end)
  end

  test "a landmark of which a wall hides the most makes a robot no less sure" do
    truth = Pose.new(0, 0)
    {before, localiser} = settle(Localiser.new(truth), truth, [@landmark, @leader], 50)
    whole = blob("Y", truth, {4.0, 0.0}, 0.15)

    for share <- [0.1, 0.3, 0.5] do
      # Its area, and so its distance, is that of the part to the right.
      left = whole.right - round(share * (whole.right - whole.left))
      x = (left + whole.right) / 2
      part = %{whole | left: left, x: x, distance: whole.distance / :math.sqrt(share)}

      {percept, _} =
        Enum.reduce(51..90, {nil, localiser}, fn k, {_, localiser} ->
          Localiser.update(localiser, percept(Pose.new(0, 0), 100 * k, [part]))
        end)

      assert percept.uncertainty.radius <= before.uncertainty.radius + 1.0e-6
      assert Pose.distance(percept.pose, truth) < 0.05
      assert abs(percept.pose.heading) < 0.02
    end
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
    old = %Detections{at_ms: 100, blobs: []}
    again = %{framed.(Pose.new(0, 0), other, 900) | detections: old}
    {percept, sure} = Localiser.update(localiser, again)
    assert percept.pose == before.pose
    assert percept.detections.pose == nil

    assert Anchors.radius(Belief.spread(sure.belief)) >
             Anchors.radius(Belief.spread(localiser.belief)) + 0.3

    {percept, _} = Localiser.update(sure, framed.(Pose.new(0.5, 0), other, 1_000))
    assert percept.pose == Pose.new(4.5, 2)
  end

  test "one that was started anew on its way does not know how sure it was" do
    {put_down, _} = Localiser.update(Localiser.new(Pose.new(0, 0)), percept(Pose.new(0, 0), 0))
    assert put_down.uncertainty.radius < 0.1
    {anew, _} = Localiser.update(Localiser.new(Pose.new(0, 0)), percept(Pose.new(30, 0, 2), 0))
    assert anew.uncertainty.radius > 5.0
  end

  test "without odometry there is no pose" do
    {percept, _} =
      Localiser.update(Localiser.new(Pose.new(0, 0)), %{
        percept(Pose.new(0, 0), 0)
        | odometry: nil
      })

    assert percept.pose == nil
    assert percept.uncertainty == nil
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

  # It is unsure by 5 m and 0.6 rad, two metres from the landmark, and by as much beside where it believes to be.
  test "a robot that is unsure by more than its distance from the landmark is found again by it, honestly" do
    inside =
      for seed <- 1..100 do
        {[x, y, turn], _random} =
          Enum.map_reduce(1..3, :rand.seed_s(:exsss, {seed, 7, 1}), fn _, random ->
            :rand.normal_s(random)
          end)

        truth = Pose.new(30 + 5 * x, 5 * y, 0.6 * turn)
        at = Pose.point(Pose.compose(truth, Pose.new(2.0, 0.3)))
        landmark = %{@landmark | at: at, sd: {0.05, 0.05, 0.0}}
        localiser = told(Localiser.new(Pose.new(0, 0)), [landmark])

        {percept, _localiser} =
          Enum.reduce(1..40, {nil, localiser}, fn k, {_, localiser} ->
            picture = [blob("Y", truth, at, 0.15)]
            Localiser.update(localiser, percept(Pose.new(30, 0), 100 * k, picture))
          end)

        {Pose.distance(percept.pose, truth) <= percept.uncertainty.radius,
         percept.uncertainty.radius < 2.5}
      end

    # One draw in a hundred is so far off that the picture contradicts what it believes.
    assert Enum.count(inside, &elem(&1, 0)) >= 90
    assert Enum.count(inside, &elem(&1, 1)) >= 95
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
    localiser = told(Localiser.new(Pose.new(0, 0)), [@landmark])
    {_, localiser} = Localiser.update(localiser, percept(Pose.new(0, 0, 0.0), 0))
    {_, localiser} = Localiser.update(localiser, percept(Pose.new(0, 0, 0.2), 100))
    blobs = [blob("Y", Pose.new(0, 0), {4.0, 0.0}, 0.15)]
    old = put_in(percept(Pose.new(0, 0, 0.4), 200, blobs).detections.at_ms, 0)
    {percept, localiser} = Localiser.update(localiser, old)
    assert_in_delta percept.pose.heading, 0.4, 1.0e-6
    assert_in_delta percept.detections.pose.heading, 0.0, 1.0e-6
    belief = localiser.belief
    {_, localiser} = Localiser.update(localiser, %{old | at_ms: 201})
    assert localiser.belief == belief
  end

  test "a picture that is younger than the tick before this one is of the way between" do
    localiser = told(Localiser.new(Pose.new(0, 0)), [@landmark])
    {_, localiser} = Localiser.update(localiser, percept(Pose.new(0, 0), 0))
    blobs = [blob("Y", Pose.new(0, 0, 0.1), {4.0, 0.0}, 0.15)]
    now = put_in(percept(Pose.new(0, 0, 0.2), 100, blobs).detections.at_ms, 50)
    {percept, _} = Localiser.update(localiser, now)
    assert_in_delta percept.detections.pose.heading, 0.1, 1.0e-3
    assert_in_delta percept.pose.heading, 0.2, 1.0e-3
  end

  test "a picture of a time before all that is remembered corrects nothing" do
    localiser = told(Localiser.new(Pose.new(0, 0)), [@landmark])
    {_, localiser} = Localiser.update(localiser, percept(Pose.new(0, 0), 1_000))
    blobs = [blob("Y", Pose.new(0, 0, 0.05), {4.0, 0.0}, 0.15)]
    old = put_in(percept(Pose.new(0, 0), 1_100, blobs).detections.at_ms, 900)
    {percept, corrected} = Localiser.update(localiser, old)

    assert percept.detections.pose == nil
    assert corrected.belief == localiser.belief
  end

  test "its own frame is another one when it begins to be corrected anew, or is started anew" do
    number = fn {percept, _localiser} -> percept.uncertainty.frame_no end
    tick = &Localiser.update(&1, percept(Pose.new(0, 0), &2))
    {_, localiser} = started = tick.(Localiser.new(Pose.new(0, 0)), 7_000)
    assert number.(started) == 7_000
    {_, localiser} = one = localiser |> told([@landmark]) |> tick.(7_100)
    assert number.(one) == 7_001
    {_, localiser} = same = localiser |> told([@landmark, @leader]) |> tick.(7_200)
    assert number.(same) == 7_001
    {_, localiser} = leading = localiser |> told([]) |> tick.(7_300)
    assert number.(leading) == 7_001
    assert number.(localiser |> told([@landmark]) |> tick.(7_400)) == 7_002
  end

  test "nothing is said of the distance of what is hidden in part" do
    yellow = blob("Y", Pose.new(0, 0), {4.0, 0.0}, 0.15)
    assert Sighting.distance(yellow, [yellow]) == 4.0
    red = %{yellow | colour: "R", top: 170, bottom: 230}
    assert Sighting.distance(yellow, [yellow, red]) == nil
    assert Sighting.distance(%{yellow | clipped?: true}, [yellow]) == nil
  end

  test "however often they are seen, they make nobody surer than their places are known" do
    {percept, _} =
      settle(Localiser.new(Pose.new(0, 0)), Pose.new(0, 0), [@landmark, @leader], 1_000)

    sure = percept.uncertainty.radius
    unknown = for mark <- [@landmark, @leader], do: %{mark | sd: {0.3, 0.3, 0.0}}
    {percept, _} = settle(lost(0.5), Pose.new(0, 0), unknown, 1_000)
    assert percept.uncertainty.radius > 0.3
    assert sure < 0.1
    assert percept.uncertainty.frame == :elsewhere
  end

  # Put into the frame of somebody who does not know where it is itself.
  defp lost(sd) do
    {_, localiser} = Localiser.update(Localiser.new(Pose.new(0, 0)), percept(Pose.new(0, 0), 0))
    told(localiser, [], frame(:elsewhere, {2.5, 0.8}, sd * sd, 0.0))
  end

  defp frame(key, at, position, heading, options \\ []) do
    Map.merge(
      %{
        key: key,
        base: nil,
        at: at,
        position: position,
        heading: heading,
        start: {position, heading},
        drift: {0.0, 0.0, 0.0},
        slip: 0.0
      },
      Map.new(options)
    )
  end

  @there {10.0, 0.0}

  test "in another's frame a robot is as unsure as that one is, and then by what that one drifts" do
    {before, localiser} =
      Localiser.update(Localiser.new(Pose.new(0, 0)), percept(Pose.new(0, 0), 0))

    assert before.uncertainty.frame == nil
    tick = fn localiser, at_ms -> Localiser.update(localiser, percept(Pose.new(0, 0), at_ms)) end
    come = fn localiser, frame -> localiser |> told([], frame) |> tick.(100) end
    sd = fn percept -> percept.uncertainty.position end

    # 10 m from somebody who may be turned by 0.1 rad: 1 m across.
    {joined, localiser} = come.(localiser, frame({:mag2, 1}, @there, 0.04, 0.01))
    assert_in_delta sd.(joined), :math.sqrt(1.0 + 0.04), 0.01
    assert_in_delta joined.uncertainty.heading, 0.1, 0.01
    assert joined.uncertainty.frame == {:mag2, 1}
    assert joined.pose == before.pose

    # Told again it is no news, however unsure of its own pose that one has become on its way; drift is.
    {same, localiser} = come.(localiser, frame({:mag2, 1}, @there, 0.5, 0.02))
    as_sure = &Map.take(&1.uncertainty, [:radius, :position, :heading, :frame, :frame_no])
    assert as_sure.(same) == as_sure.(joined)
    drifted = frame({:mag2, 1}, @there, 0.5, 0.02, drift: {0.02, 0.01, 0.0})
    {more, localiser} = come.(localiser, drifted)
    assert_in_delta sd.(more), :math.sqrt(2.0 + 0.06), 0.01

    # It cannot drift back; if it says so, it was started anew.
    {anew, _} = come.(localiser, frame({:mag2, 1}, @there, 0.01, 0.0))
    assert anew.uncertainty.frame_no == 2
    assert sd.(anew) > sd.(more) + 0.5

    # One who was in the frame of mag2 leads: that it is unsure of there. Then mag2 again: that is what was unsure.
    {other, localiser} = come.(localiser, frame({:mag3, 2}, @there, 0.0, 0.01, base: {:mag2, 1}))

    assert_in_delta sd.(other), :math.sqrt(3.0 + 0.06), 0.01
    assert %{frame: {:mag3, 2}, frame_no: 2} = other.uncertainty
    {back, localiser} = come.(localiser, drifted)
    assert_in_delta sd.(back), :math.sqrt(4.0 + 0.06), 0.01

    # Of a frame that nothing is known of, all is unsure that is unsure of both.
    {strange, _} = come.(localiser, frame({:min1, 7}, @there, 0.0, 0.01, base: {:min2, 3}))
    # And by how much each of the arcs so far bends.
    bend = 0.75 * 100 * (3 * 0.01 * 0.01 + 0.01 * 0.01 + 0.03 * 0.03)
    assert_in_delta sd.(strange), :math.sqrt(4.0 + 0.06 + 0.5 + 3.0 + bend), 0.01
  end

  test "a robot at the end of a column knows its direction at most twice as well as those ahead of it" do
    {_, localiser} = Localiser.update(Localiser.new(Pose.new(0, 0)), percept(Pose.new(0, 0), 0))
    ahead = %{@leader | key: :mag3, at: {5.0, 0.0}, sd: {0.2, 0.05, :math.pi() / 2}}
    frame = frame({:mag2, 1}, @there, 0.0, 0.0)

    radius = fn marks ->
      {seen, _} =
        localiser |> told(marks, frame) |> Localiser.update(percept(Pose.new(0, 0), 100))

      seen.uncertainty.radius
    end

    # 0.2 m across at 5 m from the leader are 0.4 m at 10 m.
    assert_in_delta radius.([ahead]), Anchors.radius({0.4 / 2, 0.03, 0.0}), 0.01
    assert radius.([]) < 0.15
    # What is not a reference tells nothing, nor does one beside the leader.
    assert radius.([%{ahead | reference?: false}]) < 0.15
    assert radius.([%{ahead | at: {9.0, 0.0}}]) < 0.15
    # One that claims to know better does not make up for the other.
    better = %{ahead | key: :mag4, at: {8.0, 0.0}, sd: {0.02, 0.02, 0.0}}
    assert radius.([ahead, better]) == radius.([ahead])
  end

  test "a leader that slips turns its followers by as much in each radian, and they find out by what they see" do
    truth = fn turned -> Pose.new(0, 0, -0.05 * turned) end
    {_, localiser} = Localiser.update(Localiser.new(Pose.new(0, 0)), percept(Pose.new(0, 0), 0))
    frame = &frame({:mag2, 1}, {0.0, 0.0}, 0.0, 0.0, slip: 0.055, drift: {0.0, 0.0, &1})
    heading = fn percept -> percept.uncertainty.heading end

    # By twice the angle it is twice as unsure: a bias, and no walk.
    after_turn = fn turned ->
      {percept, _} =
        localiser
        |> told([], frame.(0.0))
        |> told([], frame.(turned))
        |> Localiser.update(percept(Pose.new(0, 0), 100))

      assert percept.pose == Pose.new(0, 0)
      percept
    end

    assert_in_delta heading.(after_turn.(4.0)), :math.sqrt(0.22 * 0.22 + 0.0004), 0.01
    assert_in_delta heading.(after_turn.(8.0)), :math.sqrt(0.44 * 0.44 + 0.0004), 0.01

    # It slips by 5 in 100: what stands still is seen to turn in its frame.
    localiser =
      Enum.reduce(1..100, told(localiser, [], frame.(0.0)), fn k, localiser ->
        turned = k * 0.1
        blobs = [blob("Y", truth.(turned), {4.0, 0.0}, 0.15)]
        localiser = told(localiser, [@landmark], frame.(turned))
        {_, localiser} = Localiser.update(localiser, percept(Pose.new(0, 0), 100 * k, blobs))
        localiser
      end)

    assert_in_delta localiser.belief.leader_slip, 0.05, 0.005
    assert_in_delta localiser.belief.pose.heading, truth.(10.0).heading, 0.02
  end

  test "what was learnt of a thing in one frame is forgotten in another" do
    told_wrong = %{@landmark | at: {4.0, 0.3}, sd: {0.3, 0.3, 0.0}}
    {_, localiser} = settle(Localiser.new(Pose.new(0, 0)), Pose.new(0, 0), [told_wrong], 50)
    assert [%{key: :landmark}] = localiser.belief.marks
    joined = told(localiser, [told_wrong], frame({:mag3, 1}, {0.0, 0.0}, 0.04, 0.01))
    assert joined.belief.marks == []
  end

  test "wheels that slip are found out by what stands still, and then turn it no more" do
    # It turns to and fro by 0.5 rad; each turn to the left goes 5 % farther, each to the right less far.
    turns = List.duplicate(0.1, 5) ++ List.duplicate(-0.1, 5)
    localiser = told(Localiser.new(Pose.new(0, 0)), [@landmark])
    {_, localiser} = Localiser.update(localiser, percept(Pose.new(0, 0), 0))
    state = {Pose.new(0, 0), Pose.new(0, 0), localiser}

    {truth, _wheels, localiser} =
      turns
      |> List.duplicate(20)
      |> List.flatten()
      |> Enum.with_index(1)
      |> Enum.reduce(state, fn {turn, k}, {truth, wheels, localiser} ->
        truth = Pose.compose(truth, Pose.new(0, 0, turn + 0.05 * abs(turn)))
        wheels = Pose.compose(wheels, Pose.new(0, 0, turn))
        blobs = [blob("Y", truth, {4.0, 0.0}, 0.15)]
        {_, localiser} = Localiser.update(localiser, percept(wheels, 100 * k, blobs))
        {truth, wheels, localiser}
      end)

    assert_in_delta localiser.belief.slip, 0.05, 0.01
    assert abs(Pose.wrap(localiser.belief.pose.heading - truth.heading)) < 0.02
  end
end
