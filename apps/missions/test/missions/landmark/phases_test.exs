defmodule Missions.Landmark.PhasesTest do
  @moduledoc "Each exit of the table, reached by events."
  use ExUnit.Case, async: true
  alias Robot.Localiser.Anchors
  alias Missions.Landmark.{Beat, Group, Reference}
  alias Swarm.Message
  alias Swarm.Agreement.Round
  alias Missions.Landmark
  alias Missions.Landmark.{LandmarkTrack, Transitions}

  # One robot that is fed by hand; peers send `beat` as long as the test says so.
  defp alone(share), do: Group.new() |> Group.join(:mag2, {0, 0}, share) |> Group.run(0.1)
  defp phase(group), do: group.robots.mag2.mission.phase
  defp mission(group), do: group.robots.mag2.mission

  # The phases that it went through, newest first, without those before.
  defp entered(group, before),
    do:
      Enum.take(
        group.robots.mag2.phases,
        length(group.robots.mag2.phases) - length(before.robots.mag2.phases)
      )

  defp beat(group, id, fields) do
    fields = Keyword.put_new(fields, :phase, :search)
    plain = [sequence: group.now, pose: {3000, 0, 0}]
    Group.hear(group, :mag2, id, Message.new(id, :heartbeat, Beat.new(plain ++ fields)))
  end

  # Time passes while another robot sends this heartbeat five times a second.
  defp beside(group, id, fields, seconds) do
    Enum.reduce(1..round(seconds * 10), group, fn _, group ->
      group |> beat(id, fields) |> Group.run(0.1)
    end)
  end

  defp anchor(group, epoch, order) do
    %Reference{
      leader: :mag1,
      epoch: epoch,
      sequence: group.now,
      pose: {3000, 0, 0},
      twist: {0, 0},
      formation: {:column, 1.0},
      order: order,
      size: length(order) + 1,
      places: Enum.to_list(1..length(order)//1)
    }
  end

  defp place(group, epoch, order \\ [:mag2]),
    do:
      Group.event(
        group,
        :mag2,
        {:message, Beat.pass_on(:mag1, anchor(group, epoch, order))}
      )

  defp letter(group, id, purpose, fields \\ []) do
    letter = %Round.Letter{id: id, view: [:mag1, :mag2], remaining_ms: 5_000, purpose: purpose}
    message = Message.new(:mag1, :round, struct!(letter, fields))
    Group.event(group, :mag2, {:message, message})
  end

  defp following(epoch \\ 1) do
    group = alone(nil) |> place(epoch) |> Group.run(0.1)
    assert phase(group) == :follow
    group
  end

  # Nobody sees the landmark, until the robot rests.
  defp to(wanted, share \\ nil) do
    {there?, group} = Group.until(alone(share), 60, &(phase(&1) == wanted))
    assert there?
    group
  end

  defp stopped(group), do: update_in(group.robots.mag2.mission, &Landmark.halted/1)

  test "a mission can be stopped in every phase: it is idle then, and starts again" do
    assert {:idle, mission, []} = Landmark.init(:mag2, [])
    assert mission.phase == :idle
    assert phase(alone(nil)) == :search

    for group <- [alone(nil), to(:agree), to(:wander), to(:rest), to(:lead, 0.02), following()] do
      stopped = stopped(group)
      assert %{phase: :idle, started?: false, formation: formation} = mission(stopped)
      assert formation == mission(group).formation
      stood = Group.run(stopped, 0.1)
      assert phase(stood) == :idle
      assert %{goal: {:stand, {Robot.Behaviour.Stop, []}}} = stood.robots.mag2
      again = stopped |> Group.event(:mag2, {:command, :start}) |> Group.run(0.1)
      assert :search in entered(again, stopped)
    end
  end

  test "search -> agree when scanned, wander or rest when nobody found it" do
    {_, group} = Group.until(alone(nil), 60, &(phase(&1) == :rest))

    assert Enum.reverse(group.robots.mag2.phases) ==
             [:idle, :search, :agree, :wander, :search, :agree, :wander, :search, :agree, :rest]
  end

  test "agree -> lead when elected" do
    group = to(:lead, 0.02)
    assert [:lead, :agree | _] = group.robots.mag2.phases
  end

  test "led: from search, agree, wander and rest to follow" do
    for from <- [:search, :agree, :wander, :rest] do
      group = to(from) |> place(7) |> Group.run(0.1)
      assert [:follow, ^from | _] = group.robots.mag2.phases
      assert %{leader: :mag1, epoch: 7} = mission(group)
      # But not if the anchor is old, or names somebody else.
      assert phase(to(from) |> place(7, [:mag3]) |> Group.run(0.1)) != :follow
    end
  end

  test "search -> wander, rest, lead or follow if a round ends during the scan" do
    # The scan takes too long: the round's deadline is reached during it.
    for {verdict, tries, next} <- [
          {:nobody, 0, :wander},
          {:nobody, 2, :rest},
          {{:leader, :mag2}, 0, :lead},
          {{:leader, :mag1}, 0, :follow}
        ] do
      group = alone(nil)
      ended = %{mission(group) | verdict: verdict, tries: tries, epoch: 1, order: []}
      before = put_in(group.robots.mag2.mission, ended)
      assert [^next] = before |> Group.run(0.1) |> entered(before)
    end
  end

  test "agree -> search if a round wants a scan that was not made" do
    before = alone(0.02) |> place(1) |> Group.run(0.1) |> letter({2, 1, :mag1}, :search)
    group = before |> beat(:mag1, []) |> Group.run(0.1)
    # It passes through :agree within the tick.
    assert [:search] = entered(group, before)
  end

  test "wander -> search when the landmark comes into sight, when a round asks, and when it has roamed" do
    wandering = to(:wander)
    seen = wandering |> Group.show(:mag2, 0.02) |> Group.run(0.1)
    assert [:search] = entered(seen, wandering)

    asked = wandering |> beat(:mag1, []) |> letter({9, 1, :mag1}, :search) |> Group.run(0.1)
    assert [:search] = entered(asked, wandering)
    assert [] = wandering |> Group.run(5.5) |> entered(wandering)
    assert [:search] = wandering |> Group.run(6) |> entered(wandering)
  end

  test "rest -> search when the landmark comes into sight; a round that asks gets the old answer" do
    resting = to(:rest)
    assert [] = resting |> Group.run(30) |> entered(resting)
    seen = resting |> Group.show(:mag2, 0.02) |> Group.run(0.1)
    assert [:search] = entered(seen, resting)
    asked = resting |> beat(:mag1, []) |> letter({9, 1, :mag1}, :search) |> Group.run(0.1)
    assert [] = entered(asked, resting)
    assert %{merit: nil} = mission(asked).round.report
  end

  test "lead -> agree when deposed: by a later epoch at once, unheard after 1.5 s" do
    leading = to(:lead, 0.02)
    later = leading |> beat(:mag1, phase: :follow, epoch: 9) |> Group.run(0.1)
    assert [:agree] = entered(later, leading)

    same =
      leading
      |> beside(
        :mag1,
        [phase: :follow, epoch: 1, heard: Swarm.Membership.NameSet.new([:mag2])],
        5
      )

    assert [] = entered(same, leading)
    assert mission(same).order == [:mag1]
    # It hears the follower, which no longer hears it.
    assert [] = same |> beside(:mag1, [phase: :follow, epoch: 1], 1.3) |> entered(same)

    assert [:agree | _] =
             same
             |> beside(:mag1, [phase: :follow, epoch: 1], 1.7)
             |> entered(same)
             |> Enum.reverse()
  end

  test "lead -> agree when a round is opened, or another leads as well" do
    leading = to(:lead, 0.02)
    asked = leading |> beat(:mag1, []) |> letter({9, 1, :mag1}, :change) |> Group.run(0.1)
    assert [:agree] = entered(asked, leading)

    rival =
      leading
      |> beside(
        :mag1,
        [phase: :lead, epoch: 1, heard: Swarm.Membership.NameSet.new([:mag2])],
        0.3
      )

    # It waits a little to hear of all of the other's robots too.
    assert [] = entered(rival, leading)

    rival =
      rival
      |> beside(
        :mag1,
        [phase: :lead, epoch: 1, heard: Swarm.Membership.NameSet.new([:mag2])],
        0.1
      )

    assert [:agree] = entered(rival, leading)
    assert Round.open?(mission(rival).round)
    assert elem(mission(rival).round.id, 0) == 2
  end

  test "follow -> agree when a round is opened, and over to a leader of a later epoch" do
    group = following()

    asked =
      group |> beat(:mag1, phase: :agree) |> letter({2, 1, :mag1}, :change) |> Group.run(0.1)

    assert [:agree] = entered(asked, group)

    superseded = group |> place(5) |> Group.run(0.1)

    assert [] = entered(superseded, group)
    assert %{epoch: 5, phase: :follow} = mission(superseded)
  end

  test "the lease: without an anchor a follower stands after 1 s, and elects after 2 s" do
    group = following() |> Group.run(0.9)
    assert {{:slot, 1}, {Robot.Behaviour.Follow, _}} = group.robots.mag2.goal
    group = Group.run(group, 0.2)
    assert {:stand, {Robot.Behaviour.Stop, []}} = group.robots.mag2.goal
    assert %{standing: true, in_place: false, phase: :follow} = group.robots.mag2.claim
    assert phase(Group.run(group, 0.7)) == :follow
    assert [:agree | _] = group |> Group.run(1.2) |> entered(group) |> Enum.reverse()
  end

  test "a leader that a follower does not hear, but others do, is not replaced" do
    group =
      following()
      |> beside(
        :mag3,
        [phase: :follow, epoch: 1, leader: :mag1, heard: Swarm.Membership.NameSet.new([:mag1])],
        10
      )

    assert phase(group) == :follow
    assert mission(group).round.phase == :none
    # Only when the others do not hear it either.
    assert [:agree | _] =
             group
             |> beside(:mag3, [phase: :follow, epoch: 1], 1)
             |> entered(group)
             |> Enum.reverse()
  end

  test "anchors of an earlier epoch, or of a rival in the same epoch, are not accepted" do
    group = following(3)
    known = mission(group).anchor
    assert mission(place(group, 2)).anchor == known
    rival = %{anchor(group, 3, [:mag2]) | leader: :aaa, sequence: 1_000_000}
    message = Beat.pass_on(:aaa, rival)
    assert mission(Group.event(group, :mag2, {:message, message})).anchor == known
  end

  test "a leader that does not know where it is stands still, and sends no place" do
    leading =
      to(:lead, 0.02)
      |> beside(
        :mag1,
        [phase: :follow, epoch: 1, heard: Swarm.Membership.NameSet.new([:mag2])],
        3
      )

    lost = %{
      Group.percept(leading, :mag2)
      | pose: nil,
        odometry: nil,
        detections: nil
    }

    {:lead, _mission, effects} = Landmark.handle({:tick, lost}, mission(leading))
    assert {:goal, :stand, {Robot.Behaviour.Stop, []}} in effects
    assert [] = for({:claim, _to, _anchor} <- effects, do: :claim)

    # Nor does it claim any longer that all stand where they should.
    formed = put_in(mission(leading).leadership.formed?, true)
    {:lead, _mission, effects} = Landmark.handle({:tick, lost}, formed)
    assert [%{formed: false, anchor: nil}] = for({:claim, claim} <- effects, do: claim)
  end

  test "a challenge: nearer by 0.5 m for 2 s, but not in the first 10 s" do
    for {distance, opens?} <- [{2_400, true}, {2_100, false}] do
      leader = [phase: :lead, epoch: 1, leader: :mag1, sight: %{size_ppm: 9, distance: distance}]
      group = following() |> Group.show(:mag2, 0.02)
      # In place, and 1.7 m in front of the landmark.
      steps = fn group, seconds ->
        Enum.reduce(1..round(seconds * 10), group, fn _, group ->
          group |> beat(:mag1, leader) |> place(1) |> Group.run(0.1)
        end)
      end

      group = steps.(group, 9)
      assert phase(group) == :follow
      assert phase(steps.(group, 4)) == if(opens?, do: :agree, else: :follow)
    end
  end

  test "every phase of the table has an activity, and every exit leads into the table" do
    for phase <- Transitions.phases() do
      assert Transitions.activity(phase) in [:stand, :scan, :roam, :lead, :follow, :hold]
      assert Transitions.next(phase, fn _ -> true end) in Transitions.phases()
      assert Transitions.next(phase, fn _ -> false end) == phase
    end
  end

  test "a robot that neither leads nor follows corrects its pose by nothing it heard before" do
    group = alone(0.02)

    percept = Group.percept(group, :mag2)
    {:search, _mission, effects} = Landmark.handle({:tick, percept}, mission(group))

    # The landmark may show how the wheels slip, until others take the robot's pose for their frame.
    assert {:anchors, %Anchors{standing: "YellowLandmark", walls?: false}} in effects

    led = put_in(mission(group).leadership.sequence, 1)
    {:search, _mission, effects} = Landmark.handle({:tick, percept}, led)
    assert {:anchors, %Anchors{walls?: false}} in effects
  end

  test "a sight smooths the place, follows a jump, and says when it moves" do
    group = alone(0.02)
    percept = Group.percept(group, :mag2)
    sight = LandmarkTrack.update(nil, percept, "YellowLandmark")
    assert {1.7, _} = {Float.round(elem(sight.place, 0), 1), nil}
    refute sight.moving?
    assert LandmarkTrack.update(sight, percept, "YellowLandmark") == sight

    later = put_in(percept.detections.at_ms, percept.at_ms + 100)
    [blob] = later.detections.blobs
    far = put_in(later.detections.blobs, [%{blob | distance: 2.0}])

    assert LandmarkTrack.update(sight, far, "YellowLandmark").moving?
    jump = put_in(later.detections.blobs, [%{blob | distance: 4.0}])
    moved = LandmarkTrack.update(sight, jump, "YellowLandmark")
    assert_in_delta elem(moved.place, 0), 4.0, 0.01
    gone = put_in(later.detections.blobs, [])
    assert LandmarkTrack.update(sight, gone, "YellowLandmark") == sight
  end

  test "if the landmark's foot is out of the picture, its width gives the distance" do
    group = alone(0.02)
    %{detections: %{blobs: [blob]}} = percept = Group.percept(group, :mag2)
    # 48 of 320 pixels over 60 degrees: 0.13 m of its radius show, 1.51 m off.
    near = %{blob | clipped?: true, left: 136, right: 183, top: 40, bottom: 239, distance: 9.0}

    place = fn blobs ->
      percept = put_in(percept.detections.blobs, blobs)
      LandmarkTrack.update(nil, percept, "YellowLandmark").place
    end

    assert_in_delta elem(place.([near]), 0), 1.51, 0.05
    assert place.([%{near | left: 0}]) == nil
    # Somebody stands in front of it.
    assert place.([near, %{near | colour: "RedRobot", right: 150}]) == nil
  end
end
