defmodule Missions.Landmark.UnsureTest do
  @moduledoc """
  A follower that stands in its slot by its own estimate, but is not sure enough to say so.
  """
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Nav.Grid
  alias Robot.Percept
  alias Swarm.EStop
  alias Missions.Landmark.Reference
  alias Swarm.Membership.Heartbeat
  alias Missions.Landmark
  alias Missions.Landmark.{Follower, Shape}

  @column {:column, 1.0}

  defp percept(fields) do
    plain = %Percept{robot: :mag2, at_ms: 0, profile: Profile.magellan(), peers: %{}}
    odometry = %Odometry{pose: Pose.new(0, 0), twist: Twist.zero()}
    struct!(%{plain | pose: Pose.new(0, 0), odometry: odometry}, fields)
  end

  defp mission(fields) do
    plain = %Landmark.State{me: :mag2, formation: @column, assign: :cost, leader_change?: true}
    struct!(plain, fields)
  end

  # A follower that is never moved, `off` metres from its slot, for `seconds`; it is in its leader's frame.
  defp stand(off, radius, seconds, grid \\ nil),
    do: watch(fn _seconds -> off end, radius, seconds, grid)

  # The same of one that comes nearer: `off` is a function of the seconds. Its wheels turn as it does, or not, or all the time.
  # `swung` is how much nearer its slot is than it was at first.
  defp watch(off, radius, seconds, grid \\ nil, wheels \\ :turn, swung \\ fn _seconds -> 0.0 end) do
    mission = mission(phase: :follow, leader: :mag1, epoch: 1, follower: Follower.new())

    uncertainty = %{
      radius: radius,
      position: radius / 2,
      heading: 0.1,
      frame: {:mag1, nil, 0}
    }

    Enum.reduce(0..(seconds * 10), mission, fn tick, mission ->
      now = tick * 100

      anchor = %Reference{
        leader: :mag1,
        epoch: 1,
        sequence: tick + 1,
        pose: {round((off.(0.0) - swung.(tick / 10)) * 1000) + 1000, 0, 0},
        twist: {0, 0},
        formation: @column,
        order: [:mag2],
        size: 2,
        places: [1],
        landmark: nil,
        still: true
      }

      pose = Pose.new(off.(0.0) - off.(tick / 10), 0)
      driven = %{turn: pose, stand: Pose.new(0, 0), always: Pose.new(tick / 50, 0)}[wheels]

      percept =
        percept(
          at_ms: now,
          pose: pose,
          uncertainty: uncertainty,
          grid: grid,
          odometry: %Odometry{pose: driven, twist: Twist.zero()}
        )

      mission = %{mission | anchor: anchor, anchor_ms: now, percept: percept, now_ms: now}
      {mission, _effects} = Follower.act(mission)
      mission
    end).follower
  end

  # 4 x 4 m about the robot, with a wall across it at this x, if any.
  defp room(wall) do
    cells = for _j <- 0..39, i <- 0..39, into: <<>>, do: if(i == wall, do: <<1>>, else: <<0>>)
    Grid.new(cells, {40, 40}, 0.1, {-2.0, -2.0})
  end

  test "one that stays unsure turns to its leader if no wall is between, and one that is sure does not" do
    assert stand(0.1, 0.62, 3, room(nil)).facing.toward == nil
    assert {_slot, heading} = stand(0.1, 0.62, 5, room(nil)).facing.toward
    assert_in_delta heading, 0.0, 1.0e-6
    assert stand(0.1, 0.3, 5, room(nil)).facing.toward == nil
    # By walls that are not all there are it does not turn round.
    assert stand(0.1, 0.62, 5, %{room(25) | closed?: false}).facing.toward == nil
    # Without walls it would not know whom they hide.
    assert stand(0.1, 0.62, 5).facing.toward == nil
  end

  test "by a floor plan it turns all round, one turn after the other, when there is nothing to look at" do
    toward = fn seconds -> stand(0.1, 0.62, seconds, room(25)).facing.toward end
    assert toward.(3) == nil
    headings = for seconds <- [5, 9, 13, 17], do: elem(toward.(seconds), 1)
    assert headings == [2.1, -2.1, 0.0, 2.1]
  end

  test "it reports unsure, and neither in place nor blocked" do
    assert %{unsure?: true, in_place?: false} = stand(0.1, 0.62, 1)

    assert %{unsure?: true, progress: %{blocked?: false, blocker: nil, late: []}} =
             stand(0.1, 0.62, 30)

    assert %{unsure?: false, in_place?: true} = stand(0.1, 0.3, 1)
  end

  test "a robot that is still on its way, or does not get there, is not unsure" do
    assert %{unsure?: false} = stand(0.6, 0.62, 1)
    assert %{unsure?: false, progress: %{blocked?: true}} = stand(0.6, 0.62, 16)
  end

  test "one on its way that knows its place less well than to a metre is unsure" do
    assert %{unsure?: false} = watch(&(6.0 - 0.2 * &1), 0.9, 1)
    assert %{unsure?: true} = watch(&(6.0 - 0.2 * &1), 1.1, 1)
  end

  test "heartbeats carry the word unsure, and no other value in its place" do
    claim = %{phase: :follow, unsure: true}
    beat = Heartbeat.new({1, 1}, percept([]), {Landmark, claim}, [], EStop.State.new())

    assert beat.claim.fields.unsure and Heartbeat.check(beat) == {:ok, beat}

    for junk <- [nil, 1, "true"],
        do: assert(Heartbeat.check(put_in(beat.claim.fields.unsure, junk)) == :error)
  end

  # What the leader concludes from its followers' reports, long after it began to lead.
  defp squeeze(words) do
    peers =
      for {id, word} <- words, into: %{} do
        claim = Map.merge(%{phase: :follow, standing: true}, word)
        beat = Heartbeat.new({1, 1}, percept([]), {Landmark, claim}, [], EStop.State.new())
        pose = Pose.new(5.0, 5.0)
        twist = Twist.zero()
        {id, %{pose: pose, twist: twist, radius: 0.2, at_ms: 0, mode: :holding, beat: beat}}
      end

    mission =
      mission(
        me: :mag1,
        now_ms: 5_000,
        order: Map.keys(peers),
        percept: percept(peers: Map.new(peers, fn {id, peer} -> {id, %{peer | at_ms: 5_000}} end))
      )

    Shape.update(Shape.new(), mission, 1.6).squeeze
  end

  test "an estimate that comes nearer by less than it may be mistaken by is no progress" do
    off = fn seconds -> Enum.at([0.9, 0.75, 0.6], trunc(seconds / 6)) end
    assert %{progress: %{blocked?: false}} = watch(off, 1.3, 14)
    assert %{progress: %{blocked?: true}, in_place?: false, unsure?: false} = watch(off, 1.3, 16)
    # A robot that is sure has come nearer twice.
    assert %{progress: %{blocked?: false}} = watch(off, 0.1, 16)
  end

  # One that swings past it, as when its leader turns, leaves it nearer to nothing.
  test "a slot that comes nearer by itself is no progress" do
    swung = fn seconds -> if seconds in [6.0, 6.1], do: 0.4, else: 0.0 end
    still = fn _seconds -> 2.5 end
    assert %{progress: %{blocked?: false}} = watch(still, 0.1, 14, nil, :always, swung)
    assert %{progress: %{blocked?: true}} = watch(still, 0.1, 16, nil, :always, swung)
  end

  test "a robot that drives is not blocked, however unsure it is of its place" do
    for seconds <- 1..25,
        do: assert(%{progress: %{blocked?: false}} = watch(&(6.0 - 0.2 * &1), 12.0, seconds))
  end

  test "a robot whose wheels stand is blocked, however its pose is corrected" do
    off = &(3.0 - 0.1 * &1)
    assert %{progress: %{blocked?: false}} = watch(off, 0.1, 14, nil, :stand)
    assert %{progress: %{blocked?: true}} = watch(off, 0.1, 16, nil, :stand)
    assert %{progress: %{blocked?: false}} = watch(off, 0.1, 16)
  end

  test "the shape does not close up for an unsure robot, and closes up for a blocked one in spite of it" do
    assert squeeze(%{mag2: %{in_place: true}, mag3: %{unsure: true}}) == 0
    assert squeeze(%{mag2: %{blocked: true}, mag3: %{in_place: true}}) == 1
    assert squeeze(%{mag2: %{blocked: true}, mag3: %{unsure: true}}) == 1
    assert squeeze(%{mag2: %{blocked: true}, mag3: %{}}) == 0
  end
end
