defmodule Console.ScenarioTest do
  # It captures what goes to stderr, which is one device for all tests.
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Console.Runs
  alias Console.Scenario.{Options, Session}
  doctest Console.Scenario.Options
  doctest Console.Scenario.Recording
  doctest Console.Scenario.Report
  @moduletag :tmp_dir

  defp file(folder, name, text) do
    path = Path.join(folder, name)
    File.write!(path, text)
    path
  end

  defp session(files, quiet? \\ false),
    do: with_io(fn -> Session.run(%Options{files: files, quiet: quiet?}) end)

  @holds "[robots: 1, duration_s: 1, expect: [{:never, :collision}, {:phase, :mag1, :search, by_s: 1}]]"
  @fails "[about: \"Too early.\", robots: 1, duration_s: 1, expect: [{:never, :collision}, {:formed, by_s: 0.5}]]"

  test "a scenario that holds ends with 0, and prints stages and expectations", %{tmp_dir: folder} do
    {status, text} = session([file(folder, "a.exs", @holds)])
    assert status == 0
    assert text =~ "1 robot (mag1) in hall, seed 1"
    assert text =~ ~r/ 0\.0 s  search /
    assert text =~ ~r/ 1\.0 s  held    \{:never, :collision\}: to the end of the run/
    assert text =~ "a.exs: 2 expectations held, after 1.0 s"
    refute text =~ "\e["
  end

  test "one that fails ends with 2, and names expectation, time and figures", %{tmp_dir: folder} do
    {status, text} = session([file(folder, "a.exs", @fails)])
    assert status == 2
    assert text =~ "a.exs: Too early."

    assert text =~
             "0.5 s  FAILED  {:formed, by_s: 0.5}: not in formation: no robot leads; mag1 search"

    assert text =~ "a.exs: 1 of 2 expectations failed, after 1.0 s"
  end

  test "the recording of one that fails replays, and reaches what failed", %{tmp_dir: folder} do
    files = [file(folder, "holds.exs", @holds), file(folder, "fails.exs", @fails)]
    {status, text} = with_io(fn -> Session.run(%Options{files: files, record: folder}) end)
    assert status == 2
    path = Path.join(folder, "fails.mcap")
    assert text =~ "Recorded it: mix replay #{Path.relative_to_cwd(path)} --at 0.5\n"
    assert Path.wildcard(Path.join(folder, "*.mcap")) == [path]
    assert Runs.replayed_ms(path) >= 500
  end

  test "a recording that cannot be written is said, in one line", %{tmp_dir: folder} do
    options = %Options{files: [file(folder, "b.exs", @fails)], record: Path.join(folder, "none")}
    {{:error, [line]}, _text} = with_io(fn -> Session.run(options) end)
    assert line =~ ~r"^--record .*none/b.mcap cannot be written: no such file or directory$"
  end

  test "several run side by side and are printed in their order", %{tmp_dir: folder} do
    files =
      for {name, text} <- [a: @holds, b: @fails, c: @holds], do: file(folder, "#{name}.exs", text)

    {status, text} = session(files)
    assert status == 2
    assert [a, b, c] = for(name <- ~w(a b c), do: elem(:binary.match(text, "#{name}.exs: "), 0))
    assert a < b and b < c
    assert text =~ ~r/1 of 3 scenarios failed: .*b\.exs\n$/

    {2, quiet} = session(files, true)
    assert [failed, summary, total] = String.split(quiet, "\n", trim: true)
    assert failed =~ "FAILED"
    assert summary =~ "b.exs: 1 of 2"
    assert total =~ "1 of 3 scenarios failed"
  end

  test "the command exits with the status, and says what is wrong with its input", %{
    tmp_dir: folder
  } do
    task = fn arguments ->
      told =
        capture_io(:stderr, fn ->
          capture_io(fn ->
            ended =
              catch_exit(
                (
                  Mix.Tasks.Scenario.run(arguments)
                  exit(:well)
                )
              )

            send(self(), {:ended, ended})
          end)
        end)

      receive do: ({:ended, how} -> {how, told})
    end

    # All tests that run meanwhile share the standard error.
    assert {:well, told} = task.([file(folder, "a.exs", @holds)])
    refute told =~ "scenario: "
    assert {{:shutdown, 2}, told} = task.([file(folder, "b.exs", @fails), "--record", folder])
    refute told =~ "scenario: "
    wrong = file(folder, "c.exs", "[robots: 1,\n script: [{5, {:kill, :mag2}}]]")
    assert {{:shutdown, 1}, told} = task.([wrong])

    assert told =~
             "scenario: #{wrong}:2: script.1: expected a robot of this run, or :leader, got {:kill, :mag2}"

    nowhere = file(folder, "d.exs", "[map: \"mars\"]")
    assert {{:shutdown, 1}, told} = task.([nowhere])
    assert told =~ "scenario: #{nowhere}:1: map: expected"
    assert {{:shutdown, 1}, told} = task.([])
    assert told =~ "a file is missing"
    assert {{:shutdown, 1}, told} = task.(["--quite"])
    assert told =~ "did you mean --quiet?"
  end

  test "the help is printed" do
    text = capture_io(fn -> Mix.Tasks.Scenario.run(["--help"]) end)
    assert text =~ "mix scenario FILE..."
    assert text =~ "--quiet"
  end
end
