defmodule Console.OptionsTest do
  use ExUnit.Case, async: true
  alias Console.Options

  doctest Console.Cli.MapName
  doctest Console.Fleet
  doctest Console.Options

  defp parse(line), do: line |> OptionParser.split() |> Options.parse()

  defp error(line) do
    {:error, lines} = parse(line)
    Enum.join(lines, "\n")
  end

  test "every option is understood" do
    {:ok, options} =
      parse(
        "--fleet mag:4,min:2 --seed 7 --map hospital --start same --landmark=-2,1 --move -3,2@40 " <>
          "--move 0,0@60 --kill leader@30 --kill min2@50.5 --loss 0.2 --noise slip --formation wedge:1.2 " <>
          "--assign chain --leader-change off --duration 200 --headless --nodes --hardware mag:1 --json - --picture a.svg --blobs direct --plan known"
      )

    assert options.headless and options.nodes
    assert options.robots == [:mag1, :mag2, :mag3, :mag4, :min1, :min2]
    assert options.moves == [{{-3.0, 2.0}, 40.0}, {{0.0, 0.0}, 60.0}]
    assert options.kills == [{:leader, 30.0}, {:min2, 50.5}]

    assert Options.trial(options) == %{
             robots: options.robots,
             seed: 7,
             map: "hospital",
             grey: :wall,
             start: :same,
             landmark: {-2.0, 1.0},
             balls: [],
             boxes: [],
             moves: options.moves,
             kills: options.kills,
             loss: 0.2,
             noise: :slip,
             formation: {:wedge, 1.2},
             assign: :chain,
             leader_change: false,
             duration_s: 200.0,
             blobs: :direct,
             plan: :known,
             hardware: [:mag1],
             nodes: true
           }
  end

  test "balls and boxes are given by their places" do
    {:ok, options} = parse("--ball -1,2 --ball 0,0 --box 3,1.5,-45")

    assert %{balls: [{-1.0, 2.0}, {+0.0, +0.0}], boxes: [{3.0, 1.5, -45.0}]} =
             Options.trial(options)

    assert error("--ball 1") =~ "X,Y in metres"
    assert error("--box 1,2") =~ "X,Y,DEG in metres and degrees"
    assert error("--box 1,2,far") =~ "X,Y,DEG in metres and degrees"
  end

  test "hardware is the first robots, or the first of a kind, and runs in real time" do
    {:ok, options} = parse("--robots 4 --hardware 3")
    assert options.hardware == [:mag1, :mag2, :min1]
    {:ok, options} = parse("--hardware mag:1,min:1")
    assert options.hardware == [:mag1, :min1]
    assert Options.real_time?(options)
    {:ok, options} = parse("--hardware 0")
    refute Options.real_time?(options)
    refute is_map_key(Options.trial(options), :nodes)

    assert error("--hardware mag") =~ "did you mean mag:1?"
    assert error("--hardware min2") =~ "did you mean min:1?"
    assert error("--hardwear 1") =~ "did you mean --hardware?"

    for wrong <- ~w(-1 1.5 dog:1 mag:x 101 nan) do
      assert error("--hardware #{wrong}") ==
               "--hardware: expected a whole number, or such as mag:1,min:1, got #{inspect(wrong)}"
    end

    for {line, asked} <- [
          {"--robots 3 --hardware 4", "4"},
          {"--hardware 100 --robots 3", "100"},
          {"--fleet mag:3 --hardware min:1", "min1"},
          {"--robots 3 --hardware mag:3", "mag3"}
        ] do
      assert error(line) =~ "--hardware #{asked} is more than there are: the fleet is mag1"
    end
  end

  test "a fleet has any bodies, each once, and the demo runs them" do
    assert {:ok, options} = parse("--fleet burger:2,mag:2,create2:1")
    assert options.robots == [:burger1, :burger2, :create2_1, :mag1, :mag2]
    assert {:ok, %{options: %{bodies: bodies}}} = Lab.Trial.setup(Options.trial(options))
    assert bodies.burger2.name == :turtlebot3_burger and bodies.create2_1.name == :create2

    for wrong <- [
          "burger",
          "burger:x",
          "burger:0",
          "mag:1,mag:1",
          "mag:1001",
          "rover:2",
          ":2",
          "burger:2,"
        ] do
      assert error("--fleet #{wrong}") =~
               ~r/^--fleet: expected such as burger:4,mag:2, with bodies burger, .*, each once, and 1 to 1000 robots together, got /
    end

    assert error("--fleet buger:2") =~ ~s(got "buger:2"; did you mean burger?)
  end

  test "without options there are six robots in the hall" do
    {:ok, options} = parse("")
    assert length(options.robots) == 6
    assert Options.trial(options).duration_s == 120.0
  end

  test "a world of Stage says map and robots; other options come to it" do
    folder = Path.expand("../../../../examples/stage", __DIR__)

    {:ok, options} =
      Options.parse(~w(--world yard.world --ball -2,-3 --kill r2@9 --seed 4), folder)

    trial = Options.trial(options)
    assert trial.robots == [:r0, :r1, :r2, :rover1]
    assert trial.map == Path.join(folder, "yard.world")
    assert trial.landmark == {0.5, 0.0}
    assert [{-4.5, -2.5, 0.11}, {-2.0, -3.0}] = trial.balls
    assert trial.kills == [{:r2, 9.0}]
    assert {:ok, _trial} = Lab.Trial.new(trial)
    assert options.world.notes == [Path.join(folder, "yard.world") <> ":17: ctrl is left out"]

    assert error("--world a.world --map hall") =~ "--world and --map exclude each other"
    assert error("--world a.world --fleet mag:2") =~ "--world and --fleet exclude each other"
    assert error("--world a.txt") =~ ~s(--world: expected FILE.world, got "a.txt")

    assert error("--world no/such.world") =~
             ~r/--world: .*no\/such.world: no such file or directory/
  end

  test "a wrong value is named, with what is allowed" do
    for count <- ~w(0 -3 1e9 1001 six 6.5 99999999999999999999) do
      assert error("--robots #{count}") ==
               "--robots: expected a whole number from 1 to 1000, got #{inspect(count)}"
    end

    for loss <- ~w(nan NaN inf -inf Infinity 1.1 -0.1 1e400 .5 0,2) do
      assert error("--loss #{loss}") ==
               "--loss: expected a number from 0 to 1, got #{inspect(loss)}"
    end

    assert error("--map moon") =~ "hall, hospital, arena, clinic, "

    assert error("--map moon") =~
             "doorway, rooms, FILE.yaml, FILE.png:WIDTHxHEIGHT or FILE.pgm:WIDTHxHEIGHT, got \"moon\""

    assert error("--map ofices") =~ "did you mean offices"
    assert error("--map hospitel") =~ "did you mean hospital"
    assert error("--map a.png:1x12") =~ "sides from 2 to 1000"

    assert error("--map a.yaml:9x12") ==
             "--map: expected FILE.yaml, got \"a.yaml:9x12\"; its description says how large the map is"

    assert error("--map a.png") =~ "such as a.png:16x12, got \"a.png\"; its size is missing"
    assert error("--map a.pgm:9,12") =~ "FILE.pgm:WIDTHxHEIGHT in metres"
    assert error("--map a.pgm:9,12") =~ "9,12 is not a size"
    assert error("--map a.jpg") =~ ".jpg is not read: save the picture as PNG"
    assert error("--formation wegde") =~ "did you mean wedge"
    assert error("--formation wedge:0.5") =~ "0.8 to 5"
    assert error("--landmark 1") =~ "X,Y in metres"
    assert error("--landmark nan,1") =~ "X,Y in metres"
    assert error("--move 1,2") =~ "X,Y@T"
    assert error("--kill leader") =~ "leader@T or NAME@T"
    assert error("--picture a.png") =~ ".svg"
    assert error("--json /no/such/folder/a.json") =~ "a folder that exists"
    assert error("--duration 0") =~ "from 1 to 3600"
    assert error("--seed -1") =~ "whole number"
    assert error("--fleet mag:0,min:0") =~ "1 to 1000 robots"
    assert error("--nodes --robots 101") =~ "--nodes takes at most 100 robots"
    assert error("--fleet mag:1001") =~ "1 to 1000 robots"
    assert error("--robots 3 --fleet mag:3") =~ "exclude each other"
  end

  @tag :tmp_dir
  test "a proxy is named as browsers name it, and the page behind it has a token", %{
    tmp_dir: folder
  } do
    file = token(folder, "a-secret-token\n")

    for {text, origin} <- [
          {"https://robots.lab.example", "https://robots.lab.example"},
          {"https://Robots.lab.example:443/", "https://robots.lab.example"},
          {"http://10.0.0.7:8080", "http://10.0.0.7:8080"}
        ] do
      assert {:ok, %{page_origin: ^origin}} =
               Options.parse(["--page-token-file", file, "--page-origin", text])
    end

    for wrong <-
          ~w(robots.lab.example ftp://a.example https:// https://a.example/fleet https://u@a.example https://a.example?b) do
      assert Options.parse(["--page-token-file", file, "--page-origin", wrong]) ==
               {:error,
                [
                  "--page-origin: expected an address without a path, such as https://robots.lab.example, got #{inspect(wrong)}"
                ]}
    end

    assert error("--page-origin https://robots.lab.example") =~
             "--page-origin needs --page-token-file"
  end

  defp token(folder, text, mode \\ 0o600) do
    file = Path.join(folder, "page.token")
    File.write!(file, text)
    File.chmod!(file, mode)
    file
  end

  @tag :tmp_dir
  test "the page's token is in a file that nobody else reads, and is said by no error", %{
    tmp_dir: folder
  } do
    token(folder, "a-secret-token\n")
    parse = &Options.parse(["--page-address", "0.0.0.0", "--page-token-file", &1], folder)
    assert {:ok, %{page_token: "a-secret-token"}} = parse.("page.token")

    for {text, mode, why} <- [
          {"a-secret-token", 0o640, "may be read by others (mode 0640, must be 0600)"},
          {"short", 0o600, "has something else"},
          {"a secret token", 0o600, "has something else"},
          {<<0xFF, "-secret-token">>, 0o600, "has something else"},
          {"", 0o600, "has something else"}
        ] do
      token(folder, text, mode)

      assert parse.("page.token") ==
               {:error,
                [
                  "--page-token-file: expected a file of mode 0600 with 8 to 100 letters, digits, - and _, got \"page.token\"; it #{why}"
                ]}
    end

    assert {:error, [line]} = parse.("none.token")
    assert line =~ "it does not exist"

    assert {:error, [line]} = Options.parse(~w(--page-token a-secret-token))
    assert line == "unknown option --page-token; did you mean --page-token-file?"
  end

  test "a robot that does not exist is refused" do
    assert error("--kill mag9@3") =~ ~s("mag9"; allowed are leader, mag1 to mag3, min1 to min3)
  end

  test "typing errors get a suggestion, and a missing value its form" do
    assert error("--robot 3") == ~s(unknown option --robot; did you mean --robots?)
    assert error("--headles") == ~s(unknown option --headles; did you mean --headless?)
    assert error("headless") == ~s(unexpected argument "headless"; did you mean --headless?)
    assert error("--map --headless") == "--map needs a value: NAME"
    assert error("--headless=1") == "--headless takes no value"
  end

  test "every mistake has its own line" do
    assert {:error, [_, _, _]} = parse("--robots 0 --loss 2 --mpa hall")
  end

  test "the help names every option" do
    for name <-
          ~w(robots fleet seed map start landmark ball box move kill loss noise formation assign
                   leader-change duration headless json picture blobs hardware) do
      assert Options.help() =~ "--#{name}"
    end
  end

  test "a mission is read with its options, for the fleet that it is for" do
    {:ok, options} = parse("--robots 4 --mission patrol:loop=line,period=90")
    assert {Missions.Patrol, own} = options.mission
    assert {own[:loop], own[:period]} == {:line, 90.0}
    assert Options.trial(options).mission == options.mission
    {:ok, options} = parse("--robots 4 --mission landmark:policy=majority")
    assert options.mission == {Missions.Landmark, of: 4, policy: :majority}

    assert error("--mission patorl") ==
             ~s(--mission: mission "patorl" is not known; expected one of landmark, patrol, flock, explore, chase, push, teleop; did you mean patrol?)

    assert error("--mission patrol:period=5") ==
             "--mission: patrol option period: expected a number from 10 to 3600 s, got 5"

    assert error("--save-map found.yaml --mission explore") ==
             "--save-map needs --headless, without --nodes and --hardware"

    assert error("--save-map found.yaml --headless --mission patrol") ==
             "--save-map needs a mission that makes a map, such as --mission explore"

    assert Options.help() =~
             ~r/--mission NAME\[:KEY=VALUE,…\] +landmark, patrol, flock, explore, chase, push or teleop/
  end
end
