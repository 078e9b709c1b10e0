defmodule Tools.ReplayLiveTest do
  # What is written to standard error by others would be heard, too.
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Console.{Demo, Live, Options, Runs}
  alias Tools.Replay
  alias Record.Recording
  alias Lab.Replay.{Cursor, Kind}
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

  defp record(path, more \\ "") do
    line = "--headless --hardware 1 --robots 2 --duration 3 " <> more
    options = Runs.options(line, ["--record", path])
    assert Options.real_time?(options)
    stop = [stop: &Lab.Fleet.stop/1]
    heard(fn -> Live.Recording.run(options, &Demo.run(&1, Lab.Fleet, stop)) end)
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
    assert text =~ ~r/^    2.0 s  2 robots, \d with the landmark in sight, no leader$/m
    assert text =~ ~r/^mag1: search at .*; runs Missions.Landmark; drives .*s$/m
    assert text =~ "Poses are those that the robots believe to have.\n"
    assert text =~ ~r/^mag1 at 1\.[89] s$/m
    for title <- ~w(perceived wishes gate mission), do: assert(text =~ ~r/^#{title}.*:$/m)
    assert text =~ "<- chosen"

    for {words, said} <- [
          {["--csv", "/proc/none/tables"], "--csv /proc/none/tables cannot be written: "},
          {["--against", "/proc/none.mcap"], "/proc/none.mcap"},
          {~w(--why leadr),
           "--why names no robot of the recording: leadr; allowed are leader, mag1, min1"},
          {~w(--robot mag), "--robot names no robot of the recording: mag"},
          {~w(--at 99), "--at 99.0 is after the end of the recording"}
        ] do
      assert {1, "", "replay: " <> error} = replay(path, words)
      assert error =~ said
      assert length(String.split(error, "\n", trim: true)) == 1
    end

    assert {0, text, ""} = replay(path, ~w(--at 0.5 --why leader))
    assert text =~ "There is no leader at this time.\n"
    gone_through(path)
    tabulated(path, Path.join(folder, "tables"))
    assert {0, text, ""} = replay(path, ["--against", path])
    assert text =~ ~r/^The two are the same, \d\.\d s of them\.$/m

    # As a kill -9 leaves it.
    bytes = File.read!(path)
    cut = Path.join(folder, "cut.mcap")
    File.write!(cut, binary_part(bytes, 0, div(byte_size(bytes) * 2, 3)))
    assert {0, text, ""} = replay(cut)
    assert text =~ "(not ended in order: read as far as it is whole)"
    assert text =~ "are as recorded."
    assert {2, text, ""} = replay(path, ["--against", cut])
    assert text =~ ~r/^The two are the same until one ends, after \d\.\d s\.$/m
  end

  test "what a mission draws is in a replay of live robots, on the page of the chosen one, too",
       %{
         tmp_dir: folder
       } do
    path = Path.join(folder, "patrol.mcap")
    assert {_status, _text, ""} = record(path, "--mission patrol --landmark none")
    {:ok, file} = Recording.File.open(path)
    start = Lab.Replay.Robots.new(file)
    # Nobody draws, and no shape is known, before anything was heard.
    assert %{layer: [], formation: nil} = Kind.scene(start)
    ticks = Enum.to_list(Recording.File.ticks(file))
    {_all, last} = Enum.map_reduce(ticks, start, &forwards/2)
    assert [{:points, "points" <> _, points}] = Kind.scene(last).layer
    assert length(points) == 8
    assert [{:points, _name, ^points}] = Lab.Replay.Robots.layer(last, :mag1)

    {:ok, recording} = Replay.Recording.open(path)

    live = :proc_lib.spawn_link(fn -> Replay.Live.loop(Replay.Live.new([recording], 0, nil)) end)

    eventually = fn ->
      {:ok, _at} = Replay.Live.answer(live, "goto 2")
      match?(%{layer: [%{kind: :points, points: [_ | _]}]}, Replay.Live.about(live, :mag1))
    end

    Swarm.Case.eventually(eventually)
    Replay.Live.close(live)
  end

  # Forwards and backwards, and at each place as it was on the way there.
  defp gone_through(path) do
    typed = "show\nwhy mag1\nnext\nprevious\ngoto 2\nback 3\nstep 3\ngoto 0\nwhy\ngoto 2\n"
    {:ok, options} = Replay.Options.parse([path, "--step", "--at", "2"])
    {status, text} = with_io(typed, fn -> Replay.run(options) end)
    assert status == 0
    assert text =~ ~r/^mag1: search at .*; runs Missions.Landmark; drives/m
    assert text =~ "<- chosen"
    assert text =~ ~r/ search +every robot looks around for the landmark$/m
    assert text =~ "1.7 s> step 3\n    2.0 s  2 robots"
    assert text =~ "0.0 s> why\nNothing had been decided yet.\n"
    assert [_one] = text |> lines_at("2.0 s") |> Enum.uniq()

    {:ok, file} = Recording.File.open(path)
    ticks = Enum.to_list(Recording.File.ticks(file))
    assert Enum.flat_map(ticks, &elem(&1, 1)) == Enum.to_list(Recording.File.entries(file))
    times = Enum.map(ticks, &elem(&1, 0))
    assert times == Enum.uniq(Enum.sort(times)) and Enum.all?(times, &(rem(&1, 100) == 0))

    for from_ms <- Enum.take_every(0..Recording.File.last_ms(file), 73) do
      later = for {at_ms, _entries} = tick <- ticks, at_ms >= from_ms, do: tick
      assert Enum.to_list(Recording.File.ticks(file, from_ms: from_ms)) == later
    end

    differs(file)
  end

  defp lines_at(text, time),
    do: for(line <- String.split(text, "\n"), line =~ ~r/^ +#{time}  \d robots/, do: line)

  # The cursor is at each place what a replay is that only goes forwards; one effect that is lost is told once.
  defp differs(file) do
    ticks = Enum.to_list(Recording.File.ticks(file))
    start = Lab.Replay.Robots.new(file)
    {all, _last} = Enum.map_reduce(ticks, start, &forwards/2)
    from = fn ticks -> fn ms -> Enum.filter(ticks, &(elem(&1, 0) >= ms)) end end
    cursor = Cursor.new(start, from.(ticks), every: 4, most: 3)

    for {count, place} <- [{20, 20}, {-7, 13}, {4, 17}, {-17, 0}, {9, 9}], reduce: cursor do
      cursor ->
        assert {cursor, []} = Cursor.step(cursor, count)
        assert cursor.here.replay == if(place == 0, do: start, else: Enum.at(all, place - 1))
        cursor
    end

    {lost, _found?} =
      Enum.map_reduce(ticks, false, fn {at_ms, entries}, found? ->
        at = Enum.find_index(entries, &match?({:mag1, {:gate, :effect, {:drive, _, _}, _}}, &1))

        if not found? and at_ms > 500 and at != nil,
          do: {{at_ms, List.delete_at(entries, at)}, true},
          else: {{at_ms, entries}, found?}
      end)

    cursor = Cursor.new(start, from.(lost))
    assert {cursor, [{:decision, difference}]} = Cursor.step(cursor, 25)
    assert %{robot: :mag1, role: :gate, recorded: [], replayed: [{:drive, _, _}]} = difference
    assert difference.at_ms in 400..1_500
    assert {cursor, []} = Cursor.step(cursor, -25)
    assert {_cursor, []} = Cursor.step(cursor, 25)
  end

  defp forwards(tick, replay) do
    assert {next, []} = Kind.step(replay, tick)
    {next, next}
  end

  defp tabulated(path, folder) do
    assert {0, _text, ""} = replay(path, ["--csv", folder])

    tables =
      for name <- ~w(poses errors ticks messages events), into: %{} do
        text = File.read!(Path.join(folder, name <> ".csv"))
        {name, for(row <- String.split(text, "\r\n", trim: true), do: String.split(row, ","))}
      end

    for {_name, [header | rows]} <- tables, row <- rows, do: assert(length(row) == length(header))
    # A tick that was cut by the end may be without a drive.
    moving = Enum.filter(tables["poses"], &match?({_speed, ""}, Float.parse(Enum.at(&1, 7))))
    assert length(moving) > 20
    assert [_at_s, id, "true", phase, x, _y, _heading, _speed, _turn] = List.last(tables["poses"])
    assert id in ~w(mag1 min1) and phase in ~w(search agree lead follow)
    assert {_x, ""} = Float.parse(x)
    assert [_at_s, ^id, "", "", "", within] = List.last(tables["errors"])
    assert {_within, ""} = Float.parse(within)
    assert [_header, ["0.1", "", "0", "false", "", ""] | _] = tables["ticks"]
    assert Enum.any?(tables["events"], &match?([_at_s, "search", "", _facts], &1))
    assert [["at_s", "from", "to", "kind"] | _] = tables["messages"]
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
      {:ok, live} = Live.Trial.start_recorded(setup, Console.Pace.new(:max), recorder)
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
  defp written(folder, robots, entries, ns \\ 0) do
    path = Path.join(folder, "made.mcap")
    {about, trace, encoding} = Recording.topics()
    {writer, head} = Mcap.Writer.new([])
    {robots_id, writer} = Mcap.Writer.channel(writer, about, encoding, nil)
    {trace_id, writer} = Mcap.Writer.channel(writer, trace, encoding, nil)
    {writer, one} = Mcap.Writer.message(writer, robots_id, ns, robots)
    {bytes, _names} = Recording.trace(entries, %{}, MapSet.new())
    {writer, two} = Mcap.Writer.message(writer, trace_id, ns, bytes)
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

  test "two recordings are compared by the time since their start, of one kind alone", %{
    tmp_dir: folder
  } do
    one = compared(folder, "one", 0, 0.5)
    later = compared(folder, "later", 7_000, 0.5)
    other = compared(folder, "other", 7_000, 0.25)
    assert {0, "The two are the same, 0.2 s of them.\n", ""} = replay(one, ["--against", later])

    assert {2, text, ""} = replay(one, ["--against", other])
    assert text =~ "The two part in the tick that ends at 0.20 s:\n"
    assert text =~ "  one:   0.10 s mag1, gate, effect: {:drive, %Hal.Twist{linear: 0.5, "
    assert text =~ "  other: 0.10 s mag1, gate, effect: {:drive, %Hal.Twist{linear: 0.25, "

    nobody = compared(folder, "nobody", 0, 0.5, [:mag2])
    assert {2, text, ""} = replay(one, ["--against", nobody])
    assert text == "The two begin differently: robots [:mag1] and [:mag2]\n"

    run = Path.join(folder, "run.mcap")
    demo = Runs.options("--headless --blobs direct --robots 1 --duration 1", ["--record", run])
    with_io(fn -> Demo.run(demo, Lab.Trial) end)

    for {one, other, kinds} <- [
          {one, run, "#{one} is of live robots, #{run} is of a run in lockstep"},
          {run, one, "#{run} is of a run in lockstep, #{one} is of live robots"}
        ] do
      assert replay(one, ["--against", other]) ==
               {1, "", "replay: --against needs two recordings of one kind: #{kinds}\n"}
    end
  end

  # A robot of another clock, which has heard the same at the same time since it began.
  defp compared(folder, name, from_ms, speed, robots \\ [:mag1]) do
    seen = fn at_ms -> {:cast, {:seen, %{at_ms: from_ms + at_ms}}} end

    entries =
      for id <- robots,
          {kind, what, at_ms} <- [
            {:input, seen.(-40), 0},
            {:effect, {:drive, Hal.Twist.zero(), []}, 0},
            {:input, seen.(60), 100},
            {:effect, {:drive, Hal.Twist.new(speed, 0.0), []}, 100}
          ],
          do: {id, {:gate, kind, what, from_ms + at_ms}}

    robots = Recording.robots(Map.new(robots, &{&1, %{offset_ms: 0, profile: nil}}), MapSet.new())
    made = written(folder, robots, entries, (from_ms + 1_000) * 1_000_000)
    path = Path.join(folder, name <> ".mcap")
    File.rename!(made, path)
    path
  end

  test "another version, and a file that cannot be made, are refused in one line", %{
    tmp_dir: folder
  } do
    for {version, ours, other} <- [{1, 8, 7}, {99, 8, 7}] do
      path = written(folder, :erlang.term_to_binary({:convoy_robots, version, %{}}), [])
      run = Path.join(folder, "run.mcap")
      {start, _ticks, encoding} = Lab.Recording.topics()
      {writer, head} = Mcap.Writer.new([])
      {id, writer} = Mcap.Writer.channel(writer, start, encoding, nil)
      bytes = :erlang.term_to_binary({:convoy, version, %{}})
      {writer, message} = Mcap.Writer.message(writer, id, 0, bytes)
      File.write!(run, [head, message, Mcap.Writer.finish(writer)])

      for {file, reads} <- [{path, ours}, {run, other}] do
        assert replay(file) ==
                 {1, "",
                  "replay: #{file} is a recording of version #{version}; this program reads version #{reads}\n"}
      end
    end

    options = Runs.options("--headless --hardware 1 --robots 1 --duration 1")
    options = %{options | record: "/proc/none.mcap"}
    assert {1, "", line} = heard(fn -> Live.Recording.run(options, fn _options -> 0 end) end)
    assert line =~ ~r/^demo: --record \/proc\/none.mcap cannot be written: .*\n$/
  end
end
