defmodule Lab.ReplayTest do
  use Lab.LockstepCase, async: true
  alias Lab.{Recording, Replay, Trial}
  alias Record.Recording.Comparison

  @robots [:mag1, :mag2, :mag3, :min1]

  @events [
    {4, {:freeze, :mag2, 2}},
    {6, {:cut, [[:mag1, :mag2], [:mag3, :min1]]}},
    {8, {:blind, :mag3, 2}},
    {9, {:join}},
    {10, {:loss, 0.4}},
    {12, {:estop, :min1}},
    {13, {:tell, :min1, "wander"}},
    {14, {:reset}},
    {15, {:tell, :all, :start}},
    {16, {:displace, :mag1, {-3.0, 2.0, 90}}}
  ]

  defp record(options, ticks) do
    {:ok, setup} = Trial.setup(Map.merge(%{robots: @robots, seed: 3}, Map.new(options)))
    trial = Trial.begin(setup, record: true)

    {ticks, trial} =
      Enum.map_reduce(1..ticks, trial, fn _tick, trial ->
        {entries, trial} = trial |> Trial.step() |> Trial.take_entries()
        {{trial.at_ms, entries}, trial}
      end)

    {setup, ticks, trial}
  end

  # As the file holds it.
  defp replay(setup, ticks) do
    {:ok, setup} = Recording.read_start(Recording.start(setup))

    Enum.flat_map_reduce(ticks, Replay.new(setup), fn tick, replay ->
      {:ok, tick} = tick |> Recording.tick() |> Recording.read_tick()
      {replay, differences} = Replay.step(replay, tick)
      {differences, replay}
    end)
  end

  defp same(options, ticks) do
    {setup, ticks, trial} = record(options, ticks)
    {differences, replay} = replay(setup, ticks)
    assert differences == []
    replayed = Replay.trial(replay)
    assert replayed.world == trial.world
    assert replayed.members == trial.members
    assert Trial.result(replayed) == Trial.result(trial)
    assert Trial.scene(replayed) == Trial.scene(trial)
    assert replay.inputs == Enum.sum(for {_at_ms, entries} <- ticks, do: steps(entries))
  end

  defp steps(entries), do: Enum.count(entries, &match?({:step, _, _, _}, &1))

  @tag skip: with({:error, line} <- Vision.Marks.available(), do: line, else: (:ok -> false))
  test "a run with marks in it replays to the byte" do
    same([marks: [size: 0.3, at: [{3, {1.5, 0.0, 180}}, {8, {0.0, 1.5, -90}}]]], 60)
  end

  test "a run replays to the byte: world, robots, scene and report" do
    same([moves: [{{2, 1}, 12}], kills: [{:leader, 15}], loss: 0.1], 250)
  end

  test "so does one whose robots are frozen, cut off, blind, stopped and lifted" do
    same([script: @events, noise: :slip], 200)
  end

  test "and one without painted pictures, in another building" do
    same([map: "hospital", blobs: :direct, duplicates: 0.2, start: :same], 150)
  end

  test "what a recording leaves out does not change the run" do
    {_setup, _ticks, recorded} = record([], 100)
    {:ok, trial} = Trial.new(%{robots: @robots, seed: 3})
    trial = Enum.reduce(1..100, trial, fn _tick, trial -> Trial.step(trial) end)
    assert Trial.result(trial) == Trial.result(recorded)
    assert trial.world == recorded.world
  end

  test "a decision that was another is found, with its robot and its time" do
    {setup, ticks, _trial} = record([blobs: :direct], 60)

    ticks =
      alter(ticks, 4_000, fn
        {:step, :mag2, {:tick, _at_ms} = input, _effects} -> {:step, :mag2, input, []}
        entry -> entry
      end)

    assert {[{:decision, difference}], _replay} = replay(setup, ticks)
    assert %{robot: :mag2, at_ms: 3_900, recorded: [], replayed: [_ | _]} = difference
  end

  test "a reading that was another is found in the world" do
    {setup, ticks, _trial} = record([blobs: :direct], 60)

    ticks =
      alter(ticks, 4_000, fn
        {:step, :mag2, {:reading, {:sonar, ranges}, at_ms}, effects} ->
          {:step, :mag2, {:reading, {:sonar, Enum.map(ranges, &(&1 / 2))}, at_ms}, effects}

        entry ->
          entry
      end)

    {differences, _replay} = replay(setup, ticks)

    assert {:world, %{robot: :mag2, recorded: {:sonar, _}, replayed: {:sonar, _}}} =
             hd(differences)
  end

  test "two runs part where one has another event" do
    {_setup, one, _trial} = record([blobs: :direct], 60)
    {_setup, other, _trial} = record([blobs: :direct, script: [{3, {:estop, :mag3}}]], 60)
    assert Comparison.first(one, one) == {:same, 6_000}
    assert {:differs, %{at_ms: 3_100, entries: entries}} = Comparison.first(one, other)
    assert {{:step, :mag1, _input, _effects}, {:world, 3_000, {:estop, :mag3}}} = entries
  end

  test "of what is not a recording's, nothing is taken" do
    junk = [
      "",
      "junk",
      <<131>>,
      :erlang.term_to_binary(:other),
      :erlang.term_to_binary({1, :ticks}),
      :erlang.term_to_binary({1, {{}, [{4, :mag1, 100, [{7, :all, 0}]}]}}),
      :erlang.term_to_binary({1, {{}, [{3, 100, [:mag1]}]}}),
      # More than any tick has, as it says.
      <<131, 80, 0xFFFFFFFF::32, 1, 2, 3>>,
      <<131, 100, 22::16, "an_atom_of_nobody_else">>
    ]

    for bytes <- junk do
      assert {:error, "begins with" <> _} = Recording.read_start(bytes)
      assert {:error, "has a tick that" <> _} = Recording.read_tick(bytes)
    end

    for version <- [1, 3] do
      other = :erlang.term_to_binary({:convoy, version, %{}})

      assert Recording.read_start(other) ==
               {:error, "is a recording of version #{version}; this program reads version 7"}
    end
  end

  defp alter(ticks, at_ms, change) do
    for {end_ms, entries} <- ticks do
      if end_ms == at_ms, do: {end_ms, Enum.map(entries, change)}, else: {end_ms, entries}
    end
  end
end
