defmodule Missions.Landmark.FreezeTest do
  # A leader that is frozen for about as long as its lease, and thaws when another may lead.
  use ExUnit.Case, async: true
  alias Missions.Landmark.Group

  @ids [:mag1, :mag2, :min1, :min2]

  defp fleet(ids) do
    group =
      for {id, n} <- Enum.with_index(ids), reduce: Group.new(loss: 0.02) do
        group -> Group.join(group, id, {n * 1.0, 0.0}, 0.02 + n / 1000)
      end

    {true, group} = Group.until(group, 15, &Group.one?(&1, ids))
    group
  end

  defp leader(group) do
    [leader] = group |> Group.leaders() |> Map.values() |> Enum.uniq()
    leader
  end

  test "two hundred freezes of the leader of 1.8 to 2.4 s: never do two say that they lead" do
    for ids <- [@ids, Enum.take(@ids, 2)] do
      group = fleet(ids)

      {group, changes} =
        Enum.reduce(1..100, {group, 0}, fn _, {group, changes} ->
          before = leader(group)
          # At any moment between two of its ticks and heartbeats.
          group = Group.run(group, 0.3 + :rand.uniform(10) / 10)
          assert Group.one?(group, ids)
          group = Group.freeze(group, before, 1_799 + :rand.uniform(601))
          group = Group.run(group, 3.5)
          assert group.worst_both_ms == 0
          assert group.rival_words == []
          assert {true, group} = Group.until(group, 10, &Group.one?(&1, ids))
          {group, if(leader(group) == before, do: changes, else: changes + 1)}
        end)

      # Epochs only grow, and in many of these freezes another did lead.
      epochs = group.elected |> Enum.reverse() |> Enum.map(&elem(&1, 0))
      assert epochs == Enum.sort(epochs)
      assert epochs == Enum.uniq(epochs)
      if length(ids) > 2, do: assert(changes > 20)
    end
  end

  test "two hundred freezes of the one that is being elected: it never says that it leads before it has looked" do
    {_group, agreeing} =
      Enum.reduce(1..200, {fleet(@ids), 0}, fn _, {group, agreeing} ->
        before = leader(group)

        next =
          group.robots |> Map.delete(before) |> Enum.max_by(fn {_, r} -> r.share end) |> elem(0)

        group = group |> Group.run(1) |> Group.freeze(before, 3_500 + :rand.uniform(600))
        # In each state of the round that elects the next one.
        elects? = fn group -> group.robots[next].mission.phase == :agree end
        {_elects?, group} = Group.until(group, 4, elects?)
        group = Enum.reduce(1..:rand.uniform(8), group, fn _, group -> Group.run(group, 0.1) end)
        agreeing = if elects?.(group), do: agreeing + 1, else: agreeing
        group = Group.freeze(group, next, 1_799 + :rand.uniform(601))
        group = Group.run(group, 5)
        assert group.rival_words == []
        assert group.worst_both_ms == 0
        assert {true, group} = Group.until(group, 15, &Group.one?(&1, @ids))
        {group, agreeing}
      end)

    # Many met it while it was not elected yet.
    assert agreeing > 20
  end

  test "a freeze of any length, of any robot" do
    Enum.reduce(1..100, fleet(@ids), fn _, group ->
      group = Group.run(group, :rand.uniform(10) / 10)
      group = Group.freeze(group, Enum.random(@ids), :rand.uniform(5_000))
      {true, group} = group |> Group.run(5) |> Group.until(15, &Group.one?(&1, @ids))
      assert group.worst_both_ms == 0
      assert group.rival_words == []
      group
    end)
  end
end
