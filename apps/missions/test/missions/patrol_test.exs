defmodule Missions.PatrolTest do
  use ExUnit.Case, async: true
  alias Hal.{Options, Pose, Profile}
  alias Missions.Patrol
  alias Missions.Patrol.Motivation
  alias Robot.Mission.{Letter, Runner}
  alias Robot.Percept
  doctest Motivation
  doctest Patrol.Ages
  doctest Patrol.Auction
  doctest Patrol.Options

  @tau_ms 5_000

  defp task(number, options \\ []),
    do: Enum.into(options, %{number: number, needed?: true, far: 2.0})

  defp peer(doing, options \\ []),
    do: Enum.into(options, %{at_ms: 0, doing: doing, far: 1.0, busy_ms: 0})

  # From 100 ms on, each 100 ms; `peers` as they are at a time.
  defp run(motivation, ms, tasks, peers) do
    Enum.reduce(1..div(ms, 100)//1, motivation, fn n, motivation ->
      Motivation.tick(motivation, :mag1, tasks, peers.(n * 100), n * 100, 100)
    end)
  end

  test "a task is taken after theta/fast, none whose sensors say no, and none beside another" do
    nobody = fn _now -> %{} end

    assert %{active: nil, m: %{0 => +0.0}} =
             run(%Motivation{}, 60_000, [task(0, needed?: false)], nobody)

    assert %{active: 0} = run(%Motivation{}, 5_000, [task(0), task(1, far: 9.0)], nobody)

    assert %{active: 0, m: %{1 => +0.0}} =
             run(%Motivation{}, 9_000, [task(0), task(1, far: 9.0)], nobody)
  end

  test "who hears that another is at it waits, but not for ever, and takes over from one that fell silent" do
    speaks = fn now -> %{mag2: peer(0, at_ms: now, busy_ms: now)} end
    assert %{active: nil} = run(%Motivation{}, 29_000, [task(0)], speaks)
    assert %{active: 0} = run(%Motivation{}, 35_000, [task(0)], speaks)
    silent = fn _now -> %{mag2: peer(0)} end
    assert %{active: nil} = run(%Motivation{}, @tau_ms, [task(0)], silent)
    assert %{active: 0} = run(%Motivation{}, Motivation.takeover_ms(), [task(0)], silent)
  end

  test "a robot resets a task once, so that one that comes and goes holds nobody up for ever" do
    flickers = fn now ->
      %{mag2: peer(if(rem(div(now, 1_000), 2) == 0, do: 0), at_ms: now, far: 3.0)}
    end

    assert %{active: 0} = run(%Motivation{}, 20_000, [task(0)], flickers)
  end

  test "of two at one task the farther gives way, and one that gets nowhere does, too" do
    at_it = %Motivation{active: 0, since_ms: 0}
    nearer = fn now -> %{mag2: peer(0, at_ms: now, far: 1.0)} end
    farther = fn now -> %{mag2: peer(0, at_ms: now, far: 3.0)} end
    assert %{active: nil} = run(at_it, 100, [task(0)], nearer)
    assert %{active: 0} = run(at_it, 30_000, [task(0)], farther)
    assert %{active: nil} = run(at_it, 30_100, [task(0)], farther)
    assert %{active: 0} = run(at_it, 60_000, [task(0)], fn _now -> %{} end)
    assert %{active: nil} = run(at_it, 60_100, [task(0)], fn _now -> %{} end)
  end

  test "by auction each takes what it is nearest to, and what is taken is not sold twice" do
    alias Missions.Patrol.Auction
    tasks = [task(0, far: 3.0), task(1, far: 4.0)]
    bids = %{mag2: %{0 => 1.0, 1 => 9.0}}
    free = %{mag2: peer(nil)}
    tick = fn m, peers, bids, now -> Auction.tick(m, :mag1, tasks, peers, now, bids).active end
    assert tick.(%Motivation{}, free, bids, 0) == 1

    # One whose place is not known bids nothing; one that is silent is not there; one that has a point bids for none.
    assert tick.(%Motivation{}, free, %{}, 0) == 0
    assert tick.(%Motivation{}, free, bids, @tau_ms) == 0
    assert tick.(%Motivation{}, %{mag2: peer(0)}, bids, 0) == 1
    # What two took at once is the nearer one's.
    assert tick.(%Motivation{active: 0}, %{mag2: peer(0, far: 1.0)}, bids, 0) == 1
  end

  test "by rules the nearest free robot helps one that is silent or stuck first, and says why" do
    alias Missions.Patrol.Helping
    tasks = [task(0, far: 3.0), task(1, far: 4.0)]

    tick = fn m, peers, bids, now ->
      {motivation, why} = Helping.tick(m, :mag1, tasks, peers, now, bids)
      {motivation.active, why}
    end

    # The nearest point; a silent robot's first; not one at which a robot is, until that has been there for 30 s.
    assert {0, [line | because]} = tick.(%Motivation{}, %{}, %{}, 0)
    assert line == ~s|take(mag1, 0), by "the nearest free robot takes a point that is due"|
    assert "  due(0)" in because and "  near(3.0, mag1, 0)" in because
    silent = %{mag2: peer(1, at_ms: 0)}
    assert {1, [line | because]} = tick.(%Motivation{}, silent, %{}, @tau_ms)
    assert line =~ "the nearest free robot helps"
    assert Enum.any?(because, &(&1 =~ "silent(mag2, 1)"))
    busy = fn ms -> %{mag2: peer(0, far: 5.0, busy_ms: ms)} end
    assert {1, _why} = tick.(%Motivation{}, busy.(29_000), %{}, 0)
    assert {0, [_take | because]} = tick.(%Motivation{}, busy.(30_000), %{}, 0)
    assert Enum.any?(because, &(&1 =~ "visits(mag2, 0, 30)"))

    # A nearer free robot helps; one whose place is not known does not.
    near = %{mag3: %{0 => 1.0, 1 => 1.0}}
    both = Map.put(silent, :mag3, peer(nil, at_ms: @tau_ms))
    assert {0, _why} = tick.(%Motivation{}, both, near, @tau_ms)
    assert {1, _why} = tick.(%Motivation{}, both, %{}, @tau_ms)

    # One that has a point keeps it, and draws no conclusion.
    assert {0, nil} = tick.(%Motivation{active: 0}, silent, %{}, @tau_ms)
  end

  test "by rules a robot takes a point in a fleet of two hundred, where all points are due and a silent robot was at each" do
    alias Missions.Patrol.Helping
    tasks = for number <- 0..63, do: task(number, far: 1.0 + number)
    free = for n <- 64..199, into: %{}, do: {:"r#{n}", peer(nil, at_ms: @tau_ms)}
    silent = for n <- 0..63, into: %{}, do: {:"r#{n}", peer(n, at_ms: 0)}
    bids = Map.new(free, fn {id, _peer} -> {id, Map.new(0..63, &{&1, 80.0})} end)
    peers = Map.merge(free, silent)
    assert {%{active: 0}, why} = Helping.tick(%Motivation{}, :mag1, tasks, peers, @tau_ms, bids)
    assert hd(why) =~ "helps"
  end

  test "by rules a robot says why it took its point" do
    {runner, _effects} = tick(patrol(by: :rules), 0)
    {runner, _effects} = tick(runner, 100)
    why = for {"took it because", line} <- Patrol.explain(runner.mission), do: line
    assert [~s|take(mag1, | <> _, "near(" <> _, "due(" <> _] = why
  end

  defp patrol(options \\ []) do
    {:ok, options} = Options.check(options, Patrol.option_table(), "patrol")
    {runner, []} = Runner.start(Runner.new(:mag1), Patrol, options)
    {runner, []} = Runner.handle(runner, {:command, :start})
    runner
  end

  defp tick(runner, at_ms, pose \\ Pose.new(0, 0)) do
    percept = %Percept{robot: :mag1, at_ms: at_ms, profile: Profile.magellan(), pose: pose}
    Runner.handle(runner, {:tick, percept})
  end

  defp said(runner, fields) do
    {_runner, effects} = tick(runner, 0)
    {:send, :all, %Letter{} = letter} = List.keyfind(effects, :send, 0)
    %{letter | fields: Keyword.merge(letter.fields, fields)}
  end

  defp hear(runner, letter),
    do: Runner.handle(runner, {:message, %{from: :mag2, kind: :mission, body: letter, hops: 0}})

  test "what another has seen counts; junk, another version and other points do not" do
    {runner, _effects} = tick(patrol(), 0)
    fresh = said(patrol(), ages: List.duplicate(100, 8), point: 3)
    {heard, []} = hear(runner, fresh)
    assert %{3 => -100} = heard.mission.seen
    assert %{mag2: %{doing: 3}} = heard.mission.peers
    assert heard.refused == 0

    for junk <- [
          put_in(fresh.fields[:point], 64),
          put_in(fresh.fields[:point], :here),
          put_in(fresh.fields[:ages], [1 | 2]),
          put_in(fresh.fields[:ages], List.duplicate(-1, 8)),
          %{fresh | fields: []},
          %{fresh | fields: Keyword.put(fresh.fields, :more, 1)},
          %{fresh | fields: 5},
          %{fresh | kind: :other},
          %{fresh | version: 2},
          %{fresh | mission: Missions.Landmark},
          Map.put(fresh, :extra, 1)
        ] do
      {refused, []} = hear(runner, junk)
      assert {refused.mission, refused.refused} == {runner.mission, 1}, inspect(junk)
    end

    # They are well made, but about others.
    for other <- [put_in(fresh.fields[:plan], 5), put_in(fresh.fields[:ages], [1])] do
      {same, []} = hear(runner, other)
      assert {same.mission, same.refused} == {runner.mission, 0}
    end
  end

  test "messages of other missions do not reach it, nor any robot that is idle" do
    runner = patrol()
    {same, []} = Runner.handle(runner, {:message, %{from: :mag2, kind: :round, body: :letter}})
    assert {same.mission, same.refused} == {runner.mission, 1}
    assert Runner.handle(Runner.new(:mag1), {:message, %{from: :mag2}}) == {Runner.new(:mag1), []}
  end

  test "however many robots speak, it remembers a bounded number, and forgets the silent" do
    {runner, _effects} = tick(patrol(), 0)
    letter = said(patrol(), [])

    crowd =
      for n <- 1..400, reduce: runner do
        runner ->
          elem(
            Runner.handle(
              runner,
              {:message, %{from: :"crowd#{n}", kind: :mission, body: letter}}
            ),
            0
          )
      end

    assert map_size(crowd.mission.peers) == 256
    {alone, _effects} = tick(crowd, 60_000)
    assert alone.mission.peers == %{}
  end

  test "a point that it cannot reach is left to others, and it says why" do
    {runner, _effects} =
      Enum.reduce(0..60, {patrol(), []}, fn n, {runner, _} -> tick(runner, n * 100) end)

    assert %{motivation: %{active: point}, visits: 1} = runner.mission
    assert point != nil
    {runner, []} = Runner.handle(runner, {:outcome, {:visit, 1, point}, 0})
    {runner, _effects} = tick(runner, 6_100)
    assert %{phase: :watch, blocked_by: "no way to point " <> _} = runner.claim

    {later, _effects} =
      Enum.reduce(62..200, {runner, []}, fn n, {runner, _} -> tick(runner, n * 100) end)

    assert later.mission.motivation.active not in [nil, point]
  end

  test "a stop leaves it ready for the next start, with the points that it had" do
    runner = patrol(loop: :line)

    {runner, _effects} =
      Enum.reduce(0..60, {runner, []}, fn n, {runner, _} -> tick(runner, n * 100) end)

    assert {:ok, resumed} = runner |> Runner.halt() |> Runner.resume()
    assert resumed.mission.points == runner.mission.points
    {resumed, []} = Runner.handle(resumed, {:command, :start})
    assert Runner.state(resumed) == {Patrol, :watch}
  end
end
