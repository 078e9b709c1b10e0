defmodule Tools.ReplayTest do
  # What is written to standard error by others would be heard, too.
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Console.{Demo, Runs}
  alias Tools.Replay
  doctest Tools.Replay.Options
  doctest Tools.Replay.Command

  @moduletag :tmp_dir

  defp record(folder, name, line, words \\ []) do
    path = Path.join(folder, name)
    options = Runs.options("--headless --blobs direct " <> line, ["--record", path | words])
    {_status, _text} = with_io(fn -> Demo.run(options, Lab.Trial) end)
    path
  end

  defp replay(path, line \\ "", words \\ []) do
    {:ok, options} = Replay.Options.parse([path | String.split(line)] ++ words)
    test = self()

    errors =
      capture_io(:stderr, fn -> send(test, {:ran, with_io(fn -> Replay.run(options) end)}) end)

    assert_received {:ran, {status, text}}
    {status, text, errors}
  end

  test "a recorded run replays with its stages, and is the same", %{tmp_dir: folder} do
    path = record(folder, "run.mcap", "--robots 3 --kill leader@15 --duration 25")
    assert {0, text, ""} = replay(path)
    assert text =~ "#{path}: 3 robots in hall, seed 1, 25.0 s\n"
    assert text =~ ~r/ killed .* is dead/
    assert text =~ ~r/25.0 s replayed: all \d+ decisions on \d+ inputs, .* are as recorded/

    assert {0, text, ""} = replay(path, "--until 5")
    assert text =~ "5.0 s replayed"
    refute text =~ "killed"

    # How the fleet stood, and why.
    assert {0, text, ""} = replay(path, "--at 14 --robot mag1")
    assert text =~ "   14.0 s  3 robots"
    assert text =~ ~r/^mag1: /m
    refute text =~ ~r/^mag2: /m

    assert {0, text, ""} = replay(path, "--at 14 --why leader")
    assert text =~ ~r/^m\w+ at 13.9 s$/m

    for title <- ["perceived", "wishes", "gate", "mission", "did"],
        do: assert(text =~ ~r/^#{title}.*:$/m)

    assert text =~ "<- chosen"
    assert text =~ ~r/leads epoch 1, elected with/
    assert text =~ ~r/round .*: committed, among mag1, mag2, min1/

    assert {0, text, ""} = replay(path, "--why mag1 --at 0")
    assert text =~ "Nothing had been decided yet."

    assert {1, "", "replay: --why names no robot of the recording: leadr; " <> line} =
             replay(path, "--why leadr")

    assert line == "allowed are leader, mag1, mag2, min1; did you mean leader?\n"
    assert {1, "", line} = replay(path, "--at 99")
    assert line == "replay: --at 99.0 is after the end of the recording, 25.0 s\n"
  end

  # A recording as the page asks for it.
  defp shown(paths, at_ms, parts) do
    recordings =
      for path <- paths do
        {:ok, recording} = Replay.Recording.open(path)
        recording
      end

    test = self()

    live =
      :proc_lib.spawn_link(fn ->
        send(test, {:closed, Replay.Live.loop(Replay.Live.new(recordings, at_ms, parts))})
      end)

    {live, read(live, Replay.Live.history(live, 0))}
  end

  defp read(_live, %{known_s: last_s, last_s: last_s} = history), do: history
  defp read(live, _history), do: read(live, Replay.Live.history(live, 0))

  test "a browser is shown any time of a run, and why a robot did what it did then", %{
    tmp_dir: folder
  } do
    path = record(folder, "run.mcap", "--robots 3 --kill leader@15 --duration 25")
    {live, history} = shown([path], 14_000, nil)
    stages = Enum.flat_map(history.entries, & &1.stages)
    assert [:search, :elected | _] = Enum.map(stages, & &1.stage)
    assert %{at_s: 15.0, robot: dead} = Enum.find(stages, &(&1.stage == :killed))
    assert [+0.0, 0.5, 1.0 | _] = Enum.map(history.entries, & &1.at_s)
    assert %{entries: [_last]} = Replay.Live.history(live, history.count - 1)

    # As far as was asked for, once it had been read.
    assert %{at_ms: 14_000, leader: ^dead} = Replay.Live.scene(live)
    assert %{left: 0} = Replay.Live.pace(live)
    assert {:ok, "15.1 s"} = Replay.Live.answer(live, "next")
    assert %{alive: false} = Enum.find(Replay.Live.scene(live).robots, &(&1.id == dead))
    assert {:ok, "15.0 s"} = Replay.Live.answer(live, "back")
    assert {:ok, "14.0 s"} = Replay.Live.answer(live, "goto 14")
    assert {:ok, why} = Replay.Live.answer(live, "why leader")
    assert Enum.any?(why, &(&1 =~ "<- chosen"))
    assert %{why: ^why, wishes: [_chosen | _]} = Replay.Live.about(live, dead)
    assert %{why: [_line]} = Replay.Live.about(live, :nobody_of_this_name)
    assert nil == Replay.Live.beside(live)

    # It goes on at its own pace, and stands at the end.
    assert {:ok, _said} = Replay.Live.answer(live, "goto 24.5")
    assert {:ok, _said} = Replay.Live.answer(live, "speed max")
    assert {:ok, _said} = Replay.Live.answer(live, "play")
    ended(live)
    assert %{at_ms: 25_000} = Replay.Live.scene(live)

    for {typed, line} <- [
          {"estop", "this is a recording: nothing in it can be told anything, or be stopped"},
          {"goto 26", ~s(goto: expected a number from 0 to 25.0, got "26")},
          {"next", "no event of the fleet is known there"},
          {"speed 0", ~s(speed: expected a number from 0.1 to 100, or max, got "0")}
        ],
        do: assert({:error, line} == Replay.Live.answer(live, typed))

    Replay.Live.close(live)
    assert_receive {:closed, false}
  end

  defp ended(live), do: unless(Replay.Live.pace(live).left == 0, do: ended(live))

  test "two runs are shown side by side, at one time", %{tmp_dir: folder} do
    one = record(folder, "one.mcap", "--robots 2 --duration 3")
    other = record(folder, "other.mcap", "--robots 2 --duration 2 --seed 2")
    {live, history} = shown([one, other], 0, {0, "they begin differently"})
    stages = Enum.flat_map(history.entries, & &1.stages)
    assert %{line: "they begin differently"} = Enum.find(stages, &(&1.stage == :parts))
    assert {:ok, "1.5 s"} = Replay.Live.answer(live, "goto 1.5")
    assert {1_500, 1_500} = {Replay.Live.scene(live).at_ms, Replay.Live.beside(live).at_ms}
    assert {:ok, "3.0 s"} = Replay.Live.answer(live, "goto 3")
    # The shorter one stands at its end.
    assert {3_000, 2_000} = {Replay.Live.scene(live).at_ms, Replay.Live.beside(live).at_ms}
    refute Replay.Live.scene(live).robots == Replay.Live.beside(live).robots
    Replay.Live.close(live)
    assert_receive {:closed, false}
  end

  defp step_through(path, line, typed) do
    {:ok, options} = Replay.Options.parse([path | String.split(line)])
    test = self()
    text = capture_io(typed, fn -> send(test, {:status, Replay.run(options)}) end)
    assert_received {:status, status}
    {status, text}
  end

  test "a person goes through a run forwards and backwards, and asks", %{tmp_dir: folder} do
    path = record(folder, "run.mcap", "--robots 3 --kill leader@15 --duration 25")

    assert {0, text} =
             step_through(path, "--step --at 14", """
             why
             step 2

             back 3
             next
             step
             previous
             previous
             show mag1
             gotto 3
             goto 30
             goto 25
             help
             """)

    assert text =~ "   14.0 s  3 robots"
    assert text =~ ~r/^m\w+ at 13.9 s$/m
    assert text =~ "<- chosen"
    # Two ticks, two again, three back.
    assert Regex.scan(~r/^(\d+\.\d) s> /m, text, capture: :all_but_first)
           |> List.flatten()
           |> Enum.take(5) == ~w(14.0 14.0 14.2 14.4 14.1)

    # The leader's death is told on the way there, and again by whoever comes back to it.
    assert [_next, _previous, _goto] = Regex.scan(~r/ killed .* is dead/, text)
    assert text =~ ~r/^mag1: /m
    assert text =~ ~s("gotto" is not known; did you mean goto?)
    assert text =~ ~s(goto: expected a number from 0 to 25.0, got "30")
    assert text =~ "   25.0 s  "
    assert text =~ "The recording ends here.\n"
    assert text =~ "next, previous    to the next event"

    assert {0, text} = step_through(path, "--step", "b\nwhy\nq\n")
    assert text =~ "    0.0 s  3 robots"
    assert text =~ "Nothing had been decided yet."

    assert {:error, ["--step cannot be used with --csv"]} =
             Replay.Options.parse(~w(run.mcap --step --csv tables))
  end

  test "two recordings are compared, and the tick is named in which they part", %{tmp_dir: folder} do
    one = record(folder, "one.mcap", "--robots 2 --duration 6 --landmark 1,1")
    same = record(folder, "same.mcap", "--robots 2 --duration 6 --landmark 1,1")
    other = record(folder, "other.mcap", "--robots 2 --duration 6 --landmark 1,1 --kill mag1@4")
    assert {0, text, ""} = replay(one, "", ["--against", same])
    assert text == "The two are the same, 6.0 s of them.\n"

    assert {2, text, ""} = replay(one, "", ["--against", other])
    assert text =~ "The two begin differently: kills [] and [mag1: 4.0]"
  end

  test "the tables of a run are those of its replay", %{tmp_dir: folder} do
    [run, again] = for name <- ["run", "again"], do: Path.join(folder, name)
    path = record(folder, "run.mcap", "--robots 3 --duration 12 --kill mag1@9", ["--csv", run])
    assert {0, _text, ""} = replay(path, "", ["--csv", again])

    for name <- ~w(poses errors ticks messages events) do
      text = File.read!(Path.join(run, name <> ".csv"))
      assert text == File.read!(Path.join(again, name <> ".csv"))
      [header | rows] = String.split(text, "\r\n", trim: true)
      assert String.starts_with?(header, "at_s,") and rows != []
      columns = length(String.split(header, ","))
      assert Enum.all?(rows, &(length(String.split(&1, ",")) == columns))
    end

    poses = File.read!(Path.join(run, "poses.csv"))
    assert length(String.split(poses, "\r\n", trim: true)) == 1 + 3 * 120
    assert File.read!(Path.join(run, "events.csv")) =~ ~r/^9\.0,killed,mag1,/m
  end

  test "tables that cannot be written are named", %{tmp_dir: folder} do
    path = record(folder, "run.mcap", "--robots 1 --duration 2")
    file = Path.join(folder, "file")
    File.write!(file, "")
    assert {:error, [line]} = Replay.Options.parse([path, "--csv", file])
    assert line =~ ~r/^--csv: expected a folder, not a file, got ".*$/
    assert {1, "", line} = replay(path, "--csv /proc/none/tables")
    assert line =~ ~r{^replay: --csv /proc/none/tables cannot be written: .*\n$}
  end

  test "what is no recording is refused in one line", %{tmp_dir: folder} do
    path = Path.join(folder, "none.mcap")
    assert {1, "", line} = replay(path)
    assert line =~ ~r/^replay: .*none.mcap.*\n$/
    File.write!(path, "this is a text")
    assert {1, "", line} = replay(path)
    assert line =~ ~r/^replay: .*none.mcap.*\n$/
  end

  test "a run that lockstep cannot make is not recorded" do
    assert Console.Options.parse(~w(--headless --nodes --record run.mcap)) ==
             {:error,
              [
                "--record cannot be used with --nodes: robots in processes of their own are not recorded"
              ]}

    for line <- ["--csv tables", "--headless --hardware 1 --csv tables"] do
      assert {:error, ["--csv needs --headless, without --nodes and --hardware"]} =
               line |> String.split() |> Console.Options.parse()
    end
  end
end
