defmodule Missions.Landmark.ForgedNumbersTest do
  # One sender says a number at the end of its range; afterwards the fleet elects, follows and
  # takes orders as before.
  use ExUnit.Case, async: true
  alias Missions.Landmark
  alias Missions.Landmark.{Group, Reference}
  alias Swarm.Agreement.Round.Letter
  alias Swarm.Message

  @ids [:mag1, :mag2, :mag3]
  # The end before this rule, that of other machines' integers, and that of the wire.
  @ends [500_000_000, 9_007_199_254_740_992, 18_446_744_073_709_551_615]

  defp fleet(ids \\ @ids) do
    group =
      for {id, n} <- Enum.with_index(ids), reduce: Group.new() do
        group -> Group.join(group, id, {n * 1.0, 0.0}, 0.02 + n / 1000)
      end

    {true, group} = Group.until(group, 10, &Group.one?(&1, ids))
    group
  end

  defp leader(group), do: group |> Group.leaders() |> Map.fetch!(:mag1)

  # All robots hear it, whoever is said to have sent it.
  defp forge(group, from, kind, body) do
    message =
      if is_struct(body, Reference),
        do: Missions.Landmark.Beat.pass_on(from, body),
        else: Message.new(from, kind, body)

    for id <- Map.keys(group.robots), id != from, reduce: group do
      group -> Group.hear(group, id, from, message)
    end
  end

  defp beat(fields), do: Missions.Landmark.Beat.new([pose: {9_000, 0, 0}] ++ fields)

  # Without its leader, the rest has to elect another.
  defp assert_elects(group, seconds \\ 12) do
    group = Group.kill(group, leader(group))
    rest = Enum.sort(Map.keys(group.robots))
    assert {true, group} = Group.until(group, seconds, &Group.one?(&1, rest))
    group
  end

  # As after a long time of elections.
  defp aged(group, epoch) do
    update_in(group.robots, fn robots ->
      Map.new(robots, fn {id, robot} ->
        mission = %{robot.mission | epoch: epoch}
        {id, %{robot | mission: put_in(mission.round.highest, {epoch, 1})}}
      end)
    end)
  end

  for phase <- [:search, :follow, :lead] do
    test "a heartbeat in phase #{phase} with the last epoch ends no elections" do
      for epoch <- @ends do
        group = fleet()

        forged = beat(phase: unquote(phase), epoch: epoch, leader: :mag9)
        assert_elects(group |> forge(:mag9, :heartbeat, forged) |> Group.run(0.3))
        # In the name of a member, whose own words are heard again when this one is forgotten.
        forged = %{forged | boot: 0xFFFFFFFFFFFFFFFF, leader: :mag3}
        assert_elects(group |> forge(:mag3, :heartbeat, forged) |> Group.run(3))
      end
    end
  end

  test "a sender that goes on claiming the last epoch is left out, while it is there and after it" do
    for phase <- [:search, :lead], epoch <- @ends do
      group = fleet([:min1 | @ids])
      group = Group.kill(group, leader(group))
      rest = Map.keys(group.robots)

      {done?, group} =
        Enum.reduce_while(1..100, {false, group}, fn n, {_done?, group} ->
          forged = beat(sequence: n, phase: phase, epoch: epoch, leader: :mag9)
          group = group |> forge(:mag9, :heartbeat, forged) |> Group.run(0.2)
          done? = Group.one?(group, rest)
          {if(done?, do: :halt, else: :cont), {done?, group}}
        end)

      assert done?
      assert Enum.all?(group.robots, fn {_id, robot} -> robot.mission.epoch < 100_000_000 end)
      group |> Group.run(1) |> assert_elects()
    end
  end

  test "five hundred and more round letters that each raise the number do not reach its end" do
    for count <- [501, 5_001], step <- [1_000_000, 999_999] do
      group = fleet()

      group =
        for n <- 1..count, reduce: group do
          group ->
            letter = %Letter{
              id: {rem(n * step, 500_000_001), 1, :mag9},
              view: [:mag9],
              remaining_ms: 100,
              purpose: :change,
              report: :busy
            }

            forge(group, :mag9, :round, letter)
        end

      assert Enum.all?(group.robots, fn {_, r} ->
               elem(r.mission.round.highest, 0) < 10_000_000
             end)

      assert_elects(group)
    end
  end

  test "letters that raise the tries of an epoch to their end only begin the next one" do
    group = fleet()
    epoch = group.robots.mag1.mission.epoch

    group =
      for n <- 1..501, counter = n * 999_999, reduce: group do
        group ->
          letter = %Letter{
            id: {epoch, counter, :mag9},
            view: [:mag9],
            remaining_ms: 100,
            purpose: :change,
            report: :busy
          }

          if Letter.valid?(letter), do: forge(group, :mag9, :round, letter), else: group
      end

    assert_elects(group)
  end

  test "an anchor with the last epoch, in heartbeats or by the chain, is not followed" do
    for epoch <- @ends, kind <- [:claim, :heartbeat] do
      group = fleet()

      anchor = %Reference{
        leader: :mag9,
        epoch: epoch,
        sequence: 1,
        pose: {0, 0, 0},
        twist: {0, 0},
        formation: {:column, 1.0},
        order: @ids,
        size: 4,
        places: [1, 2, 3]
      }

      body =
        if kind == :claim,
          do: anchor,
          else: beat(phase: :lead, epoch: 1, leader: :mag9, anchor: anchor)

      assert_elects(group |> forge(:mag9, kind, body) |> Group.run(3))
    end
  end

  test "a fleet whose epoch is at one of these ends already goes on electing" do
    for epoch <- [500_000_000, 500_000_001, 9_007_199_254_740_992] do
      group = fleet() |> aged(epoch) |> Group.run(1) |> assert_elects()
      assert Enum.all?(group.robots, fn {_id, robot} -> robot.mission.epoch > epoch end)
    end
  end

  test "a robot that has just been switched on joins a fleet of any age" do
    for epoch <- [10_000, 999_999, 1_000_001, 500_000_001, 3_600_000_000_000] do
      group = fleet() |> aged(epoch) |> Group.run(1)
      assert Group.one?(group, @ids)
      group = Group.join(group, :min1, {0.0, 2.0}, nil)
      assert {true, _group} = Group.until(group, 15, &Group.one?(&1, [:min1 | @ids]))
    end
  end

  test "a robot that hears only one other catches up with it step by step" do
    group = fleet([:mag1]) |> aged(4_500_000) |> Group.run(1)
    group = Group.join(group, :min1, {0.0, 2.0}, nil)
    assert {true, _group} = Group.until(group, 30, &Group.one?(&1, [:mag1, :min1]))
  end

  test "parts that meet again after ten thousand elections, or ten million, are led by one" do
    for epoch <- [10_000, 10_000_000] do
      ids = [:mag1, :mag2, :mag3, :min1, :min2]
      parts = [[:mag1, :mag2, :mag3], [:min1, :min2]]
      group = ids |> fleet() |> Group.cut(parts)
      each? = fn group -> Enum.all?(parts, &Group.one?(group, &1)) end
      assert {true, group} = Group.until(group, 20, each?)
      {ahead, behind} = Map.split(group.robots, List.last(parts))

      group =
        put_in(group.robots, Map.merge(behind, aged(%{group | robots: ahead}, epoch).robots))

      group = group |> Group.run(2) |> Group.cut([])
      assert {true, _group} = Group.until(group, 20, &Group.one?(&1, ids))
    end
  end

  test "steady pushing by somebody with the key moves the epoch a million a second" do
    group =
      for second <- 1..20, _beat <- 1..5, reduce: fleet() do
        group ->
          top = group.robots |> Enum.map(fn {_, r} -> r.mission.epoch end) |> Enum.max()

          for jump <- [1, 999_000, 1_000_000, 9_000_000, 1_000_000_000], reduce: group do
            group ->
              letter = %Letter{
                id: {top + jump, 1, :mag9},
                view: @ids,
                remaining_ms: 100,
                purpose: :change,
                report: :busy
              }

              fields = [sequence: second * 1_000_000 + jump, phase: :search, epoch: top + jump]

              group
              |> forge(:mag9, :round, letter)
              |> forge(:mag9, :heartbeat, beat(fields))
          end
          |> Group.run(0.2)
      end

    for {_id, robot} <- group.robots,
        do: assert(elem(robot.mission.round.highest, 0) <= 23_000_000)

    assert {true, group} = Group.until(group, 15, &Group.one?(&1, @ids))
    assert_elects(group)
  end

  test "the last number of an asked shape does not keep people from asking for others" do
    for number <- @ends do
      group = fleet()
      known = group.robots[leader(group)].mission.anchor

      forged = %{known | leader: :mag9, asked: {:wedge, 1.0}, asked_no: number}
      group = group |> forge(:mag9, :claim, forged) |> Group.run(1)
      asked = {:command, {:formation, :line, 1.5}}
      group = for id <- @ids, reduce: group, do: (group -> Group.event(group, id, asked))
      group = Group.run(group, 2)
      assert Group.one?(group, @ids)

      for {_id, %{mission: mission}} <- group.robots do
        assert mission.formation == {:line, 1.5}
        assert mission.anchor.asked == {:line, 1.5}
        assert Reference.valid?(mission.anchor)
      end
    end
  end

  test "one anchor that asks for a majority of a thousand does not keep a fleet from electing" do
    for from <- [:leader, :mag9], later <- [0, 1], asked <- [0, 5] do
      group = fleet()
      leader = leader(group)
      from = if from == :leader, do: leader, else: from
      known = group.robots[leader].mission.anchor

      forged = %{
        known
        | leader: from,
          epoch: known.epoch + later,
          of: 1_000,
          asked_no: known.asked_no + asked,
          sequence: known.sequence + 1
      }

      assert_elects(forge(group, from, :claim, forged))
      assert_elects(group |> forge(from, :claim, forged) |> Group.run(1))
    end
  end

  test "an anchor with the last sequence number in the leader's name holds its followers up for a second" do
    for sequence <- @ends do
      group = fleet()
      leader = leader(group)
      known = group.robots[leader].mission.anchor
      forged = %{known | sequence: sequence}
      group = group |> forge(leader, :claim, forged) |> Group.run(1.5)

      for {id, %{mission: mission}} <- group.robots, id != leader do
        assert mission.phase == :follow
        assert mission.anchor.sequence < 1_000
        assert mission.now_ms - mission.anchor_ms <= 300
      end

      # Along the chain, too, where the heartbeats are not heard.
      [parent, child] = group.robots[leader].mission.order
      group = group |> Group.cut([{:way, leader, child}]) |> Group.run(3)
      assert group.robots[child].mission.now_ms - group.robots[child].mission.anchor_ms <= 300
      assert group.robots[parent].mission.phase == :follow
    end
  end

  test "who is refused is told by name, with what is allowed, once in ten seconds" do
    group = fleet()

    {stages, _group} =
      Enum.map_reduce(1..100, group, fn n, group ->
        forged = beat(sequence: n, phase: :lead, epoch: 500_000_000, leader: :mag9)

        letter = %Letter{
          id: {400_000_000, n, :mag8},
          view: @ids,
          remaining_ms: 100,
          purpose: :change,
          report: :busy
        }

        group = group |> forge(:mag9, :heartbeat, forged) |> forge(:mag8, :round, letter)
        {:ok, mission} = Map.fetch(group.robots.mag1, :mission)
        tick = {:tick, Group.percept(group, :mag1)}
        {_phase, _mission, effects} = Landmark.handle(tick, mission)
        told = for {:stage, :refused, about} <- effects, do: about
        {told, Group.run(group, 0.1)}
      end)

    stages = Enum.concat(stages)
    assert [%{epoch: 500_000_000, allowed: allowed}] = Enum.filter(stages, &(&1.from == :mag9))
    assert allowed in 1_000_000..2_000_000
    assert [%{epoch: 400_000_000}] = Enum.filter(stages, &(&1.from == :mag8))
  end
end
