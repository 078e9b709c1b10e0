defmodule Lab.Trial.MarksTest do
  @moduledoc "Marks that hang in the world of a run, from the camera to what a robot perceives."
  use ExUnit.Case, async: true
  alias Lab.{Recording, Replay, Trial}
  alias Vision.Marks

  @why_not (case Marks.available() do
              :ok -> nil
              {:error, line} -> line
            end)

  @options %{
    robots: [:mag1, :mag2],
    landmark: :none,
    seed: 4,
    marks: [
      size: 0.3,
      at: [{3, {1.5, 0.0, 180}}, {3, {-1.5, 0.0, 0}}, {8, {0.0, 1.5, -90}}, {8, {0.0, -1.5, 90}}]
    ]
  }

  defp run(options, ticks) do
    {:ok, setup} = Trial.setup(options)
    trial = Trial.begin(setup, record: true)

    {ticks, trial} =
      Enum.map_reduce(1..ticks, trial, fn _tick, trial ->
        {entries, trial} = trial |> Trial.step() |> Trial.take_entries()
        {{trial.at_ms, entries}, trial}
      end)

    {setup, ticks, trial}
  end

  defp seen(ticks) do
    for {_at_ms, entries} <- ticks,
        {:step, id, {:detections, seen}, _effects} <- entries,
        do: {id, seen}
  end

  @tag skip: @why_not
  test "robots see them with the picture, and none where they look for none" do
    {_setup, ticks, _trial} = run(@options, 60)
    all = seen(ticks)
    assert Enum.all?(all, fn {_id, seen} -> is_list(seen.marks) end)
    marks = for {_id, seen} <- all, mark <- seen.marks, do: mark
    assert Enum.uniq(for mark <- marks, do: mark.id) -- [3, 8] == []
    assert length(marks) > 30
    assert Enum.all?(marks, &(&1.range > 0.0 and &1.range_sd > 0.0 and &1.at_ms >= 0))

    {_setup, ticks, _trial} = run(%{@options | marks: nil}, 5)
    assert Enum.all?(seen(ticks), fn {_id, seen} -> seen.marks == nil end)
  end

  @tag skip: @why_not
  test "a recorded run with marks replays to the byte" do
    {setup, ticks, trial} = run(@options, 60)
    {:ok, setup} = Recording.read_start(Recording.start(setup))

    {differences, replay} =
      Enum.flat_map_reduce(ticks, Replay.new(setup), fn tick, replay ->
        {:ok, tick} = tick |> Recording.tick() |> Recording.read_tick()
        {replay, differences} = Replay.step(replay, tick)
        {differences, replay}
      end)

    assert differences == []
    assert Replay.trial(replay).members == trial.members
    assert Replay.trial(replay).schedules == trial.schedules
  end

  test "what cannot hang, or cannot be seen, is one line" do
    error = fn options ->
      with {:ok, _} <- Trial.setup(Map.merge(@options, options)), do: :none
    end

    assert {:error, line} = error.(%{blobs: :direct})
    assert line =~ "trial option marks are seen in painted pictures only, blobs: :painted"
    assert {:error, line} = error.(%{marks: [size: 1, at: [{:three, {0, 0, 0}}]]})
    assert line =~ "marks.at"

    if @why_not,
      do: assert({:error, @why_not} == error.(%{})),
      else:
        assert(
          {:error, "tag36h11 has no mark 587"} ==
            error.(%{marks: [size: 1, at: [{587, {0, 0, 0}}]]})
        )
  end
end
