defmodule Tools.ReplayGiverTest do
  @moduledoc "`mix replay --why` says who commanded."
  use Swarm.Case, async: false
  import ExUnit.CaptureIO
  alias Record.Recorder
  alias Tools.Replay
  @moduletag :realtime
  @moduletag :tmp_dir
  @moduletag :capture_log

  defp ticks(id, count) do
    {:ok, _raw, before_ms} = Board.fetch(Board.find!(id), :doing, :infinity)

    eventually(fn ->
      {:ok, _raw, at_ms} = Board.fetch(Board.find!(id), :doing, :infinity)
      at_ms >= before_ms + 100 * count
    end)
  end

  test "the last order is told with its giver and what came of it", %{tmp_dir: folder} do
    path = Path.join(folder, "run.mcap")
    options = [robots: [:given2], file: [path: path]]
    recorder = start_supervised!(%{id: :recorder, start: {Recorder, :start_link, [options]}})
    id = robot(:given2, trace: {Recorder, :trace, [:given2]})
    assert Swarm.by("page 127.0.0.1:5123", fn -> Swarm.goto(id, {1.0, 1.0}) end) == :ok
    ticks(id, 3)
    stop_supervised!(id)
    assert Recorder.close(recorder) == :ok

    {:ok, options} = Replay.Options.parse([path, "--why", "given2"])
    assert {0, text} = with_io(fn -> Replay.run(options) end)

    assert text =~
             ~r/^given2 at .*\nlast order:\n  goto 1.0 1.0 by page 127.0.0.1:5123 at \d\.\d s, obeyed\nperceived:$/m
  end
end
