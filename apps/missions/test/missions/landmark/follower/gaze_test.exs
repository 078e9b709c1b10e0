defmodule Missions.Landmark.Follower.GazeTest do
  @moduledoc "Where a follower looks: around itself for what its leader has lost, and at what it has found."
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Missions.Landmark
  alias Missions.Landmark.{Beat, Follower, LandmarkTrack}
  alias Missions.Landmark.Follower.Gaze
  alias Robot.Percept

  @slot Pose.new(0, 0)

  # A follower in its slot, first or second in the order, whose leader ahead of it sees the landmark or does not.
  defp mission(me, sight, fields \\ []) do
    beat = Beat.new(leader: :mag1, phase: :lead, epoch: 1, sight: sight)

    percept = %Percept{
      robot: me,
      at_ms: 0,
      profile: Profile.magellan(),
      pose: @slot,
      peers: %{mag1: %{at_ms: 0, beat: beat, pose: Pose.new(1, 0)}}
    }

    struct!(
      %Landmark.State{
        me: me,
        formation: {:column, 1.0},
        assign: :cost,
        leader_change?: true,
        phase: :follow,
        leader: :mag1,
        anchor: %{Beat.anchor([:mag2, :mag3], {2_500, 0}) | pose: {1_000, 0, 0}},
        anchor_ms: 0,
        percept: percept,
        follower: Follower.new()
      },
      fields
    )
  end

  # The slot's heading and the pan, so long after the leader has lost the landmark.
  defp after_ms(me, ms, fields \\ []) do
    mission = mission(me, nil, fields)
    gaze = Gaze.note(%Gaze{}, mission, true)
    peers = put_in(mission.percept.peers.mag1.at_ms, ms).percept.peers
    mission = %{mission | now_ms: ms, percept: %{mission.percept | peers: peers}}
    gaze = Gaze.note(gaze, mission, true)
    mission = put_in(mission.follower.gaze, gaze)
    {Gaze.turned(gaze, mission, @slot).heading, Gaze.pan(mission, Pose.new(1, 0))}
  end

  test "as long as its leader sees the landmark, it turns nowhere, and looks ahead" do
    seen = mission(:mag2, %{size_ppm: 9_000, distance: 1_500})
    gaze = Gaze.note(%Gaze{}, seen, true)
    assert gaze.lost_ms == nil
    assert Gaze.turned(gaze, seen, @slot) == @slot
    assert Gaze.pan(seen, Pose.new(1, 0)) == 0.0
  end

  test "for what its leader has lost it looks to one side and the other, the next robot the other way round" do
    limit = Profile.magellan().camera.max_pan

    for {me, side} <- [mag2: 1, mag3: -1] do
      {heading, pan} = after_ms(me, 1_000)
      assert_in_delta heading, side * 1.4, 1.0e-9
      assert_in_delta pan, side * limit, 1.0e-9
      {heading, pan} = after_ms(me, 4_000)
      assert_in_delta heading, -side * 0.7, 1.0e-9
      assert_in_delta pan, -side * limit, 1.0e-9
      # The body has turned once, the camera goes on.
      {heading, pan} = after_ms(me, 7_000)
      assert heading == 0.0
      assert_in_delta pan, side * limit, 1.0e-9
    end
  end

  test "the two looks of one robot leave no direction out" do
    half = Profile.magellan().camera.field_of_view / 2

    seen =
      for ms <- [1_000, 4_000] do
        {heading, pan} = after_ms(:mag2, ms)
        heading + pan
      end

    # It pans through all between them, ahead of it.
    [left, right] = seen
    assert left + half - (right - half) >= 2 * :math.pi()
  end

  test "one that is on its way does not look around" do
    assert Gaze.note(%Gaze{}, mission(:mag2, nil), false) == %Gaze{}
  end

  test "what it has found elsewhere stays in its picture, and it stands" do
    sight = %LandmarkTrack{at_ms: 1_000, size_ppm: 9_000, bearing: 1.2, place: {0.4, 1.0}}
    {heading, pan} = after_ms(:mag2, 1_000, sight: sight)
    assert heading == 0.0
    assert_in_delta pan, 1.2, 1.0e-9
  end
end
