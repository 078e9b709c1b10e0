defmodule Lab.Scenario.FileTest do
  use ExUnit.Case, async: true
  alias Lab.Scenario
  doctest Lab.Scenario
  doctest Lab.Check.Expectation
  doctest Lab.Scenario.File
  doctest Lab.Scenario.Names
  doctest Lab.Scenario.Runner
  doctest Lab.Scenario.Text
  doctest Lab.Trial.Event
  doctest Lab.Trial.Faults
  doctest Lab.Trial.Form
  doctest Lab.Trial.Script

  defp line(text) do
    assert {:error, [line]} = Scenario.File.parse(text, "a.exs")
    line
  end

  # Text, what the line begins with, what it says.
  @bad [
    {"", "a.exs:1: ", "is empty"},
    {"[robots: 2", "a.exs:1: ", "missing terminator"},
    {"[robots: halt()]", "a.exs:1: ", "a scenario holds values only"},
    {"{1, 2}", "a.exs:1: ", "a scenario is one list"},
    {"[robot: 2]", "a.exs:1: robot: ", "did you mean robots?"},
    {"[robots: 0]", "a.exs:1: robots: ", "a number of robots, 1 to 100, or a list"},
    {"[robots: [:mag1, :mag1]]", "a.exs:1: robots: ", ", got [:mag1, :mag1]"},
    {"[robots: [:nobody_knows_him]]", "a.exs:1: robots: ", "[:nobody_knows_him]"},
    {"[noise: :of]", "a.exs:1: noise: ", "did you mean :off?"},
    {"[\n script: 5]", "a.exs:2: script: ", ", got 5"},
    {"[script: [\n {:reset}]]", "a.exs:2: script.1: ", "{at_s, event}"},
    {"[script: [{5, {:kil, :mag1}}]]", "a.exs:1: script.1: ", "did you mean kill?"},
    {"[script: [{5, {:kill}}]]", "a.exs:1: script.1: ", "expected {:kill, robot}, got {:kill}"},
    {"[script: [{5, {:kill, :mag9}}]]", "a.exs:1: script.1: ", "a robot of this run, or :leader"},
    {"[script: [{5, {:kill, 5}}]]", "a.exs:1: script.1.robot: ", "a robot of this run"},
    {"[script: [{-5, {:reset}}]]", "a.exs:1: script.1.at_s: ", "a number from 0"},
    {"[script: [{500, {:reset}}]]", "a.exs:1: script.1: ", "the run ends after 120 s"},
    {"[script: [{5, {:loss, 2}}]]", "a.exs:1: script.1.share: ", "a number from 0 to 1"},
    {"[script: [{5, {:move, 3}}]]", "a.exs:1: script.1.place: ", "{x, y} in metres"},
    {"[script: [{5, {:freeze, :mag1, 0}}]]", "a.exs:1: script.1.for_s: ", "from 0.1"},
    {"[script: [{5, {:cut, [[:mag1], [:mag9]]}}]]", "a.exs:1: script.1: ", "groups of robots"},
    {"[script: [{5, {:cut, {:link, :mag1, :mag1}}}]]", "a.exs:1: script.1: ", "groups of robots"},
    {"[script: [{5, {:tell, :mag1, \"goto:1\"}}]]", "a.exs:1: script.1.command: ",
     "y is missing"},
    {"[script: [{5, {:tell, :mag1, \"ping\"}}]]", "a.exs:1: script.1.command: ", "one of move"},
    {"[script: [{5, {:tell, :mag1, \"followtheleader:mag9\"}}]]", "a.exs:1: script.1: ",
     "one of mag1"},
    {"[script: [{5, {:tell, :mag1, {:formation, :lin, 1}}}]]",
     "a.exs:1: script.1.command.formation: ", "did you mean :line?"},
    {"[robots: 1,\n cuts: [{1, 2, [[:mag9]]}]]", "a.exs:2: cuts: ",
     "with robots of this run, got"},
    {"[kills: [\n {:mag9, 3}]]", "a.exs:2: kills.1: ",
     "or :leader, got {:mag9, 3}; did you mean"},
    {"[seed: 1,\n hardware: [:mag1]]", "a.exs:2: hardware: ", "no run in lockstep has hardware"},
    {"[expect: [{:formd, by_s: 5}]]", "a.exs:1: expect.1: ", "did you mean formed?"},
    {"[expect: [{:formed}]]", "a.exs:1: expect.1.by_s: ", "is missing"},
    {"[expect: [{:formed, by: 5}]]", "a.exs:1: expect.1.by: ", "did you mean by_s?"},
    {"[expect: [{:formed, by_s: 500}]]", "a.exs:1: expect.1: ", "the run ends after 120 s"},
    {"[expect: [{:formed, by_s: 5, after_s: 9}]]", "a.exs:1: expect.1: ",
     "an end after the beginning"},
    {"[expect: [{:still, :mag9, from_s: 1, to_s: 2}]]", "a.exs:1: expect.1: ",
     ":mag9 is no robot of this run; did you mean :mag"},
    {"[expect: [{:at, :all, {1, 1}, within_m: 1, by_s: 2}]]", "a.exs:1: expect.1.robot: ",
     "a robot of this run"},
    {"[expect: [{:phase, :all, :laed, by_s: 2}]]", "a.exs:1: expect.1.phase: ",
     "did you mean :lead?"},
    {"[seed: 1,\n expect: [{:never, :too_fats}]]", "a.exs:2: expect.1.invariant: ",
     "crash, got :too_fats; did you mean :too_fast?"},
    {"[expect: [\n {:never, 5}]]", "a.exs:2: expect.1.invariant: ", "expected :two_leaders, "},
    {"[expect: [{:never}]]", "a.exs:1: expect.1: ", "expected {:never, invariant}, got {:never}"},
    {"[expect: [{:never, :crash, to_s: 5}]]", "a.exs:1: expect.1: ",
     "expected {:never, invariant}"}
  ]

  # What only the map shows: known when a file is opened.
  @unfit [
    {"[seed: 1,\n map: \"nowhere\"]", "2: map: expected hall, ", "got nowhere"},
    {"[seed: 1,\n map: \"no/such.yaml\"]", "2: map: ", "no/such.yaml: no such file"},
    {"[seed: 1,\n landmark: {99, 0}]", "2: landmark: ", "cannot stand at 99.0,0.0"},
    {"[seed: 1,\n moves: [{{99, 0}, 3}]]", "2: moves: ", "cannot stand at 99,0"},
    {"[script: [{1, :reset},\n {5, {:move, {99, 0}}}]]", "2: script.2: ", "cannot stand at"},
    {"[script: [\n {5, {:displace, :mag1, {99, 0, 0}}}]]", "2: script.1: ", "there is a wall"}
  ]

  @tag :tmp_dir
  test "what the map refuses is told with its line, too", %{tmp_dir: folder} do
    file = Path.join(folder, "a.exs")

    for {text, begins, says} <- @unfit do
      File.write!(file, text)
      assert {:error, [line]} = Scenario.File.load(file)
      assert String.starts_with?(line, "#{file}:#{begins}"), line
      assert line =~ says
    end
  end

  test "robots have the floor plan, as in the demo, unless they make a map or the file says otherwise" do
    plan = fn text ->
      {:ok, scenario} = Scenario.File.parse(text)
      Scenario.trial(scenario).plan
    end

    assert plan.("[robots: 2]") == :known
    assert plan.("[robots: 2, plan: :sonar]") == :sonar
    assert plan.("[robots: 2, mission: :patrol]") == :known
    assert plan.("[robots: 2, mission: :explore]") == :none
    assert plan.("[robots: 2, mission: {:explore, []}]") == :none
  end

  for {text, begins, says} <- @bad do
    test "#{text} is refused in one line" do
      {text, begins, says} = unquote(Macro.escape({text, begins, says}))

      case Scenario.File.parse(text, "a.exs") do
        {:error, [line | _]} ->
          assert String.starts_with?(line, begins), line
          assert line =~ says
          refute line =~ "robot file"

        other ->
          flunk("#{text} was read: #{inspect(other)}")
      end
    end
  end

  test "a key that is given twice, and a file that is none, are named" do
    assert line("[seed: 1,\n seed: 2]") =~ "a.exs:2: seed: is given twice"
    assert {:error, [line]} = Scenario.File.load(System.tmp_dir!())
    assert line =~ "is a directory"
  end

  test "no file makes an atom" do
    for n <- 1..50, do: Scenario.File.parse("[robots: [:mag#{1000 + n}x], frob#{n}: :zork#{n}]")

    # Not by their number: what other tests load makes some meanwhile.
    for n <- 1..50,
        name <- ["mag#{1000 + n}x", "frob#{n}", "zork#{n}"],
        do: assert_raise(ArgumentError, fn -> String.to_existing_atom(name) end)
  end

  # Each scenario has some of everything that a file can say.
  test "what is written is read back as it was" do
    for _ <- 1..200 do
      count = Enum.random(1..12)
      robots = Enum.take(Scenario.Names.all(), count)
      robot = Enum.random(robots)

      scenario = [
        about: Enum.random(["", "A \"word\" and a \\ and \#{this}", "größer"]),
        options:
          Enum.take_random(
            [
              seed: :rand.uniform(1000),
              loss: :rand.uniform(),
              noise: :slip,
              landmark: Enum.random([:none, {1, 2.5}]),
              formation: {:wedge, 1.25},
              lost_link: :hold,
              moves: [{{1, 2.0}, 3}],
              kills: Enum.random([[leader: 9], [leader: 9, leader: 30]]),
              cuts: [{1, :end, [[robot], []]}]
            ],
            3
          ) ++ [robots: Enum.random([count, robots]), duration_s: 100],
        script:
          Enum.take_random(
            [
              {1, {:kill, :leader}},
              {:rand.uniform() * 100, {:displace, robot, {1.5, -2, 90}}},
              {2, :reset},
              {2, {:tell, :all, {:formation, :line, 2}}},
              {3.25, {:tell, robot, "goto:1:2"}},
              {4, {:cut, {:way, :mag1, robot}}},
              {5, {:freeze, robot, 2}}
            ],
            3
          )
          |> Enum.reject(&match?({_, {:cut, {:way, r, r}}}, &1)),
        expect:
          Enum.take_random(
            [
              {:never, :collision},
              {:formed, by_s: 60},
              {:at, robot, {1, 2}, within_m: 0.25, by_s: 50},
              {:never_phase, :all, :lead},
              {:speed_at_most, 1, to_s: 5}
            ],
            3
          )
      ]

      case Scenario.new(scenario) do
        {:ok, scenario} ->
          text = Scenario.File.text(scenario)
          assert Scenario.File.parse(text) == {:ok, scenario}
          assert text == text |> Code.format_string!() |> IO.iodata_to_binary() |> Kernel.<>("\n")

        # One of the robots may be too few.
        {:error, line} ->
          assert line =~ ": expected "
      end
    end
  end
end
