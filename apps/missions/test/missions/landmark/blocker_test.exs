defmodule Missions.Landmark.BlockerTest do
  @moduledoc """
  Which blocker a follower names when it does not get to its slot, and when it says so.
  """
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.Percept
  alias Swarm.EStop
  alias Missions.Landmark.Reference
  alias Swarm.Membership.Heartbeat
  alias Missions.Landmark
  alias Missions.Landmark.{Blocker, Follower}

  doctest Blocker

  defp peer(x, y), do: %{pose: Pose.new(x, y), radius: 0.2, mode: :holding, twist: Twist.zero()}

  defp percept(fields) do
    plain = %Percept{robot: :mag2, at_ms: 0, profile: Profile.magellan(), peers: %{}}
    odometry = %Odometry{pose: Pose.new(0, 0), twist: Twist.zero()}
    struct!(%{plain | pose: Pose.new(0, 0), odometry: odometry}, fields)
  end

  # Something this far in front of all sonars that look ahead.
  defp wall(metres) do
    for %Pose{heading: heading} <- Profile.magellan().sonars,
        do: if(abs(Pose.wrap(heading)) < 0.3, do: metres, else: 5.0)
  end

  test "a blocker in the slot is named before one on the way, and distant things are not named" do
    slot = Pose.new(3.0, 0.0)
    robots = %{mag1: peer(1.0, 0.1), mag3: peer(3.1, 0.0), min1: peer(1.0, 2.0)}
    find = fn peers, landmark -> Blocker.find(percept(peers: peers), slot, landmark) end
    assert find.(robots, {0.5, 0.0}) == {:robot, :mag3}
    assert find.(Map.delete(robots, :mag3), {0.5, 0.0}) == :landmark
    assert find.(Map.delete(robots, :mag3), {-0.5, 0.0}) == {:robot, :mag1}
    assert find.(Map.take(robots, [:min1]), {3.0, 0.4}) == :landmark
    assert find.(%{}, nil) == :no_way
    # Only the first 1.5 m of the way are checked.
    assert find.(%{mag1: peer(2.2, 0.0)}, nil) == :no_way
  end

  test "what only the sonars see is unknown, unless it is known" do
    slot = Pose.new(2.0, 0.0)
    assert Blocker.find(percept(sonar: wall(0.5)), slot, nil) == :unknown
    known = %{mag1: peer(0.87, 0.0)}
    assert Blocker.find(percept(sonar: wall(0.5), peers: known), slot, nil) == {:robot, :mag1}
  end

  # A follower that is never moved, with its slot `metres` behind it, for `seconds`.
  defp stand(metres, seconds, landmark, tremble \\ 0) do
    mission = %Landmark.State{
      me: :mag2,
      formation: {:column, 1.0},
      assign: :cost,
      leader_change?: true,
      phase: :follow,
      leader: :mag1,
      epoch: 1,
      follower: Follower.new()
    }

    sure = %{radius: 0.1, position: 0.05, heading: 0.02, frame: {:mag1, nil, 0}}

    Enum.reduce(0..(seconds * 10), mission, fn tick, mission ->
      now = tick * 100
      aside = if rem(tick, 50) < 25, do: tremble, else: -tremble

      anchor = %Reference{
        leader: :mag1,
        epoch: 1,
        sequence: tick + 1,
        pose: {round(metres * 1000) + 1000, aside, 0},
        twist: {0, 0},
        formation: {:column, 1.0},
        order: [:mag2],
        size: 2,
        places: [1],
        landmark: landmark,
        still: true
      }

      percept = percept(at_ms: now, uncertainty: sure)
      mission = %{mission | anchor: anchor, anchor_ms: now, percept: percept, now_ms: now}
      {mission, _effects} = Follower.act(mission)
      mission
    end)
  end

  test "a follower that gets no nearer for 15 s is blocked, wherever it is, and names the blocker" do
    refute stand(3.0, 14, nil).follower.progress.blocked?
    assert %{blocked?: true, blocker: :no_way} = stand(3.0, 16, nil).follower.progress
    assert %{blocked?: true, blocker: :landmark} = stand(3.0, 16, {500, 0}).follower.progress
  end

  test "a slot that trembles by decimetres does not hide the block" do
    assert %{blocked?: true, blocker: :landmark} = stand(3.0, 16, {500, 0}, 150).follower.progress
  end

  test "a follower in its place is not blocked" do
    assert %{progress: %{blocked?: false, blocker: nil}, in_place?: true} =
             stand(0.1, 30, nil).follower
  end

  test "heartbeats say that a robot is blocked, but not by what" do
    claim = %{phase: :follow, blocked: true, blocked_by: :landmark}
    beat = Heartbeat.new({1, 1}, percept([]), {Landmark, claim}, [], EStop.State.new())
    assert beat.claim.fields.blocked and Heartbeat.check(beat) == {:ok, beat}
    refute is_map_key(beat.claim.fields, :blocked_by)
  end
end
