defmodule Console.ReplayLiveTest do
  # What is written to standard error by others would be heard, too.
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Console.{Demo, Live, Options, Replay, Runs}
  alias Robot.Recording
  @moduletag :realtime
  @moduletag :tmp_dir
  @moduletag :capture_log

  defp heard(function) do
    test = self()
    errors = capture_io(:stderr, fn -> send(test, {:ran, with_io(function)}) end)
    assert_received {:ran, {status, text}}
    {status, text, errors}
  end

  defp replay(path, words \\ []) do
    {:ok, options} = Replay.Options.parse([path | words])
    heard(fn -> Replay.run(options) end)
  end

  defp record(path) do
    options = Runs.options("--headless --hardware 1 --robots 2 --duration 3", ["--record", path])
    assert Options.real_time?(options)
    stop = [stop: &Sim.Fleet.stop/1]
    heard(fn -> Live.Recording.run(options, &Demo.run(&1, Sim.Fleet, stop)) end)
  end

  test "a live demo is recorded, and its robots replay one by one", %{tmp_dir: folder} do
    path = Path.join(folder, "live.mcap")
    # It stands for an older recording, which is overwritten.
    File.write!(path, "old")
    assert {2, text, ""} = record(path)
    assert text =~ "Wrote #{path}"

    assert {0, text, ""} = replay(path)
    assert text =~ "#{path}: 2 live robots (mag1, min1), "

    for id <- ~w(mag1 min1), role <- ~w(gate executive pilot) do
      assert text =~ ~r/^  #{id} +#{role} +\d+ inputs?, \d+ decisions? as recorded/m
    end

    assert text =~
             ~r/ s of mag1, min1 replayed: all \d+ decisions on \d+ inputs are as recorded\.$/m

    assert {0, text, ""} = replay(path, ~w(--robot min1 --until 1))
    assert text =~ ~r/ s of min1 replayed: all/
    refute text =~ "mag1   "

    assert {0, text, ""} = replay(path, ~w(--at 2 --why mag1))
    assert text =~ ~r/^mag1: search of Missions.Landmark; at \(/m
    assert text =~ "mag1 at 2.0 s"
    for title <- ~w(perceived wishes gate mission), do: assert(text =~ ~r/^#{title}.*:$/m)
    assert text =~ "<- chosen"

    for {words, said} <- [
          {["--csv", folder], "--csv needs a recording of a run in lockstep"},
          {["--against", path], "--against needs a recording of a run in lockstep"},
          {~w(--why leader),
           "--why names no robot of the recording: leader; allowed are mag1, min1"},
          {~w(--robot mag), "--robot names no robot of the recording: mag"},
          {~w(--at 99), "--at 99.0 is after the end of the recording"}
        ] do
      assert {1, "", "replay: " <> error} = replay(path, words)
      assert error =~ said
      assert length(String.split(error, "\n", trim: true)) == 1
    end

    # As a kill -9 leaves it.
    bytes = File.read!(path)
    cut = Path.join(folder, "cut.mcap")
    File.write!(cut, binary_part(bytes, 0, div(byte_size(bytes) * 2, 3)))
    assert {0, text, ""} = replay(cut)
    assert text =~ "(not ended in order: read as far as it is whole)"
    assert text =~ "are as recorded."
  end

  test "a recorder that crashes does not end the demo; the demo says so at its end", %{
    tmp_dir: folder
  } do
    path = Path.join(folder, "live.mcap")
    options = Runs.options("--headless --hardware 1 --robots 1 --duration 1", ["--record", path])

    play = fn %{robots: [robot]} ->
      {recorder, _queue} = Robot.Names.lookup(robot, :recorder)
      writer = Process.monitor(:sys.get_state(recorder).output.writer)
      monitor = Process.monitor(recorder)
      Process.exit(recorder, :kill)
      assert_receive {:DOWN, ^monitor, _, _, :killed}
      assert_receive {:DOWN, ^writer, _, _, :killed}
      0
    end

    assert {1, "", "demo: --record the recorder has ended before the run" <> _} =
             heard(fn -> Live.Recording.run(options, play) end)
  end

  test "a live run in lockstep is recorded with what people told it, and replays", %{
    tmp_dir: folder
  } do
    path = Path.join(folder, "lockstep.mcap")
    options = Runs.options("--robots 3 --speed max --duration 20", ["--record", path])

    play = fn _options, setup, recorder ->
      {:ok, live} = Live.Trial.start_recorded(setup, Live.Pace.new(:max), recorder)
      reached(live, 5_000)
      {:ok, _done} = Live.Trial.command(live, {:kill, :min1})
      {:ok, _done} = Live.Trial.command(live, {:formation, {:line, 1.5}})
      {:ok, _done} = Live.Trial.command(live, {:landmark, {2.0, 1.0}})
      reached(live, 20_000)
      Live.Trial.stop(live)
      0
    end

    assert {0, text, ""} = heard(fn -> Live.Recording.lockstep(options, play) end)
    assert text == "Wrote #{path}\n"
    assert {0, text, ""} = replay(path)
    assert text =~ "3 robots in hall, seed 1, 2"
    assert text =~ "min1 is dead"

    options = %{options | record: "/proc/none.mcap"}
    assert {1, "", line} = heard(fn -> Live.Recording.lockstep(options, play) end)
    assert line =~ ~r/^demo: --record \/proc\/none.mcap cannot be written: .*\n$/
  end

  defp reached(live, at_ms) do
    if Live.Trial.scene(live).at_ms < at_ms, do: reached(live, at_ms)
  end

  # A file with these messages on our topics.
  defp written(folder, robots, entries) do
    path = Path.join(folder, "made.mcap")
    {about, trace, encoding} = Recording.topics()
    {writer, head} = Mcap.Writer.new([])
    {robots_id, writer} = Mcap.Writer.channel(writer, about, encoding, nil)
    {trace_id, writer} = Mcap.Writer.channel(writer, trace, encoding, nil)
    {writer, one} = Mcap.Writer.message(writer, robots_id, 0, robots)
    {bytes, _names} = Recording.trace(entries, %{}, MapSet.new())
    {writer, two} = Mcap.Writer.message(writer, trace_id, 0, bytes)
    File.write!(path, [head, one, two, Mcap.Writer.finish(writer)])
    path
  end

  test "a difference is shown, and gives status 2; so does a file without a state", %{
    tmp_dir: folder
  } do
    config =
      struct!(Robot.Config, id: :mag1, profile: Hal.Profile.magellan(), drive: {Some.Drive, []})

    {gate, _effects} = Robot.Safety.Gate.init(config, %{}, 0)
    drive = {:drive, Hal.Twist.new(0.5, 0.0), []}
    robots = Recording.robots(%{mag1: %{offset_ms: 0, profile: nil}}, MapSet.new())

    entries = [
      {:mag1, {:gate, :begin, gate, 0}},
      {:mag1, {:gate, :input, :tick, 50}},
      {:mag1, {:gate, :effect, drive, 50}},
      {:mag1, {:gate, :input, :tick, 100}}
    ]

    assert {2, text, ""} = replay(written(folder, robots, entries))
    assert text =~ "The replay differs from the recording once, first in this:\n"
    assert text =~ "0.05 s mag1, gate, on :tick\n  did then: [{:drive, %Hal.Twist{linear: 0.5"
    assert text =~ "does now: [{:drive, %Hal.Twist{linear: 0.0, turn: 0.0}, [:dead_man]}]"

    assert {2, text, ""} = replay(written(folder, robots, tl(entries)))
    assert text =~ "3 entries NOT COMPARED"
    assert text =~ "Nothing could be compared"
    refute text =~ "are as recorded"

    lost = tl(entries) ++ [{:mag1, {:gate, :lost, 7, 120}}] ++ entries
    lost = Enum.reject(lost, &(&1 == {:mag1, {:gate, :effect, drive, 50}}))
    good = {:mag1, {:gate, :effect, {:drive, Hal.Twist.zero(), [:dead_man]}, 50}}
    assert {2, text, ""} = replay(written(folder, robots, Enum.drop(lost, -1) ++ [good]))
    assert text =~ "7 entries LOST, 2 entries NOT COMPARED"

    assert text =~
             "NOT ALL OF IT COULD BE COMPARED: 7 entries lost, 2 entries without a state before. " <>
               "What was compared is as recorded: 1 decision on 1 input."

    refute text =~ ": all "

    # A file of a folder begins in the middle: nothing is missing of it.
    middle = [{:mag1, {:gate, :input, :tick, 0}} | Enum.take(entries, 2)] ++ [good]
    assert {0, text, ""} = replay(written(folder, robots, middle))
    assert text =~ "1 entry before its first state"
    assert text =~ "replayed: all 1 decisions on 1 inputs are as recorded."
  end

  test "another version, and a file that cannot be made, are refused in one line", %{
    tmp_dir: folder
  } do
    newer = :erlang.term_to_binary({:convoy_robots, 99, %{}})
    path = written(folder, newer, [])

    assert replay(path) ==
             {1, "",
              "replay: #{path} is a recording of version 99; this program reads version 3\n"}

    options = Runs.options("--headless --hardware 1 --robots 1 --duration 1")
    options = %{options | record: "/proc/none.mcap"}
    assert {1, "", line} = heard(fn -> Live.Recording.run(options, fn _options -> 0 end) end)
    assert line =~ ~r/^demo: --record \/proc\/none.mcap cannot be written: .*\n$/
  end
end
