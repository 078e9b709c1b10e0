defmodule Swarm.Agreement.RoundTest do
  use ExUnit.Case, async: true
  alias Swarm.Agreement.Round

  @tick 50
  @length 3_000

  # A round among `robots` over a radio that loses, duplicates and reorders, all from `:rand`
  # (seeded by ExUnit). Robots in `crashes` (`{id, at_ms}`) stop for ever; the others notice 2 s
  # later and open a new round, as the mission does.
  defp run(robots, options) do
    members = Map.new(robots, &{&1, Round.new(&1)})
    first = hd(robots)
    members = Map.update!(members, first, &Round.open(&1, 1, robots, :search, @length, 0))

    state = %{
      members: members,
      air: [],
      commits: [],
      crashes: Map.new(options[:crashes] || []),
      loss: options[:loss] || 0.0,
      doubled: options[:doubled] || 0.0,
      report_at: options[:report_at] || %{}
    }

    Enum.reduce_while(0..20_000//@tick, state, fn now, state ->
      state = step(state, now)

      if Enum.all?(alive(state, now), &committed?(state, &1)),
        do: {:halt, state},
        else: {:cont, state}
    end)
  end

  defp step(state, now) do
    {due, later} = Enum.split_with(state.air, fn {at, _, _, _} -> at <= now end)

    state =
      Enum.reduce(due, %{state | air: later}, fn {_at, to, from, letter}, state ->
        if dead?(state, to, now),
          do: state,
          else: update(state, to, &Round.hear(&1, from, letter, now))
      end)

    Enum.reduce(alive(state, now), state, &tick(&1, &2, now))
  end

  defp tick(id, state, now) do
    round = state.members[id]
    view = for {other, _} <- state.members, noticed_alive?(state, other, now), do: other

    round =
      cond do
        Round.open?(round) and Enum.any?(round.view, &(&1 not in view)) ->
          Round.open(round, elem(round.id, 0), view, :search, @length, now)

        true ->
          round
      end

    report_at = Map.get(state.report_at, id, 0)

    round =
      if now >= report_at,
        do: Round.report(round, report(id)),
        else: round

    {round, letters, event} = Round.tick(round, now)

    {round, commits} =
      case event do
        {:commit, record} ->
          {round, [{id, record} | state.commits]}

        {:failed, _why} ->
          {Round.open(round, elem(round.id, 0), view, :search, @length, now), state.commits}

        nil ->
          {round, state.commits}
      end

    air =
      for letter <- letters,
          to <- round.view,
          to != id,
          _copy <- 1..if(:rand.uniform() < state.doubled, do: 2, else: 1),
          :rand.uniform() >= state.loss,
          do: {now + :rand.uniform(180), to, id, letter}

    %{update(state, id, fn _ -> round end) | commits: commits, air: air ++ state.air}
  end

  defp report(id),
    do: %{merit: :erlang.phash2(id), pose: {1, 2, 3}, led: 0, of: 0}

  defp update(state, id, function),
    do: %{state | members: Map.update!(state.members, id, function)}

  defp dead?(state, id, now), do: now >= Map.get(state.crashes, id, :never)

  defp noticed_alive?(state, id, now),
    do: now < (Map.get(state.crashes, id) || 10_000_000) + 2_000

  defp alive(state, now), do: for({id, _} <- state.members, not dead?(state, id, now), do: id)
  defp committed?(state, id), do: Enum.any?(state.commits, fn {who, _} -> who == id end)

  defp assert_agreed(state, robots) do
    by_id = Enum.group_by(state.commits, fn {_who, record} -> record.id end)

    for {_id, commits} <- by_id do
      assert [_one] = commits |> Enum.map(fn {_who, record} -> record.digest end) |> Enum.uniq()
      assert [_one] = commits |> Enum.map(fn {_who, record} -> record.reports end) |> Enum.uniq()
    end

    for id <- robots, do: assert(committed?(state, id), "#{id} did not commit")
  end

  @robots [:mag1, :mag2, :mag3, :min1, :min2]

  test "all commit one record" do
    state = run(@robots, [])
    assert_agreed(state, @robots)
    assert Enum.uniq(for {_who, record} <- state.commits, do: record.id) == [{1, 1, :mag1}]
  end

  test "one robot agrees with itself" do
    assert_agreed(run([:mag1], []), [:mag1])
  end

  test "the round waits for a slow scan, up to the deadline" do
    state = run(@robots, report_at: %{min2: 2_000})
    assert_agreed(state, @robots)
    assert Enum.all?(state.commits, fn {_who, record} -> record.reports.min2 != nil end)

    state = run(@robots, report_at: %{min2: 9_000})
    assert_agreed(state, @robots)
    assert Enum.all?(state.commits, fn {_who, record} -> record.reports.min2 == nil end)
  end

  test "under loss, duplicates and disorder all commit one digest" do
    for _ <- 1..60 do
      state = run(@robots, loss: :rand.uniform() * 0.3, doubled: 0.2)
      assert_agreed(state, @robots)
    end
  end

  test "with a crash in any phase the others commit one digest" do
    for _ <- 1..80 do
      victim = Enum.random(@robots)
      at_ms = :rand.uniform(700)
      state = run(@robots, loss: 0.1, crashes: [{victim, at_ms}])
      assert_agreed(state, List.delete(@robots, victim))
    end
  end

  test "two openers end in one round" do
    a = Round.open(Round.new(:mag1), 1, [:mag1, :mag2], :search, @length, 0)
    b = Round.open(Round.new(:mag2), 1, [:mag1, :mag2], :search, @length, 0)
    {b, [letter], nil} = Round.tick(b, 0)
    a = Round.hear(a, :mag2, letter, 10)
    assert a.id == b.id
    assert a.id == {1, 1, :mag2}
  end

  test "a robot's second, different report is ignored" do
    round = Round.open(Round.new(:mag1), 1, [:mag1, :mag2], :search, @length, 0)
    other = Round.open(Round.new(:mag2), 1, [:mag1, :mag2], :search, @length, 0)
    {other, [letter], nil} = Round.tick(other, 0)
    round = Round.hear(round, :mag2, letter, 0)
    first = %{merit: 1, pose: {0, 0, 0}, led: 0, of: 0}
    round = Round.hear(round, :mag2, %{letter | report: first}, 10)
    round = Round.hear(round, :mag2, %{letter | report: %{first | merit: 2}}, 20)
    assert round.reports.mag2.merit == 1
    assert other.id == round.id
  end

  test "a round after one whose digest was out has a new epoch" do
    round = Round.open(Round.new(:mag1), 1, [:mag1, :mag2], :search, 10, 0)
    round = Enum.reduce(0..1000//50, round, fn now, round -> elem(Round.tick(round, now), 0) end)
    assert round.phase == :digest
    assert {2, _counter, :mag1} = Round.open(round, 1, [:mag1], :search, 10, 1_000).id
  end
end
