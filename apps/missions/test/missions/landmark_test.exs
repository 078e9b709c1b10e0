defmodule Missions.LandmarkTest do
  @moduledoc "Groups of missions over a lossy radio: who leads, for how long, and who follows."
  use ExUnit.Case, async: true
  alias Hal.Pose
  alias Missions.Landmark.Group
  alias Swarm.Message
  alias Missions.Landmark

  @three [:mag1, :mag2, :mag3]

  defp three(options \\ [], mission \\ []) do
    Group.new(options)
    |> Group.join(:mag1, {0, 0}, 0.02, mission)
    |> Group.join(:mag2, {1, 0}, 0.05, mission)
    |> Group.join(:mag3, {2, 1}, 0.03, mission)
  end

  defp led(group, ids, seconds \\ 20) do
    {one?, group} = Group.until(group, seconds, &Group.one?(&1, ids))
    assert one?, inspect({Group.phases(group), Group.leaders(group)})
    group
  end

  # There are never two leaders of one epoch among robots that were connected all the time.
  defp assert_lawful(group) do
    assert group.worst_both_ms <= 1_500
    epochs = for {epoch, _id} <- group.elected, do: epoch
    assert epochs == Enum.uniq(epochs), inspect(group.elected)
    group
  end

  test "the robot that sees the landmark largest leads after one round, and all follow" do
    group = three() |> led(@three, 5) |> assert_lawful()
    assert [{1, :mag2}] = group.elected
    assert group.worst_both_ms == 0
    {formed?, _} = Group.until(group, 20, &match?([{:formed, :mag2, _} | _], &1.stages))
    assert formed?
  end

  test "one robot alone leads itself" do
    group = Group.new() |> Group.join(:mag1, {0, 0}, 0.02) |> led([:mag1], 5)
    {formed?, _} = Group.until(group, 5, &match?([{:formed, :mag1, _} | _], &1.stages))
    assert formed?
  end

  test "without a landmark they try three times, then rest, and start again when one is seen" do
    group = Enum.reduce(@three, Group.new(), &Group.join(&2, &1, {:erlang.phash2(&1, 9), 0}, nil))

    {resting?, group} =
      Group.until(group, 60, &(Enum.uniq(Map.values(Group.phases(&1))) == [:rest]))

    assert resting?
    assert group.elected == []
    assert Enum.count(group.robots.mag1.phases, &(&1 == :wander)) == 2
    group = group |> Group.show(:mag3, 0.02) |> led(@three)
    assert [{_epoch, :mag3}] = group.elected
  end

  test "two groups that meet end in one round with one leader" do
    for _ <- 1..10 do
      group = Group.cut(three(), [[:mag1], [:mag2, :mag3]])
      group = group |> led([:mag1]) |> led([:mag2, :mag3])
      assert length(group.elected) == 2
      group = group |> Group.cut([]) |> led(@three, 10)
      assert group.worst_both_ms <= 1_500
      assert length(group.elected) == 3
      assert Group.leaders(Group.run(group, 10)) == Group.leaders(group)
    end
  end

  test "the invariants hold under loss, duplicates, late and reordered messages, cut and mended" do
    for _ <- 1..25 do
      group =
        three(loss: :rand.uniform() * 0.25, doubled: 0.2, delay_ms: {5, 400})
        |> led(@three, 40)
        |> assert_lawful()

      group = group |> Group.run(:rand.uniform(5)) |> Group.cut(Enum.random(cuts()))
      group = group |> Group.run(:rand.uniform(12)) |> Group.cut([]) |> led(@three, 60)
      assert group.worst_both_ms <= 1_500, inspect(group.elected)
    end
  end

  defp cuts, do: for(id <- @three, do: [[id], @three -- [id]]) ++ [Enum.map(@three, &[&1])]

  test "when the leader dies another takes over" do
    for _ <- 1..10 do
      group = three(loss: 0.1) |> led(@three, 30) |> Group.run(2)
      [leader] = Enum.uniq(Map.values(Group.leaders(group)))
      group = group |> Group.kill(leader) |> led(@three -- [leader], 30)
      assert_lawful(group)
    end
  end

  test "a follower that hears no leader looks at the landmark, which a round may ask it for" do
    group = three() |> led(@three, 5) |> Group.run(3) |> Group.kill(:mag2)
    group = Enum.reduce([:mag1, :mag3], group, &Group.show(&2, &1, nil))
    group = Group.run(group, 1.2)
    # According to the leader, which stood at {1, 0} and saw it 1.7 m ahead.
    percept = Group.percept(group, :mag3)
    {:follow, _mission, effects} = Landmark.handle({:tick, percept}, group.robots.mag3.mission)
    assert [bearing] = for({:look, bearing} <- effects, do: bearing)
    assert_in_delta bearing, Pose.bearing(percept.pose, {2.7, 0.0}), 0.02
    assert bearing != 0.0
  end

  test "a new leader assigns the slots that a dead robot has left free" do
    abreast = [
      mag1: {0, 0.05},
      mag2: {1, 0.04},
      mag3: {-1, 0.02},
      mag4: {2, 0.01},
      mag5: {-2, 0.01}
    ]

    mission = [formation: {:line, 1.0}, assign: :cost]

    group =
      for {id, {y, share}} <- abreast, reduce: Group.new() do
        group -> Group.join(group, id, {0, y}, share, mission)
      end

    group = group |> led(Keyword.keys(abreast), 5) |> Group.run(3) |> Group.kill(:mag1)
    group = led(group, [:mag2, :mag3, :mag4, :mag5], 5)

    # They stand 2, 3 and -1 m to the left; mag1 is at 0. The least squares of their ways are 9, 1
    # and 1.
    assert group.robots.mag2.mission.anchor.places == [1, 3, 4]
    assert group.robots.mag2.mission.order == [:mag3, :mag4, :mag5]
  end

  test "a robot that comes late joins the tail, without an election" do
    group = three() |> led(@three) |> Group.run(2)
    order = group.robots.mag2.mission.order
    group = group |> Group.join(:aaa, {4, 4}, 0.09) |> led([:aaa | @three])
    assert [{1, :mag2}] = group.elected
    assert group.robots.mag2.mission.order == order ++ [:aaa]
  end

  test "a robot joins a leader that has long been alone, without an election" do
    group = Group.new() |> Group.join(:mag2, {0, 0}, 0.02) |> led([:mag2]) |> Group.run(10)
    group = group |> Group.join(:mag1, {3, 0}, nil) |> led([:mag1, :mag2]) |> Group.run(5)
    assert [{1, :mag2}] = group.elected
  end

  test "a robot that was away for a change of leaders follows the new one" do
    group = three([], lost_link: :continue) |> led(@three) |> Group.run(1)
    away = Enum.random([:mag1, :mag3])
    [stays] = @three -- [:mag2, away]
    # It sees nothing, so it elects nobody alone meanwhile.
    group = group |> Group.show(away, nil) |> Group.cut([[away], [:mag2, stays]])
    group = group |> Group.kill(:mag2) |> led([stays])
    group |> Group.cut([]) |> led([away, stays])
  end

  test "a robot that restarts is not mistaken for its former self" do
    for restarted <- @three do
      group = three() |> led(@three) |> Group.run(3)
      other = hd(@three -- [restarted])
      %{^restarted => %{beat: old}} = group.robots[other].receiver.peers.rows
      late = Message.new(restarted, :heartbeat, %{old | sequence: old.sequence + 1})

      group = group |> Group.kill(restarted) |> Group.join(restarted, {3, 3}, 0.01, boot: 2)
      group = group |> led(@three, 30) |> assert_lawful()
      boot = fn group -> group.robots[other].receiver.peers.rows[restarted].beat.boot end
      assert boot.(group) == 2
      assert boot.(Group.hear(group, other, restarted, late)) == 2
    end
  end

  test "the same events have the same effects" do
    record = fn ->
      :rand.seed(:exsss, 7)
      group = three(loss: 0.1, doubled: 0.1) |> Group.run(15)
      {group.stages, group.elected, for({id, r} <- group.robots, do: {id, r.mission, r.pose})}
    end

    assert record.() == record.()
  end

  test "the order in which letters arrive within a tick does not change the plan" do
    for assign <- [:chain, :cost] do
      plans =
        for _ <- 1..20 do
          group = Enum.reduce(@three, Group.new(delay_ms: {5, 5}), &place(&2, &1, assign))
          group = led(group, @three)
          # Who does not lead, hears of it by the anchor.
          {group.elected,
           Enum.uniq(for {_, id} <- group.elected, do: group.robots[id].mission.order)}
        end

      assert [{[{1, :mag2}], [order]}] = Enum.uniq(plans)
      assert Enum.sort(order) == [:mag1, :mag3]
    end
  end

  defp place(group, id, assign) do
    {x, share} = %{mag1: {0, 0.02}, mag2: {3, 0.05}, mag3: {5, 0.03}}[id]
    Group.join(group, id, {x, 0}, share, assign: assign)
  end
end
