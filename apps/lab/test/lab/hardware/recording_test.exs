defmodule Lab.Hardware.RecordingTest do
  @moduledoc """
  Missions of robots of processes with the real drivers, on emulated devices, recorded and replayed:
  every decision of their roles must be the same again.
  """
  use ExUnit.Case, async: false
  import Swarm.Case, only: [eventually: 1, order: 1]
  alias Record.{Recorder, Recording, Replay}
  alias Lab.Fleet
  @moduletag :realtime
  @moduletag :capture_log
  @moduletag :tmp_dir

  # Runs a mission of two robots until so many ms, and returns what its replay has compared.
  defp mission(path, seed, until_ms, deeds) do
    robots = [:mag71, :min71]
    {:ok, _apps} = Application.ensure_all_started(:swarm)
    {:ok, recorder} = Recorder.start_link(robots: robots, file: [path: path])

    {:ok, fleet} =
      Fleet.start_link(
        robots: robots,
        hardware: robots,
        seed: seed,
        landmark: {1.0, 1.0},
        noise: :slip,
        trace: {Recorder, :trace, []}
      )

    for {at_ms, deed} <- deeds do
      reached(fleet, at_ms)
      assert order(fn -> deed.(fleet) end) == :ok
    end

    reached(fleet, until_ms)
    Fleet.stop(fleet)
    assert %{lost: 0, failed: nil} = Recorder.status(recorder)
    assert Recorder.close(recorder) == :ok

    {:ok, file} = Recording.File.open(path)
    assert file.whole?
    {replay, differences} = Record.Replayed.replay(file)
    assert differences == []
    counts = Replay.counts(replay)
    assert length(counts) == 8

    for {{_robot, role}, count} <- counts do
      # One that is not called to stop has nothing to do.
      assert role == :estop or (count.decisions > 0 and count.inputs > 0)
      assert %{lost: 0, skipped: 0} = count
    end

    {file, counts}
  end

  defp reached(fleet, at_ms), do: eventually(fn -> Fleet.scene(fleet).at_ms >= at_ms end)

  defp sum(counts, what),
    do: counts |> Enum.map(fn {_key, count} -> count[what] end) |> Enum.sum()

  test "a mission with real drivers replays with equal decisions", %{tmp_dir: folder} do
    # The reset ends the repeats of the call, which would stop robots of the next test.
    stopped = [
      {3_000, fn _fleet -> Swarm.estop() end},
      {3_500, fn _fleet -> Swarm.reset() end}
    ]

    {file, counts} = mission(Path.join(folder, "run.mcap"), 1, 4_000, stopped)
    assert sum(counts, :decisions) > 300
    assert [_one, _other] = for({{_robot, :estop}, %{decisions: n}} <- counts, n > 0, do: n)

    # An effect that is changed by the least that a float can be is found.
    entries = Enum.to_list(Recording.File.entries(file))
    drives? = &match?({:mag71, {:gate, :effect, {:drive, %{turn: turn}, _}, _}} when turn > 0, &1)
    at = Enum.find_index(entries, drives?)
    {id, {role, kind, {:drive, twist, limits}, at_ms}} = Enum.at(entries, at)
    <<bits::64>> = <<twist.turn::float>>
    <<next::float>> = <<bits + 1::64>>
    changed = {id, {role, kind, {:drive, %{twist | turn: next}, limits}, at_ms}}

    found =
      entries
      |> List.replace_at(at, changed)
      |> Enum.reduce({Replay.new(), []}, fn entry, {replay, found} ->
        {replay, difference} = Replay.step(replay, entry)
        {replay, found ++ List.wrap(difference)}
      end)
      |> elem(1)

    assert [%{robot: :mag71, role: :gate, at_ms: ^at_ms}] = found
  end

  @tag long: true, realtime: :long
  test "so do ten missions, in which robots are stopped, commanded and killed", %{tmp_dir: folder} do
    deeds = [
      [],
      [
        {8_000, fn _fleet -> Swarm.estop() end},
        {10_000, fn _fleet -> Swarm.reset() end},
        # Each resumes the mission that the stop has ended.
        {12_000, fn _fleet -> Swarm.tell(:all, "start") end}
      ],
      [{8_000, &Fleet.kill(&1, :min71)}],
      [{8_000, fn _fleet -> Swarm.formation(:line, spacing: 1.5) end}],
      [{6_000, &Fleet.move_landmark(&1, {2.0, -1.0})}],
      [{8_000, fn _fleet -> Swarm.tell([:mag71], "stop") end}],
      [{8_000, fn _fleet -> crash(:mag71, :executive) end}],
      [{8_000, fn _fleet -> crash(:min71, :gate) end}],
      [{8_000, fn _fleet -> Swarm.tell([:mag71], "goto:1:1") end}],
      [{5_000, fn _fleet -> crash(:min71, :pilot) end}, {9_000, &Fleet.kill(&1, :mag71)}]
    ]

    figures =
      for {deeds, seed} <- Enum.with_index(deeds, 1) do
        path = Path.join(folder, "run-#{seed}.mcap")
        {file, counts} = mission(path, seed, 15_000, deeds)
        minutes = 2 * (file.end_ms - file.start_ms) / 60_000
        size = File.stat!(path).size

        {sum(counts, :inputs), sum(counts, :decisions), sum(counts, :checked),
         size / minutes / 1.0e3}
      end

    IO.puts("\ninputs, decisions, checkpoints, kB a robot and minute: #{inspect(figures)}")
    assert length(figures) == 10
  end

  defp crash(id, role) do
    true = Process.exit(Robot.Names.whereis(id, role), :kill)
    :ok
  end
end
