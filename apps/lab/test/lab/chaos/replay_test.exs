defmodule Lab.Chaos.ReplayTest do
  @moduledoc """
  Recordings of runs that were drawn at random replay to the byte. `CHAOS_REPLAYS=100` plays more, and with `FIGURES=1` it
  prints what was replayed.
  """
  use Lab.LockstepCase, async: true
  alias Lab.Chaos.Draw
  alias Lab.{Recording, Replay, Trial}

  @moduletag :long
  @moduletag timeout: 3_600_000
  @seed 7

  # The recording of a run, as bytes, and the trial at its end.
  defp record(setup), do: record(Trial.begin(setup, record: true), [])

  defp record(trial, ticks) do
    if Trial.done?(trial) do
      {Enum.reverse(ticks), trial}
    else
      {entries, trial} = trial |> Trial.step() |> Trial.take_entries()
      record(trial, [Recording.tick({trial.at_ms, entries}) | ticks])
    end
  end

  defp replay(setup, ticks) do
    Enum.flat_map_reduce(ticks, Replay.new(setup), fn bytes, replay ->
      {:ok, tick} = Recording.read_tick(bytes)
      {replay, differences} = Replay.step(replay, tick)
      {differences, replay}
    end)
  end

  defp same(number) do
    Trial.Memory.prepare()
    {:ok, setup} = Trial.setup(Map.new(Draw.options(@seed, number)))
    {ticks, trial} = record(setup)
    {differences, replay} = replay(setup, ticks)
    assert {number, differences} == {number, []}
    replayed = Replay.trial(replay)
    assert replayed.world == trial.world
    assert replayed.members == trial.members
    assert Trial.result(replayed) == Trial.result(trial)

    minutes = length(setup.options.robots) * trial.at_ms / 60_000

    %{
      inputs: replay.inputs,
      minutes: minutes,
      bytes: ticks |> Enum.map(&byte_size/1) |> Enum.sum()
    }
  end

  test "thirty recordings of runs that were drawn at random replay to the byte" do
    last = String.to_integer(System.get_env("CHAOS_REPLAYS", "30"))

    replayed =
      1..last
      |> Task.async_stream(&same/1, timeout: :infinity)
      |> Enum.map(fn {:ok, figures} -> figures end)

    if System.get_env("FIGURES") do
      [inputs, minutes, bytes] =
        for key <- [:inputs, :minutes, :bytes],
            do: replayed |> Enum.map(&Map.fetch!(&1, key)) |> Enum.sum()

      IO.puts(
        "#{last} runs, #{inputs} inputs, #{round(minutes)} robot-minutes, #{round(bytes / minutes / 1000)} kB a robot-minute"
      )
    end
  end
end
