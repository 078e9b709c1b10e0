defmodule Missions.Landmark.BlindTest do
  @moduledoc "A robot without pictures among others."
  use ExUnit.Case, async: true
  alias Hal.{Pose, Profile}
  alias Missions.Landmark
  alias Missions.Landmark.{Beat, Group, LandmarkTrack, Reference}
  alias Missions.Landmark.Follower.Guide
  alias Robot.Percept

  @robots [:mag1, :mag2, :mag3]

  test "it goes to the end of the order, behind whom nobody finds its place by it, and stays there" do
    group =
      Group.new()
      |> Group.join(:mag1, {0, 0}, 0.02)
      |> Group.join(:mag2, {-1, 0}, nil)
      |> Group.join(:mag3, {-2, 0}, nil)

    {true, group} = Group.until(group, 20, &Group.one?(&1, @robots))
    order = fn group -> group.robots.mag1.mission.order end
    group = Group.run(group, 2)
    assert order.(group) == [:mag2, :mag3]

    group = group |> Group.show(:mag2, :dark) |> Group.run(4)
    assert order.(group) == [:mag2, :mag3]
    group = Group.run(group, 2)
    assert group.robots.mag2.claim.blind
    assert order.(group) == [:mag3, :mag2]

    group = group |> Group.show(:mag2, nil) |> Group.run(3)
    refute group.robots.mag2.claim.blind
    assert order.(group) == [:mag3, :mag2]
  end

  describe "another one tells it where it stands" do
    # mag3 in its slot at -2, 0 of a column, mag2 without pictures in the last one; `blobs` are columns of mag3's picture,
    # which shows what is behind it.
    defp guide(blobs, options \\ []) do
      others = Keyword.get(options, :others, [])
      claim = Keyword.get(options, :claim, in_place: false, unsure: true, blind: true)
      order = [:mag3 | Keyword.keys(others)] ++ [:mag2]

      anchor = %Reference{
        leader: :mag1,
        epoch: 1,
        sequence: 1,
        pose: {0, 0, 0},
        twist: {0, 0},
        formation: {:column, 1.0},
        order: order,
        size: length(order) + 1,
        places: Enum.to_list(1..length(order))
      }

      {_phase, mission, []} = Landmark.init(:mag3, [])

      Enum.reduce(1..12, %Guide{}, fn n, guide ->
        peers =
          for {id, at, claim} <- [{:mag2, {-2.0, 0.0}, claim}] ++ others(others), into: %{} do
            beat = Beat.new([phase: :follow, leader: :mag1, epoch: 1] ++ claim)

            {id,
             %{at_ms: 100 * n, beat: beat, pose: Pose.new(elem(at, 0), elem(at, 1)), radius: 0.2}}
          end

        percept = %Percept{
          robot: :mag3,
          at_ms: 100 * n,
          profile: Profile.magellan(),
          pose: Pose.new(-1, 0, :math.pi()),
          uncertainty: %{position: 0.03, heading: 0.02},
          peers: peers,
          detections: %Vision.Detections{
            at_ms: 100 * n,
            pose: Pose.new(-1, 0, :math.pi()),
            pan: 0.0,
            blobs: Enum.map(blobs, &blob/1)
          }
        }

        mission = %{mission | phase: :follow, anchor: anchor, percept: percept, now_ms: 100 * n}

        Guide.note(guide, mission, true)
        |> tap(&send(self(), {:sees, Guide.sees(put_in(mission.follower.guide, &1))}))
      end)

      receive_last(nil)
    end

    defp others(others), do: for({id, {at, claim}} <- others, do: {id, at, claim})

    defp receive_last(last) do
      receive do
        {:sees, sees} -> receive_last(sees)
      after
        0 -> last
      end
    end

    defp blob({left, right}) do
      %Vision.Blob{
        colour: "RedRobot",
        area: 9_000,
        share: 0.1,
        x: (left + right) / 2,
        y: 120.0,
        left: left,
        right: right,
        top: 60,
        bottom: 239,
        width: 320,
        height: 240,
        clipped?: true
      }
    end

    # As wide as a robot at 1 m.
    @ahead {103, 216}

    test "once it has seen it in eight pictures, where nobody else is" do
      assert {:mag2, {x, y}, sd} = guide([@ahead])
      assert_in_delta x, -2_000, 300
      assert_in_delta y, 0, 20
      assert sd in 50..300
    end

    test "not by a blob at the border, nor by one of two, nor where another robot stands, nor of one that is sure" do
      assert guide([{0, 100}]) == nil
      assert guide([]) == nil
      assert guide([{60, 130}, {190, 260}]) == nil
      assert guide([@ahead], others: [mag4: {{-2.0, 0.2}, [in_place: true]}]) == nil
      assert guide([@ahead], claim: [in_place: true, unsure: false, blind: true]) == nil
      assert guide([@ahead], claim: [in_place: false, unsure: true, blind: false]) == nil
    end

    test "not as long as another one does not know where it is, either: they look alike" do
      lost = [in_place: false, unsure: true, blind: true]
      assert guide([@ahead], others: [mag4: {{-3.0, 0.0}, lost}]) == nil
    end
  end

  test "a camera that is late for less than 5 s is none that is dark" do
    assert [false, false, true] = for(ms <- [0, 4_900, 5_000], do: LandmarkTrack.blind?(0, ms))
    refute LandmarkTrack.blind?(nil, 10_000)
  end
end
