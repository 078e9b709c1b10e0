defmodule Sim.Lidars.SessionsTest do
  @moduledoc "The sessions of lidars with emulators, in a time that a test tells: no process, no line."
  use ExUnit.Case, async: true
  alias Hal.{Lds, RPLidar, Scan}
  alias Sim.Emulator.Wire

  # What is d degrees to the left of ahead is 1 m + d cm away, but for a quarter where nothing is.
  defp around do
    rays = for d <- 0..359, into: <<>>, do: Scan.pack(if(d not in 200..289, do: 1.0 + d / 100))
    %Scan{start: 0.0, step: :math.pi() / 180, ranges: rays}
  end

  # Plays a session with an emulator for so long; returns its effects but what it wrote, the oldest first, and the emulator.
  defp play({session, options}, {emulator, emulated}, ms, wire \\ []) do
    {:ok, core} = emulator.new(emulated, 0)
    {:ok, wire} = Wire.new(wire)
    core = emulator.feel(core, {:scan, around()}, 0)
    {effects, s} = session.new(options, 0)

    {done, _s, core, _wire} =
      Enum.reduce(0..ms//5, {[], {s, effects}, core, wire}, fn at_ms,
                                                               {done, {s, effects}, core, wire} ->
        core =
          for {:write, bytes} <- effects,
              reduce: core,
              do: (core -> emulator.hear(core, bytes, at_ms))

        {said, [], core} = emulator.run(core, at_ms)
        {heard, wire} = wire |> Wire.put(said, at_ms) |> Wire.take(at_ms)
        {more, s} = if heard == <<>>, do: {[], s}, else: session.bytes(s, heard, at_ms)
        {late, s} = if session.wake_ms(s) <= at_ms, do: session.tick(s, at_ms), else: {[], s}
        effects = more ++ late
        told = Enum.reject(effects, &match?({:write, _}, &1))
        {Enum.reverse(told) ++ done, {s, effects}, core, wire}
      end)

    {Enum.reverse(done), core}
  end

  # The share of all rays that say what is not there, to 2 degrees and 1 cm; and of those that should say something, how many do.
  defp false_and_true(scan) do
    expected = fn direction ->
      for off <- [-2.0, -1.0, 0.0, 1.0, 2.0] do
        degrees = Integer.mod(round(direction * 180 / :math.pi() + off), 360)
        if degrees not in 200..289, do: 1.0 + degrees / 100
      end
    end

    echoes = Scan.echoes(scan, 60.0)

    wrong =
      Enum.count(echoes, fn {direction, range} ->
        not Enum.any?(expected.(direction), &(&1 != nil and abs(&1 - range) < 0.011))
      end)

    {wrong, length(echoes)}
  end

  @lidars [
    {{RPLidar.Session, []}, {Sim.Emulator.RPLidar, []}, 7},
    {{RPLidar.Session, mode: :standard}, {Sim.Emulator.RPLidar, []}, 7},
    {{RPLidar.Session, []}, {Sim.Emulator.RPLidar, turns: 10}, 14},
    {{Lds.Session, model: :lds01}, {Sim.Emulator.Lds, model: :lds01}, 7},
    {{Lds.Session, model: :lds02}, {Sim.Emulator.Lds, model: :lds02}, 7}
  ]

  test "each turn is a scan of what is around, with the angles to the left" do
    for {session, emulator, least} <- @lidars do
      {told, _core} = play(session, emulator, 2_000)
      scans = for {:scan, scan} <- told, do: scan
      assert length(told) == length(scans)
      assert length(scans) in least..(least + 6), inspect({session, emulator, length(scans)})

      for scan <- scans do
        {wrong, echoes} = false_and_true(scan)
        assert wrong == 0

        # Of 270 rays; the angles of an express scan are not even, and fewer in a faster turn, so that some rays get none.
        assert echoes > 180, inspect({session, emulator, echoes})
      end
    end
  end

  test "lost, doubled and flipped bytes cost measurements, and make few that are not there" do
    for {session, emulator, _least} <- @lidars do
      {told, _core} =
        play(session, emulator, 8_000, drop: 0.0005, double: 0.0005, flip: 0.0005, seed: 3)

      scans = for {:scan, scan} <- told, do: scan
      assert length(scans) > 15, inspect(session)
      assert [] == for({:error, _} = error <- told, do: error)
      {wrong, all} = scans |> Enum.map(&false_and_true/1) |> Enum.unzip()
      # Plain scans have no checksum: a flipped bit is a range.
      assert Enum.sum(wrong) / Enum.sum(all) < 0.01,
             inspect({session, Enum.sum(wrong), Enum.sum(all)})

      assert Enum.sum(all) / length(all) > 120, inspect({session, Enum.sum(all) / length(all)})
    end
  end

  test "an RPLIDAR that is not there, is faulty, or knows no express scan is told so" do
    dead = fn session, at_ms ->
      {effects, _s} = RPLidar.Session.tick(session, at_ms)
      effects
    end

    {_stop, s} = RPLidar.Session.new([], 0)
    {_info, s} = RPLidar.Session.tick(s, 100)
    assert dead.(s, 1_100) == [error: {:no_answer, :info}]

    express = {RPLidar.Session, []}

    assert {[{:error, {:fault, 7}} | _], _} =
             play(express, {Sim.Emulator.RPLidar, health: 2, healed: false}, 6_000)

    assert {[{:scan, _} | _], _} = play(express, {Sim.Emulator.RPLidar, health: 2}, 6_000)

    assert {[{:odd, warns}, {:scan, _} | _], _} =
             play(express, {Sim.Emulator.RPLidar, health: 1}, 3_000)

    assert warns =~ "code 7"

    assert {[{:odd, plain}, {:scan, _} | _], _} =
             play(express, {Sim.Emulator.RPLidar, express: false}, 3_000)

    assert plain =~ "plain"
  end

  test "silence is an error, and what stops a lidar stops it" do
    for {{session, options} = ours, {emulator, _} = theirs, _least} <- @lidars do
      {_told, core} = play(ours, theirs, 1_000)
      assert emulator.scans?(core)
      stopped = emulator.hear(core, session.stop(options), 1_000)
      # An LDS-02 turns as long as it has power.
      assert emulator.scans?(stopped) == (options[:model] == :lds02)
    end

    {_, s} = Lds.Session.new([model: :lds02], 0)
    assert {[], _} = Lds.Session.tick(s, 2_999)
    assert {[error: :silent], _} = Lds.Session.tick(s, 3_000)
  end

  test "upside down, left is right" do
    [{:scan, scan} | _] =
      elem(
        play(
          {Lds.Session, model: :lds02, upside_down: true},
          {Sim.Emulator.Lds, model: :lds02},
          1_000
        ),
        0
      )

    upright = %{scan | start: -scan.start, step: -scan.step}
    assert {0, echoes} = false_and_true(upright)
    assert echoes > 250
  end
end
