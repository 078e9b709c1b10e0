Code.require_file("lines.exs", __DIR__)

defmodule Demo.Case do
  @moduledoc "The demo as a command: what people type, what they get, and how it ends."
  use ExUnit.CaseTemplate
  import ExUnit.Assertions

  @root Path.expand("..", __DIR__)

  using do
    quote do
      import Demo.Case
      @root unquote(@root)
    end
  end

  @doc "Everything on standard output, everything on standard error, and the exit status."
  def run(command, arguments, options) do
    folder = Keyword.get(options, :cd, @root)
    errors = Path.join(System.tmp_dir!(), "convoy-#{System.unique_integer([:positive])}.err")
    input = Keyword.get(options, :input, "")

    script = ~s(printf '%s' "$INPUT" | "$COMMAND" "$@" 2>"$ERRORS")

    env =
      [{"INPUT", input}, {"COMMAND", command}, {"ERRORS", errors}] ++
        Keyword.get(options, :env, [])

    {output, status} = System.cmd("sh", ["-c", script, "sh" | arguments], cd: folder, env: env)
    told = File.read!(errors)
    File.rm!(errors)
    {output, told, status}
  end

  @doc "What a command that runs has printed, once this text is in it."
  def await(port, text, output) do
    if output =~ text do
      output
    else
      assert_receive {^port, {:data, more}}, 60_000
      await(port, text, output <> more)
    end
  end

  @doc "All that a command that runs has printed when it has ended, and its exit status."
  def ending(port, output) do
    receive do
      {^port, {:data, more}} -> ending(port, output <> more)
      {^port, {:exit_status, status}} -> {output, status}
    after
      60_000 -> flunk("the demo goes on: " <> output)
    end
  end

  @doc "The same of `mix demo`, with the arguments of a line."
  def demo(line, options \\ []), do: run("mix", ["demo" | OptionParser.split(line)], options)
end

defmodule System.DemoHardwareTest do
  # Not beside other demos: a robot with real drivers that gets no processor for 0.2 s loses its line.
  use Demo.Case, async: false
  @moduletag :realtime

  test "robots with real drivers find their place among the others, in real time" do
    line = "--headless --robots 2 --hardware mag:1,min:1 --blobs direct --seed 1"
    {output, told, status} = demo(line)
    assert {told, status} == {"", 0}, "status #{status}, #{told}#{output}"

    assert [_all, folder] =
             Regex.run(~r"mag1 has real drivers: its base on (/\S+)/mag1\.base", output)

    assert output =~ "min1 has real drivers"
    assert output =~ "In formation"
    assert output =~ "No collisions"
    assert output =~ "(1.0 times real time)"
    refute File.exists?(folder)
  end
end

defmodule System.DemoEndsTest do
  use Demo.Case, async: true
  @moduletag :realtime

  # The errors are read beside the output that ends, and among it.
  test "who reads no further is told nothing more" do
    for line <- ["--headless --robots 2 --duration 20", "--robots 2 --duration 20"] do
      command = ~s({ mix demo #{line} 2>&3 | head -n 1 >&4; } 3>&1 4>"$1")
      first = first()
      assert {"", 0} = System.cmd("sh", ["-c", command, "sh", first], cd: @root)
      assert File.read!(first) =~ "2 robots (mag1, min1) in hall"
      File.rm!(first)
    end

    command = "mix demo --headless --robots 2 --duration 20 2>&1 | head -n 1"
    {output, 0} = System.cmd("sh", ["-c", command], cd: @root)
    assert output =~ "2 robots (mag1, min1) in hall"
  end

  defp first,
    do:
      Path.join(System.tmp_dir!(), "convoy-#{System.pid()}-#{System.unique_integer([:positive])}")

  test "a full disk is an error of one line" do
    command = "mix demo --headless --robots 2 --duration 20 2>&1 >/dev/full; echo $?"
    {told, 0} = System.cmd("sh", ["-c", command], cd: @root)
    assert told == "demo: the output cannot be written: no space left on device\n1\n"
  end

  @tag :tmp_dir
  test "bin/demo takes the demo along when it is ended", %{tmp_dir: folder} do
    demo = Path.join(@root, "bin/demo")
    file = Path.join(folder, "out")

    script = """
    "$1" --robots 2 --duration 60 >"$2" 2>&1 </dev/null &
    p=$!; n=0
    until grep -qs 'landmark in sight' "$2"; do
      sleep 0.1; n=$((n + 1)); [ $n -lt 900 ] || { cat "$2"; exit 1; }
    done
    demo=$(cat /proc/$p/task/$p/children)
    kill -TERM $p; wait $p; echo $?
    for d in $demo; do kill -0 $d 2>/dev/null && echo "$d is left"; done
    exit 0
    """

    assert {"143\n", 0} = System.cmd("sh", ["-c", script, "sh", demo, file])
    refute File.read!(file) =~ "SIGTERM"
  end

  # `script` gives the command a terminal, where the system has some to give.
  terminal? =
    System.find_executable("script") != nil and
      match?({_, 0}, System.cmd("script", ["-qec", "true", "/dev/null"], stderr_to_stdout: true))

  if terminal? do
    test "live on a terminal: a full screen, given back at the end" do
      script = System.find_executable("script")
      demo = "mix demo --robots 2 --blobs direct"
      options = [:binary, :exit_status, cd: @root, env: [{~c"TERM", ~c"xterm"}]]
      spawn = {:spawn_executable, script}
      port = Port.open(spawn, [{:args, ["-qec", demo, "/dev/null"]} | options])

      output = await(port, "Try:  kill leader", "")
      Port.command(port, "kil\tmag1\r")
      output = await(port, "kill mag1: done", output)
      Port.command(port, <<3>>)
      {output, status} = ending(port, output)

      assert status == 0
      assert output =~ "\e[?1049h"
      assert output =~ "Convoy"
      assert output =~ "\e[?1049l"
      refute output =~ "** ("
    end
  end
end

defmodule System.DemoRefusesTest do
  use Demo.Case, async: true

  # A VM for all but the first.
  @lines [
    "--help",
    "--headless --map mix.exs.png:10x10",
    "--headless --map FOLDER/floor.png:10x10",
    "--headless --landmark 500,0",
    "--kill mag9@3",
    "--robots 2 --hardware min:2"
  ]

  setup_all do
    folder = Path.join(System.tmp_dir!(), "convoy-refuses-#{System.pid()}")
    File.mkdir_p!(folder)
    on_exit(fn -> File.rm_rf!(folder) end)
    File.write!(Path.join(folder, "floor.png"), "not a picture")

    lines =
      for line <- @lines,
          do: [
            "demo"
            | line |> OptionParser.split() |> Enum.map(&String.replace(&1, "FOLDER", folder))
          ]

    %{answers: Map.new(Enum.zip(@lines, Lines.run(lines, cd: @root)))}
  end

  test "the help names the options and ends well", %{answers: answers} do
    assert {help, "", 0} = answers["--help"]
    assert help =~ "--leader-change"
    assert help =~ "Exit status"
  end

  defp refused({output, told, status}, complaints) do
    assert {output, status} == {"", 1}
    for complaint <- complaints, do: assert(told =~ complaint)
    for line <- String.split(told, "\n", trim: true), do: assert(line =~ ~r/^demo: /)
    refute told =~ "** ("
    refute told =~ ".ex:"
  end

  # As many as one run complains of at once.
  test "refuses all that is wrong with its options, in clear words" do
    line =
      "--robots 0 --robots -3 --robots 1e9 --map moon --loss nan --headles --hardwear 1 " <>
        "--picture /no/such/place/a.svg"

    refused(demo(line), [
      ~s(--robots: expected a whole number from 1 to 1000, got "0"),
      ~s(--robots: expected a whole number),
      ~s(--robots: expected a whole number),
      ~s(--map: expected hall, hospital, arena, clinic, ),
      ~s(doorway, rooms, FILE.yaml, FILE.png:WIDTHxHEIGHT or FILE.pgm:WIDTHxHEIGHT, got "moon"),
      ~s(--loss: expected a number from 0 to 1, got "nan"),
      "did you mean --headless?",
      "did you mean --hardware?",
      "a folder that exists"
    ])
  end

  for {line, complaint} <- [
        {"--headless --map mix.exs.png:10x10", "mix.exs.png"},
        {"--headless --landmark 500,0", "landmark"},
        {"--kill mag9@3", ~s("mag9")},
        {"--robots 2 --hardware min:2", "--hardware min2 is more than there are"}
      ] do
    test("refuses #{line} in clear words", %{answers: answers},
      do: refused(answers[unquote(line)], [unquote(complaint)])
    )
  end

  test "a PNG that is no PNG is refused", %{answers: answers} do
    assert {"", told, 1} = answers["--headless --map FOLDER/floor.png:10x10"]
    assert told =~ "floor.png"
    refute told =~ "** ("
  end
end

defmodule System.DemoTest do
  use Demo.Case, async: true

  defp without_wall_time(json), do: String.replace(json, ~r/"wall_s":[^,]+,/, "")

  test "one seed, run twice: the same report to the byte, but for the wall time; another seed is another run" do
    line = "--headless --robots 3 --duration 20 --json - --seed "
    {first, told, status} = demo(line <> "4")

    # A VM for the other two, in another order: neither the VM nor what ran before in it is seen in a report.
    lines = for seed <- ~w(5 4), do: ["demo" | OptionParser.split(line <> seed)]
    assert [{other, _, _}, {second, _, ^status}] = Lines.run(lines, cd: @root)
    assert status in [0, 2]
    assert [_one_line] = String.split(first, "\n", trim: true)
    assert without_wall_time(first) == without_wall_time(second)
    assert told =~ "search"

    keys = Regex.scan(~r/"(\w+)":/, first) |> Enum.map(&List.last/1)
    assert Enum.take(keys, 6) == ~w(version seed map robots simulated_s wall_s)

    other = String.replace(other, ~s("seed":5), ~s("seed":4))
    assert without_wall_time(first) != without_wall_time(other)
  end

  @tag :tmp_dir
  test "bin/demo writes report and picture where it was called", %{tmp_dir: folder} do
    line = "--headless --robots 1 --duration 60 --json run.json --picture run.svg"

    {output, _told, status} =
      run(Path.join(@root, "bin/demo"), OptionParser.split(line), cd: folder)

    assert status in [0, 2]
    assert output =~ "1 robot (mag1) in hall"
    assert File.read!(Path.join(folder, "run.json")) =~ ~s("robots":1,)
    {svg, []} = :xmerl_scan.file(to_charlist(Path.join(folder, "run.svg")), quiet: true)
    assert elem(svg, 1) == :svg
  end

  test "without a landmark the fleet says so and the status is 2" do
    assert {output, "", 2} = demo("--headless --robots 2 --landmark none --duration 60")
    assert output =~ "search"
    assert output =~ "No formation"
  end

  @tag :realtime
  test "live without a terminal: plain lines, commands from standard input" do
    options = [:binary, :exit_status, cd: @root, args: ~w(demo --robots 2 --blobs direct)]
    port = Port.open({:spawn_executable, System.find_executable("mix")}, options)
    output = await(port, "Try:  kill leader", "")
    Port.command(port, "staus\nstatus\n")
    output = await(port, "min1: ", output)

    # An order that has waited for half a second, as behind a fleet that is just starting, is not carried out.
    Port.command(port, "kill mag1\n")
    output = await(port, "kill mag1: done", output)
    Port.command(port, "quit\n")
    {output, _status} = ending(port, output)

    assert output =~ "did you mean status?"
    assert output =~ ~r/mag1: (idle|search) at /
    refute output =~ "\e["
  end

  @tag :realtime
  test "bin/demo says what it cannot read, needs no home, and keeps standard input" do
    demo = Path.join(@root, "bin/demo")
    assert {"", told, 1} = run(demo, ["--map", <<0xFF>>], [])
    assert told == "demo: the options must be text in UTF-8\n"
    {output, _told, 2} = run("env", ["-u", "HOME", demo, "--robots", "2"], input: "help\nquit\n")
    assert output =~ "formation"
  end
end
