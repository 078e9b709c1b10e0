defmodule Record.ReplayTest do
  use ExUnit.Case, async: true
  alias Hal.{Odometry, Pose, Profile, Twist}
  alias Robot.Behaviour.Move
  alias Robot.Control.{Controller, Executive, Pilot}
  alias Robot.Mission.Manual
  alias Record.Replay
  alias Record.Recording
  alias Record.Replay.Roles
  alias Robot.Percept
  alias Robot.Safety.Gate
  doctest Record.Replay
  doctest Record.Replay.Roles
  doctest Record.Recording
  doctest Record.Recording.Names
  doctest Record.Recording.Terms
  doctest Record.Recording.Comparison
  doctest Record.Recording.Tick
  doctest Record.Recording.Topics

  defmodule Fragile do
    @moduledoc false
    def init(_robot, []), do: {:ready, 0, [{:claim, %{}}]}
    def handle({:command, :break}, _count), do: raise("broken")
    def handle(_event, count), do: {:ready, count + 1, [{:stage, :heard, %{count: count}}]}
  end

  defp begun(more \\ []), do: begun(Gate, more)

  defp begun(role, more) do
    config =
      struct!(
        Robot.Config,
        [id: :mag1, profile: Profile.magellan(), drive: {Some.Drive, []}] ++ more
      )

    {state, _effects} = role.init(config, %{}, 0)
    state
  end

  # What a process of this role records for these inputs, one a 50 ms.
  defp recorded(role, state, inputs, from_ms \\ 0) do
    {entries, {state, at_ms}} =
      Enum.flat_map_reduce(inputs, {state, from_ms}, fn input, {state, at_ms} ->
        {state, effects} = Roles.input(state, input, at_ms)

        {[{role, :input, input, at_ms} | for(e <- effects, do: {role, :effect, e, at_ms})],
         {state, at_ms + 50}}
      end)

    {entries, state, at_ms}
  end

  defp replay(entries) do
    {replay, found} =
      Enum.reduce(entries, {Replay.new(), []}, fn entry, {replay, found} ->
        {replay, difference} = Replay.step(replay, {:mag1, entry})
        {replay, List.wrap(difference) ++ found}
      end)

    {replay, last} = Replay.finish(replay)
    {Map.new(Replay.counts(replay)), Enum.reverse(found) ++ last, replay}
  end

  defp gate do
    near = List.duplicate(5.1, 16) |> List.replace_at(11, 0.4)

    inputs =
      [
        :tick,
        {:cast, {:wish, Twist.new(0.3, 0.1)}},
        :tick,
        {:cast, {:sense, {:sonar, near}}},
        :tick
      ] ++
        [{:cast, {:wish, Twist.new(0.3, 0.0)}}, :tick, {:ask, nil, :estop}, :tick] ++
        [{:ask, nil, :reset}, {:cast, {:forget, nil}}, :tick]

    begin = begun()
    {entries, state, at_ms} = recorded(:gate, begin, inputs)
    {[{:gate, :begin, begin, 0} | entries], state, at_ms}
  end

  test "what is as recorded is counted, and what is not is named" do
    {entries, _state, _at_ms} = gate()
    assert {%{{:mag1, :gate} => counts}, [], _replay} = replay(entries)
    assert %{inputs: 12, decisions: 10, begun: 1, skipped: 0, lost: 0} = counts

    drives? = &match?({:gate, :effect, {:drive, %Twist{linear: v}, _}, _} when v > 0, &1)
    at = Enum.find_index(entries, drives?)
    {:gate, :effect, {:drive, twist, limits}, at_ms} = Enum.at(entries, at)
    other = {:drive, %{twist | linear: twist.linear + 1.0e-15}, limits}
    changed = List.replace_at(entries, at, {:gate, :effect, other, at_ms})
    assert {%{{:mag1, :gate} => counts}, [difference], _replay} = replay(changed)

    assert %{robot: :mag1, role: :gate, at_ms: ^at_ms, input: :tick, recorded: [^other]} =
             difference

    assert difference.replayed == [{:drive, twist, limits}]
    # After that its state is not known any more, and nothing is called equal.
    assert counts.skipped > 0
  end

  test "an effect that is missing, or one too many, differs" do
    {entries, _state, _at_ms} = gate()
    [first | _] = for {{:gate, :effect, _, _}, n} <- Enum.with_index(entries), do: n
    assert {_, [%{recorded: [], replayed: [_]}], _} = replay(List.delete_at(entries, first))
    twice = List.insert_at(entries, first, Enum.at(entries, first))
    assert {_, [%{recorded: [_, _], replayed: [_]}], _} = replay(twice)
    # The end of a file may be missing.
    assert {_, [], _} = replay(Enum.drop(entries, -1))
  end

  test "without a state nothing is compared, from a checkpoint on everything" do
    {entries, state, at_ms} = gate()
    {more, _state, _at_ms} = recorded(:gate, state, [:tick, :tick], at_ms)
    checkpoint = {:gate, :checkpoint, state, at_ms}
    assert {%{{:mag1, :gate} => counts}, [], _} = replay(entries ++ [checkpoint | more])
    assert %{checked: 1, decisions: 12, skipped: 0} = counts

    middle = Enum.drop(entries, 5) ++ [checkpoint | more]
    assert {%{{:mag1, :gate} => counts}, [], _} = replay(middle)
    assert %{checked: 0, decisions: 2, early: early, skipped: 0} = counts
    assert early == length(entries) - 5

    # Without any state it is not the time before a recording.
    assert {%{{:mag1, :gate} => counts}, [], _} = replay(Enum.drop(entries, 5))
    assert %{decisions: 0, early: 0, skipped: ^early} = counts
  end

  test "a checkpoint with another state than the replay's differs in what is named" do
    {entries, state, at_ms} = gate()
    other = %{state | presses: 3}
    {more, _state, _at_ms} = recorded(:gate, other, [:tick], at_ms)

    assert {%{{:mag1, :gate} => counts}, [difference], _} =
             replay(entries ++ [{:gate, :checkpoint, other, at_ms} | more])

    assert %{input: :checkpoint, recorded: [presses: 3], replayed: [presses: 1]} = difference
    assert counts.checked == 0 and counts.skipped == 0
  end

  test "lost entries are counted, and what follows waits for a state" do
    {entries, state, at_ms} = gate()
    {first, [_lost, _lost_too | rest]} = Enum.split(entries, 6)
    {more, _state, _at_ms} = recorded(:gate, state, [:tick], at_ms)

    all = first ++ [{:gate, :lost, 2, 100}] ++ rest ++ [{:gate, :checkpoint, state, at_ms} | more]
    assert {%{{:mag1, :gate} => counts}, [], _} = replay(all)
    assert %{lost: 2, skipped: skipped} = counts
    assert skipped == length(rest)
  end

  test "in a dry run, and without a head, other effects are right" do
    {entries, _, _} = recorded(:gate, begun(dry_run: true), [:tick])

    assert [_, {:gate, :effect, {:drive, twist, [:dry_run, :dead_man]}, 0}] = entries
    assert twist == Twist.zero()

    for {ptz, count} <- [{{Some.Head, []}, 1}, {nil, 0}] do
      look = {:cast, {:obey, {:look, 0.3}}}
      {entries, _, _} = recorded(:executive, begun(Executive, ptz: ptz), [look])
      assert Enum.count(entries, &match?({:executive, :effect, {:look, _}, _}, &1)) == count
    end
  end

  test "why: what was perceived, all wishes, and the mission's phase" do
    profile = Profile.magellan()
    odometry = %Odometry{pose: Pose.new(0, 0), twist: Twist.zero()}
    percept = %Percept{robot: :mag1, at_ms: 0, profile: profile, odometry: odometry}
    begin = begun(Executive, start: Pose.new(1, 2))
    goal = {:cast, {:obey, {:goal, :go, {Move, linear: 0.2, turn: 0.0}}}}
    {entries, _, _} = recorded(:executive, begin, [goal, {:tick, percept}])

    pilot = begun(Pilot, [])

    {told, _, _} =
      recorded(:pilot, pilot, [{:ask, nil, {:start, Manual, []}}, {:ask, nil, :stop}])

    all = [{:executive, :begin, begin, 0} | entries] ++ [{:pilot, :begin, pilot, 0} | told]

    assert {counts, [], replay} = replay(all)
    assert counts[{:mag1, :pilot}].decisions > 2
    reasons = Replay.Moment.reasons(Replay.moment(replay, :mag1))
    assert reasons.percept.pose == Pose.new(1, 2)
    assert [{%{by: _chosen}, first} | rest] = reasons.wishes
    assert Enum.all?(rest, fn {_wish, weight} -> weight <= first end)
    assert Replay.state(replay, :mag1, :pilot).state == :idle
  end

  test "the walls that the sonars see go to the pilot once each time that they change, and are replayed" do
    profile = Profile.magellan()
    plan = Nav.OccupancyGrid.new()
    begin = begun(Executive, start: Pose.new(1, 2), plan: plan)

    # Along a wall at its left.
    ranges = %{5 => 1.2, 6 => 0.87, 7 => 0.8, 8 => 0.87, 9 => 1.2}

    ticks =
      for k <- 0..60 do
        odometry = %Odometry{pose: Pose.new(k * 0.03, 0), twist: Twist.new(0.3, 0.0)}
        sonar = for at <- 0..15, do: Map.get(ranges, at, profile.sonar_max)
        shared = %Percept{robot: :mag1, at_ms: k * 100, profile: profile}
        {:tick, %{shared | odometry: odometry, sonar: sonar}}
      end

    {entries, %{controller: controller}, _} = recorded(:executive, begin, ticks)

    told =
      for {:executive, :effect, {:cast, :pilot, {:walls, _} = walls}, _} <- entries, do: walls

    assert length(told) in 2..7
    assert Enum.all?(told, &(byte_size(:erlang.term_to_binary(&1)) < 2_000))

    assert for({_, _, {:cast, :pilot, {:tick, percept}}, _} <- entries, percept.grid, do: percept) ==
             []

    assert {_, [], _} = replay([{:executive, :begin, begin, 0} | entries])

    pilot = begun(Pilot, [])

    {heard, %{runner: runner}, _} =
      recorded(:pilot, pilot, for(walls <- told, do: {:cast, walls}))

    assert %Nav.Grid{} = grid = runner.grid
    assert grid == Controller.walls(controller)
    assert {_, [], replay} = replay([{:pilot, :begin, pilot, 0} | heard])
    assert Replay.state(replay, :mag1, :pilot).runner.grid == grid
  end

  test "a mission that crashed crashes again, and one that did not is named" do
    begin = begun(Pilot, [])
    start = {:ask, nil, {:start, Fragile, []}}
    {entries, state, at_ms} = recorded(:pilot, begin, [start, {:cast, {:command, :a}}])
    entries = [{:pilot, :begin, begin, 0} | entries]
    broken = {:pilot, :input, {:cast, {:command, :break}}, at_ms}
    again = [{:pilot, :begin, begin, at_ms}]

    assert {%{{:mag1, :pilot} => %{begun: 2}}, [], _} = replay(entries ++ [broken | again])

    next = {:pilot, :input, {:cast, {:command, :b}}, at_ms + 50}
    assert {_, [difference], _} = replay(entries ++ [broken, next])
    assert difference.crash =~ "broken"
    checkpoint = {:pilot, :checkpoint, state, at_ms}
    assert {_, [%{crash: "" <> _}], _} = replay(entries ++ [broken, checkpoint])
  end

  test "entries pass through a file unchanged, with the marks of a profile and of references" do
    profile = Profile.magellan()
    odometry = %Odometry{pose: Pose.new(0, 0), twist: Twist.zero(), frame: make_ref()}
    percept = %Percept{robot: :mag1, at_ms: 5, profile: profile}

    entries = [
      {:mag1, {:gate, :input, {:cast, {:sense, {:odometry, odometry}}}, 5}},
      {:mag1, {:executive, :input, {:tick, percept}, 5}}
    ]

    robots = %{mag1: %{offset_ms: 7, profile: profile}}
    {bytes, names} = Recording.trace(entries, robots, MapSet.new())
    assert Recording.read_trace(bytes, robots) == {:ok, entries}
    told = Recording.robots(robots, names)
    assert Recording.read_robots(told, 0) == {:ok, robots, 0}
    assert byte_size(bytes) < div(byte_size(:erlang.term_to_binary(entries)), 2)

    for {version, more} <- [{2, [%{}]}, {99, [[], <<>>, 1]}] do
      message = List.to_tuple([:convoy_robots, version | more])

      assert {:error, "is a recording of version #{version}; this program reads version 8"} ==
               Recording.read_robots(:erlang.term_to_binary(message))
    end

    # Of a program whose states had other parts, or a file that somebody made.
    old = Map.delete(begun(), :presses)

    for {kind, what} <- [begin: old, checkpoint: {begun(), %{}}, lost: -1, begin: 1, other: 1] do
      bytes = :erlang.term_to_binary([{:mag1, {:gate, kind, what, 0}}])
      assert {:error, "has entries that" <> _} = Recording.read_trace(bytes, %{})
    end

    for {names, robots} <- [
          {[], %{1 => %{offset_ms: 0, profile: nil}}},
          {[], %{mag1: 1}},
          {[], %{mag1: %{offset_ms: 0.5, profile: nil}}},
          {["mag1" | "mag2"], %{}},
          {[1], %{}},
          {%{}, %{}}
        ] do
      bytes = :erlang.term_to_binary(robots)

      assert {:error, "begins with something" <> _} =
               Recording.read_robots(:erlang.term_to_binary({:convoy_robots, 8, names, bytes}))
    end

    junk = [<<>>, "junk", <<131, 80, 0xFFFFFFFF::32, 0>>, :erlang.term_to_binary([{:mag1, 3}])]
    for bytes <- junk, do: assert({:error, _line} = Recording.read_trace(bytes, %{}))

    none = [{:mag1, {:gate, :input, {:"$convoy_reference", "x"}, 1}}]
    assert {:error, _line} = Recording.read_trace(:erlang.term_to_binary(none), %{})
  end

  test "names of another machine are read, so many of a file, and nothing else becomes an atom" do
    # As text and bytes only: the compiler would make atoms of them.
    new = fn prefix, count -> for n <- 1..count, do: "#{prefix}_#{n}" end
    robot = <<119, 9, "rover7_ab">>
    <<131, state::binary>> = :erlang.term_to_binary(%{offset_ms: 5, profile: nil})
    robots = <<131, 116, 1::32, robot::binary, state::binary>>
    told = &:erlang.term_to_binary({:convoy_robots, 8, &1, robots})

    assert {:error, "begins with something" <> _} = Recording.read_robots(told.([]))
    assert {:ok, %{} = read, 998} = Recording.read_robots(told.(["rover7_ab", "base9_ab@hall"]))
    assert [{id, %{offset_ms: 5}}] = Map.to_list(read)
    assert Atom.to_string(id) == "rover7_ab"

    for {name, line} <- [
          {"two words_ab", "names what is no name"},
          {String.duplicate("long_ab", 20), "names what is no name"},
          {<<255, "ab">>, "names what is no name"}
        ] do
      assert {:error, told} = Recording.read_robots(told.([name]))
      assert String.starts_with?(told, line)
      refute atom?(name)
    end

    assert {:error, line} = Recording.read_robots(told.(new.("many", 30)), 10)
    assert line == "has more than 1000 names that this program does not know"
    assert Enum.count(new.("many", 30), &atom?/1) == 10
  end

  defp atom?(text) do
    is_atom(String.to_existing_atom(text))
  rescue
    ArgumentError -> false
  end
end
