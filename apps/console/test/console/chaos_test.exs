defmodule Console.ChaosTest do
  # It captures what goes to stderr, which is one device for all tests.
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Console.{Chaos, Runs}
  alias Console.Chaos.{Options, Report}
  alias Console.Scenario
  alias Console.Scenario.Session
  alias Lab.Check.Violation

  doctest Console.Chaos.Options
  doctest Console.Cli.Progress

  # Two robots for a few seconds; every third run cannot be made.
  defp draw(_seed, number) when rem(number, 3) == 0, do: [robots: [:mag1], duration_s: :long]

  defp draw(seed, _number),
    do: [robots: [:mag1, :mag2], seed: seed, blobs: :direct, duration_s: 2]

  defp chaos(line, words \\ [], draw \\ &draw/2) do
    {:ok, options} = Options.parse(OptionParser.split(line) ++ words)
    with_io(fn -> Chaos.run(options, draw: draw) end)
  end

  defmodule Raising do
    @moduledoc "A mission that raises after a second."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(robot, _options), do: {:idle, robot, []}

    @impl Robot.Mission
    def handle({:tick, %{at_ms: at_ms}}, _robot) when at_ms >= 1_000, do: raise("out of order")
    def handle(_event, robot), do: {:search, robot, []}
  end

  test "every option is understood" do
    assert {:ok, options} =
             Options.parse(
               ~w(--run 17 --seed 9 --attempts 0 --jobs 2 --json - --keep fresh-folder)
             )

    assert %Options{run: 17, seed: 9, attempts: 0, jobs: 2, json: "-", keep: "fresh-folder"} =
             options

    assert Options.numbers(options) == 17..17
    assert {:ok, %Options{help: true}} = Options.parse(["-h"])

    for option <- ~w(runs seed run attempts jobs json keep mission),
        do: assert(Options.help() =~ "--#{option} ")
  end

  test "what is wrong with the input is one line each, with what may have been meant" do
    assert {:error, lines} = Options.parse(~w(--rusn 3 --seed x --json no/such/folder/a.json))

    assert lines == [
             "unknown option --rusn; did you mean --runs?",
             ~s(--seed: expected a whole number from 0 to 4294967295, got "x"),
             ~s(--json: expected a file in a folder that exists, got "no/such/folder/a.json")
           ]
  end

  test "another mission is named with its options, or refused in one line" do
    assert {:ok, %Options{mission: {"patrol:period=90", {Missions.Patrol, own}}}} =
             Options.parse(~w(--mission patrol:period=90))

    assert own[:period] == 90
    assert {:error, [line]} = Options.parse(~w(--mission patrl))
    assert line =~ ~r/^--mission: mission "patrl" is not known; .*did you mean patrol\?$/
  end

  test "clean runs end with 0 and a table" do
    assert {0, text} = chaos("--runs 2")
    assert text =~ "| runs | 2 |"
    assert text =~ "| collision | none |"
    refute text =~ "\e["
  end

  @tag :tmp_dir
  test "a violation ends with 2, one line, a scenario and its place in the report", %{
    tmp_dir: folder
  } do
    json = Path.join(folder, "chaos.json")
    assert {2, text} = chaos("--runs 3 --attempts 2", ["--json", json])
    assert [line] = text |> String.split("\n") |> Enum.filter(&(&1 =~ ~r/^run /))

    assert line =~
             ~r/run 3: crash at 0\.0 s, the run: not a run: trial option duration_s: expected .*, got :long/

    assert line =~ "(mix chaos --seed 1 --run 3)"
    assert text =~ "| crash | runs 3 |"
    assert File.read!(json) =~ ~s("clean":false)
    assert File.read!(json) =~ ~s("runs":3)
  end

  # In one run somebody puts a robot in the way of another one, which cannot brake so soon; the next one raises.
  defp wrong(_seed, 1) do
    [
      robots: [:mag1, :mag2, :min1],
      landmark: :none,
      blobs: :direct,
      duration_s: 12,
      script: [
        {0, {:displace, :mag1, {-3, 0, 0}}},
        {0, {:tell, :mag1, "move:0.5:0"}},
        {4, {:displace, :mag2, {-0.8, 0, 0}}}
      ]
    ]
  end

  defp wrong(_seed, 2),
    do: [robots: [:mag1, :min1], blobs: :direct, duration_s: 5, mission: Raising]

  @tag :tmp_dir
  test "what is kept fails in mix scenario, in the same words, and its recording ends there", %{
    tmp_dir: folder
  } do
    assert {2, text} = chaos("--runs 2 --attempts 8", ["--keep", folder], &wrong/2)
    files = Path.wildcard(Path.join(folder, "*.exs"))

    assert [{1, "collision"}, {2, "crash"}] =
             for({file, n} <- Enum.with_index(files, 1), do: {n, invariant(file)})

    for file <- files do
      {2, told} = with_io(fn -> Session.run(%Scenario.Options{files: [file], record: nil}) end)

      assert [_all, words] = Regex.run(~r/FAILED  \{:never, :#{invariant(file)}\}: (.+)\n/, told)
      assert text =~ ~r/: #{invariant(file)} at \d/
      # What the run was when it was smallest.
      assert told =~ "Shrunk: #{words}."
      recording = Path.rootname(file) <> ".mcap"
      assert Runs.replayed_ms(recording) > 0
    end
  end

  defp invariant(file), do: file |> Path.basename(".exs") |> String.split("-") |> List.last()

  test "a file that cannot be written ends with 1 before anything is played" do
    error =
      capture_io(:stderr, fn ->
        assert Chaos.run(%Options{runs: 1, json: "/proc/none/a.json"}, draw: &draw/2) == 1
      end)

    assert error =~ ~r/^chaos: --json \/proc\/none\/a.json cannot be written: .*\n$/
  end

  test "with --json - only the report goes to standard output" do
    told = capture_io(:stderr, fn -> send(self(), chaos("--runs 1 --json -")) end)
    assert_received {0, text}
    assert [json] = String.split(text, "\n", trim: true)
    assert json =~ ~s("figures":)
    assert told =~ "| runs | 1 |"
  end

  test "a failure says how small it became" do
    violation = Violation.new(:stuck, 45_000, [:min1], "1.20 m off")

    failure = %{
      number: 4,
      violation: violation,
      smallest: [
        robots: [:mag1, :min1],
        kills: [],
        cuts: [{1, 2, {:link, :mag1, :min1}}],
        duration_s: 46
      ],
      again: violation,
      attempts: 12
    }

    assert Report.failure("--seed 7", failure) ==
             "run 4: stuck at 45.0 s, min1: 1.20 m off (mix chaos --seed 7 --run 4); " <>
               "shrunk to 2 robots, 1 event, 46 s"
  end
end
