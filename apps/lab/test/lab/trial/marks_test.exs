defmodule Lab.Trial.MarksTest do
  @moduledoc "Marks that hang in the world of a run, from the camera to what a robot perceives."
  use ExUnit.Case, async: true
  alias Lab.Trial
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

  # What the robots' cameras show in a run of so many ticks.
  defp seen(options, ticks) do
    {:ok, setup} = Trial.setup(options)
    trial = Enum.reduce(1..ticks, Trial.begin(setup, record: true), fn _, t -> Trial.step(t) end)
    {entries, _trial} = Trial.take_entries(trial)
    for {:step, id, {:detections, seen}, _effects} <- entries, do: {id, seen}
  end

  @tag skip: @why_not
  test "robots see them with the picture, and none where they look for none" do
    all = seen(@options, 60)
    assert Enum.all?(all, fn {_id, seen} -> is_list(seen.marks) end)
    marks = for {_id, seen} <- all, mark <- seen.marks, do: mark
    assert Enum.uniq(for mark <- marks, do: mark.id) -- [3, 8] == []
    assert length(marks) > 30
    assert Enum.all?(marks, &(&1.range > 0.0 and &1.range_sd > 0.0 and &1.at_ms >= 0))

    none = seen(%{@options | marks: nil}, 5)
    assert none != [] and Enum.all?(none, fn {_id, seen} -> seen.marks == nil end)
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
