defmodule Robot.FileTest do
  use ExUnit.Case, async: true

  doctest Robot.File
  doctest Robot.File.Bodies
  doctest Robot.File.Body
  doctest Robot.File.Reader
  doctest Robot.File.RecordOptions
  doctest Robot.File.Summary
  doctest Robot.File.Terms

  alias Hal.Pose
  alias Robot.File.{Reader, Schema, Terms}

  @robots Path.expand("../../../../config/robots", __DIR__)
  @least ~s(id: :mag1, profile: :magellan, drive: {Robot.FileDrive, port: "/dev/ttyS1"})

  defp parse(more, options \\ []) do
    more = if more == "", do: "", else: ",\n" <> more
    Robot.File.parse("[#{@least}#{more}]", [file: "mag1.exs"] ++ options)
  end

  defp lines(more, options \\ []) do
    assert {:error, lines} = parse(more, options)
    lines
  end

  defp colours do
    {:ok, colours} = Vision.Colours.read(Path.join(@robots, "landmark.txt"))
    fn "landmark.txt", _options -> {:ok, colours} end
  end

  test "a file without a key is told what is missing" do
    for text <- ["[]", "[id: :mag1]"] do
      assert {:error, lines} = Robot.File.parse(text, file: "mag1.exs")
      assert Enum.any?(lines, &(&1 =~ "mag1.exs:1: drive: is missing"))
    end
  end

  test "colours name the detector that finds them" do
    read = fn "lamp.txt", options ->
      Vision.Colours.read(Path.join(@robots, "landmark.txt"), options)
    end

    colours = &"colours: [file: \"lamp.txt\", backend: #{&1}]"
    assert {:ok, robot} = parse(colours.("Vision.Backend.Reference"), colours: read)
    assert robot.colours.backend == Vision.Backend.Reference
    assert [line] = lines(colours.("Mine.Lammp"), colours: read)
    assert line =~ "expected a Vision.Backend of this build"
    assert [line] = lines(colours.("Hal.Pose"), colours: read)
    assert line =~ "backend: expected a Vision.Backend, got Hal.Pose"
  end

  test "three keys make a robot, whose wheels stand until a person arms them" do
    assert {:ok, robot} = parse("")
    assert robot.profile == Hal.Profile.magellan()
    assert robot.start == Pose.new(0, 0)
    assert robot.arm == :manual
    assert robot.drive == {Robot.FileDrive, [port: "/dev/ttyS1"]}

    assert {:ok, config} = Robot.File.config(robot)
    assert %{id: :mag1, arm: :manual, camera: nil, mission: nil} = config
  end

  test "all keys arrive where they belong" do
    text = """
    body: [radius: 0.25, sonars: [{0.2, 0, 0}, {0, 0.2, deg(90)}], camera: [field_of_view: deg(48.8)]],
    ptz: {Robot.FilePtz, port: "/dev/ttyS2", speed: 9600},
    camera: {Hal.Camera.FFmpeg, source: "testsrc", size: {320, 240}},
    colours: "landmark.txt",
    limits: [max_linear: 0.3],
    start: {1, -2.5, deg(-90)},
    arm: :auto,
    fence: [{-2, -2}, {2, -2}, {0, 2.5}],
    dry_run: true,
    replace: true,
    estop_file: "/tmp/estop",
    network: [interface: "10.0.0.7"],
    policies: [formation: {:wedge, 1}, colour: "YellowLandmark"]
    """

    assert {:ok, robot} = parse(text, colours: colours())
    assert robot.profile.radius == 0.25
    assert robot.profile.sonars == [Pose.new(0.2, 0), Pose.new(0, 0.2, :math.pi() / 2)]
    assert_in_delta robot.profile.camera.field_of_view, 0.8517, 1.0e-4
    assert robot.profile.camera.width == 320
    assert robot.ptz == {Robot.FilePtz, port: "/dev/ttyS2", speed: 9600}
    assert robot.camera == {Hal.Camera.FFmpeg, source: "testsrc", size: {320, 240}}
    assert robot.start == Pose.new(1, -2.5, -:math.pi() / 2)
    assert robot.network == [interface: "10.0.0.7"]
    assert robot.policies == [formation: {:wedge, 1}, colour: "YellowLandmark"]

    assert {:ok, config} = Robot.File.config(robot)
    assert config.profile.max_linear == 0.3
    assert {Robot.FileDrive, options} = config.drive
    assert options[:profile] == config.profile
    assert config.arm == :auto
    assert config.estop_file == "/tmp/estop"
    assert config.fence.corners == [{-2.0, -2.0}, {2.0, -2.0}, {0.0, 2.5}]
    assert config.dry_run
    assert config.replace

    assert {:ok, %{fence: fence}} = parse("fence: {{-1, -1}, {2, 3}}")
    assert length(fence.corners) == 4
    assert {:ok, %{fence: nil, dry_run: false, replace: false}} = parse("fence: nil")
  end

  test "marks to look for" do
    camera = ~s(camera: {Hal.Camera.FFmpeg, source: "testsrc"}, colours: "landmark.txt")
    marks = "marks: [family: :tagStandard41h12, size: 1]"
    assert {:ok, robot} = parse("#{camera}, #{marks}", colours: colours())
    assert robot.marks == [family: :tagStandard41h12, size: 1.0]
    assert {:ok, %{marks: [family: :tagStandard41h12, size: 1.0]}} = Robot.File.config(robot)
    assert {:ok, %{marks: nil}} = parse(camera, colours: colours())

    for {shorter, words} <- [
          {robot, "tagStandard41h12, 1.00 m between their corners"},
          {%{robot | marks: [size: 0.16]}, "tag36h11, 0.16 m between their corners"}
        ],
        do: assert(Enum.any?(Robot.File.Summary.lines(shorter), &(&1 =~ words)))

    assert lines("#{camera}, marks: [family: :tag36h10, sice: 1]", colours: colours()) == [
             "mag1.exs:2: marks.sice: is not known: allowed are family, size, known, robots; did you mean size?",
             "mag1.exs:2: marks.family: expected :tag36h11, :tagStandard41h12 or :similar, got :tag36h10; did you mean :tag36h11?",
             "mag1.exs:2: marks.size: is missing: expected a number from 0.01 to 10.0 m"
           ]

    assert lines(marks) == ["mag1.exs:2: marks: is for a robot with a camera, and it has none"]

    # Where the library is missing, a person is told.
    warned = Enum.filter(Robot.File.Warnings.lines(robot, fn _ -> true end), &(&1 =~ "marks"))

    case Vision.Marks.available() do
      :ok -> assert warned == []
      {:error, line} -> assert warned == ["marks: #{line}; without it this robot sees none"]
    end
  end

  test "pictures to keep" do
    camera = ~s(camera: {Hal.Camera.FFmpeg, source: "testsrc"}, colours: "landmark.txt")
    keep = ~s(save_pictures: [folder: "/tmp/pictures", rate: 2, files: 10])
    assert {:ok, robot} = parse("#{camera}, #{keep}", colours: colours())
    assert robot.save_pictures == [folder: "/tmp/pictures", rate: 2.0, files: 10]
    assert {:ok, %{save_pictures: [{:folder, "/tmp/pictures"} | _]}} = Robot.File.config(robot)
    assert {:ok, %{save_pictures: nil}} = parse("#{camera}", colours: colours())

    assert lines("save_pictures: [folder: 7, rate: 0, file: 3]") == [
             "mag1.exs:2: save_pictures.file: is not known: allowed are folder, rate, files, megabytes; did you mean files?",
             "mag1.exs:2: save_pictures.folder: expected the path of a folder, got 7",
             "mag1.exs:2: save_pictures.rate: expected a number from 0.001 to 30.0 pictures a second, got 0"
           ]

    assert lines(keep) == [
             "mag1.exs:2: save_pictures: is for a robot with a camera, and it has none"
           ]

    assert lines("#{camera}, save_pictures: [rate: 2]", colours: colours()) == [
             "mag1.exs:2: save_pictures.folder: is missing: expected the path of a folder"
           ]
  end

  test "fences of no sense are refused" do
    for bad <- [":big", "{1, 2}", "[{0, 0}, {1, 1}]", "[{0, 0}, {1, 0}, :x]", "{{0, 0}, {0, 1}}"] do
      assert [line] = lines("fence: #{bad}")
      assert line =~ ~r/^mag1.exs:2: fence: expected .*, got /
    end
  end

  test "all that is wrong is said at once, with line, key, what is allowed and a suggestion" do
    text = """
    limits: [max_liner: 0.3, max_turn: "fast"],
    strat: {0, 0, 0},
    arm: :maual,
    start: {0, 0},
    body: [radius: 90]
    """

    {:keys, table} =
      Schema.table(%{bodies: nil, bodiless?: true, colours: nil, map: nil, tables: []})

    keys = table |> Keyword.keys() |> Enum.join(", ")

    assert lines(text) == [
             "mag1.exs:2: limits.max_liner: is not known: allowed are max_linear, max_turn, max_acceleration, max_turn_acceleration; did you mean max_linear?",
             "mag1.exs:2: limits.max_turn: expected a number from 0.01 to 10.0 rad/s, got \"fast\"",
             "mag1.exs:3: strat: is not known: allowed are #{keys}; did you mean start?",
             "mag1.exs:4: arm: expected :manual or :auto, got :maual; did you mean :manual?",
             "mag1.exs:5: start: expected {x, y, heading}, metres up to 10000 and radians, such as {1.0, 0.5, deg(90)}, got {0, 0}",
             "mag1.exs:6: body.radius: expected a number from 0.05 to 1.5 m, got 90"
           ]
  end

  test "whose words are those of an app above says what they are" do
    tables = [
      network: {:keys, interface: :ipv4},
      policies: {:keys, mission: {:one_of, [nil, :patrol]}}
    ]

    text = &"network: [interface: \"10.0.0.7\"],\npolicies: [mission: #{&1}]"
    assert {:ok, robot} = parse(text.(":patrol"), tables: tables)
    assert {robot.network, robot.policies} == {[interface: {10, 0, 0, 7}], [mission: :patrol]}

    assert lines(text.(":patorl"), tables: tables) == [
             "mag1.exs:3: policies.mission: expected nil or :patrol, got :patorl; did you mean :patrol?"
           ]

    # Where nobody says so, what is no list of keys is refused at least.
    assert {:ok, _robot} = parse(text.(":patorl"))

    for more <- ["network: 5", "network: [5]", "policies: :landmark"] do
      assert [line] = lines(more)
      assert line =~ ~r/mag1.exs:2: \w+: expected \[key: value, …\], got .*/
    end
  end

  test "a key that is like none gets the list of those that there are" do
    assert [line] = lines("limits: [zzz: 1]")
    assert line =~ "limits.zzz: is not known: allowed are max_linear, max_turn"
  end

  test "a key twice is refused" do
    assert lines("arm: :auto,\narm: :manual") == [
             "mag1.exs:3: arm: is given twice, first in line 2"
           ]

    assert [line] = lines("ptz: {Robot.FilePtz, port: \"a\", port: \"b\"}")
    assert line == "mag1.exs:2: ptz.port: is given twice, first in line 2"
  end

  test "drivers are modules of this build, of the right kind, with options that they take" do
    assert ["mag1.exs:2: ptz: names Robot.FileDrive, which is not a Hal.Ptz"] =
             lines("ptz: Robot.FileDrive")

    assert [line] = lines("camera: {Hal.Camera.FFmpg, source: \"x\"}")
    assert line =~ ", got Hal.Camera.FFmpg"
    assert line =~ "did you mean Hal.Camera.FFmpeg?"
    assert [line] = lines("ptz: :none")

    assert line =~
             "ptz: expected nil or {driver, options}, such as {Hal.Visca.Driver, […]}, got :none"

    assert ["mag1.exs:2: camera.source: is missing: expected a file, stream or device", size] =
             lines("colours: \"landmark.txt\", camera: {Hal.Camera.FFmpeg, size: {1, 1}}",
               colours: colours()
             )

    assert size =~ "camera.size: expected {width, height}, even numbers"
    assert [line] = lines("ptz: {Robot.FilePtz, no_such_option_of_anybody: 1}")
    assert line =~ "ptz.no_such_option_of_anybody: is not an option of any driver"
    assert [line] = lines("ptz: {Robot.FilePtz, serial: :no_such_name_of_anybody}")
    assert line =~ ~r/ptz\.serial: expected .*, got :no_such_name_of_anybody/

    assert {:error, lines} =
             Robot.File.parse(
               "[id: :mag1, profile: :magellan,\ndrive: {Robot.FileDrive, port: \"x\",\nconvesions: [],\nconversions: [distanse: 1, x: 2]}]",
               file: "mag1.exs"
             )

    assert lines == [
             "mag1.exs:3: drive.convesions: is not known: allowed are port, sonar_banks, conversions, bumpers, profile; did you mean conversions?",
             "mag1.exs:4: drive.conversions.distanse: is not known: allowed are distance, angle; did you mean distance?",
             "mag1.exs:4: drive.conversions.x: is not known: allowed are distance, angle"
           ]

    assert {:error, ["mag1.exs:1: drive.port: is missing: expected a path"]} =
             Robot.File.parse("[id: :mag1, profile: :magellan, drive: Robot.FileDrive]",
               file: "mag1.exs"
             )
  end

  test "what does not fit together is said" do
    assert lines("camera: {Hal.Camera.FFmpeg, source: \"testsrc\"}") == [
             "mag1.exs:1: colours: is missing: a robot with a camera must have colours"
           ]

    assert lines("limits: [max_linear: 0.9]") == [
             "mag1.exs:2: limits.max_linear: expected at most 0.5, which a magellan can do, got 0.9"
           ]

    assert [line] =
             lines("colours: \"landmark.txt\", policies: [colour: \"YelowLandmark\"]",
               colours: colours()
             )

    assert line =~
             "one of the colours YellowLandmark, got \"YelowLandmark\"; did you mean YellowLandmark?"

    assert {:error, [line]} =
             Robot.File.parse(
               "[id: :mag1, profile: :magellan, drive: {Robot.FileDrive, port: \"x\", sonar_banks: [8, 4]}]"
             )

    assert line =~ "drive: drive option sonar_banks has 12 for 16"

    # Also where one of them is named as in /dev.
    for port <- ["/dev/ttyS1", "ttyS1"] do
      assert [line] = lines("ptz: {Robot.FilePtz, port: \"#{port}\"}")

      assert line ==
               "mag1.exs:2: ptz.port: is #{inspect(port)}, the drive's: each has a line of its own"
    end

    assert {:error, [line]} = Robot.File.parse("[#{@least}]", file: "robots/mag2.exs")
    assert line == "robots/mag2.exs:1: id: is :mag1, but the file is named mag2.exs"
  end

  test "nothing in a file is run, and no file makes an atom" do
    for text <- [
          "System.halt(1)",
          "fn -> 1 end",
          "\"\#{1}\"",
          "~w(a b)",
          ":\"a\#{1}\"",
          "%Foo{}",
          "1 + 1",
          "'text'",
          "<<1>>",
          "x",
          "[1 | 2]",
          "deg(1, 2)",
          "deg(deg)",
          "deg(1.0e30)",
          "-:a",
          "&1",
          "(1; 2)"
        ] do
      assert [line] = lines("estop_file: #{text}"), text
      assert line =~ ~r/^mag1.exs:2: .*(cannot|takes|nothing is put)/, line
    end

    strange = "strange#{System.unique_integer([:positive])}"

    for text <- [
          "#{strange}: 1",
          "arm: :#{strange}",
          "arm: #{strange}(1)",
          "arm: #{strange}",
          "ptz: {S#{strange}, port: 1}",
          "ptz: {Robot.FilePtz, #{strange}: 1}",
          "ptz: {Robot.FilePtz, port: :#{strange}}",
          "colours: [file: \"#{strange}\"]",
          "arm: :\"#{strange} a\"",
          "id: :#{strange}"
        ] do
      assert [_ | _] = lines(text)
      assert_raise ArgumentError, fn -> String.to_existing_atom(strange) end
      assert_raise ArgumentError, fn -> String.to_existing_atom("Elixir.S" <> strange) end
    end
  end

  @tag :tmp_dir
  test "a byte-order mark at its beginning is none of its text", %{tmp_dir: folder} do
    file = Path.join(folder, "mag1.exs")
    File.write!(file, "\uFEFF[#{@least}]")
    assert {:ok, %Robot.File{id: :mag1}} = Robot.File.load(file)
  end

  test "text that is not a robot file ends in one line" do
    for {text, words} <- [
          {"", "is empty"},
          {"# only this", "is empty"},
          {"[id: :mag1", "missing terminator: ]"},
          {"[id: {:mag1", "missing terminator: }"},
          {"[id: {:mag1]", "unexpected token: ]"},
          {"[a: 1]\n[b: 2]", "nothing can stand behind the end of the list"},
          {"%{id: :mag1}", "one list, [key: value, …]"},
          {"[1, 2]", "one list, [key: value, …]"},
          {"[1, a: 2]", "a list has keys for all its values or for none"},
          {"[a: 1, 2]", "a list has keys for all its values or for none"},
          {"[id: :mag1 profile: 1]", "a comma or a value is missing before profile:"},
          {"[id: ]", "a comma or a value is missing before ]"},
          {"[id: , a: 1]", "a comma or a value is missing before ,"},
          {"[id: \n profile: 1]", "a comma or a value is missing before profile:"},
          {"[id::mag1]", "a space is missing after id:"},
          {"[a: 1, id:\"mag1\"]", "must be followed by space after: id:"},
          {"[a: 1,\n id::mag1]", "what follows this comma has no key"},
          {"[start: {1.5m, 0}]", ~s(invalid character "m" after number 1.5)},
          {"[start: 1.0e400]", "invalid float number 1.0e400"},
          {"[start: 1e5]", ~s(invalid character "e" after number 1)},
          {"[start: \"abc]", ~s(missing terminator: ")},
          {"[start: \"a\\x\"]", "invalid hex escape character"},
          # Elixir 1.14 finds the first fault here, newer ones the second.
          {"[start: {a: 1, 2}]", ~r/is missing before a:|what follows this comma has no key/},
          {"[start: %{a: 1}]", "a map is written %{key => value}"},
          {"[start: %{1}]", ~r/a comma or a value is missing before }|a map is written/},
          {<<"[id: ", 0xFF, "]">>, "is not text in UTF-8"},
          {String.duplicate("#", 70_000), "larger than 64 kB"}
        ] do
      assert {:error, [line]} = Robot.File.parse(text, file: "mag1.exs")
      assert line =~ ~r/^mag1.exs:\d+: /
      assert line =~ words
    end
  end

  test "what stands where keys or options belong is told, and crashes nothing" do
    for more <- [
          "ptz: {Hal.Visca.Driver, []}",
          "camera: {Hal.Camera.FFmpeg, []}",
          "camera: {Hal.Camera.FFmpeg, [5]}",
          "camera: {Hal.Camera.FFmpeg, [%{}]}",
          "console: []",
          "save_pictures: []",
          "limits: [{:max_linear, 99}]"
        ] do
      assert {:error, [_ | _] = lines} = parse(more)
      assert Enum.all?(lines, &(&1 =~ ~r/^mag1.exs:\d+: /)), inspect(lines)
    end
  end

  test "hostile sizes and depths end soon, in lines of bounded length" do
    for text <- [
          String.duplicate("[", 30_000),
          String.duplicate("[", 15_000) <> String.duplicate("]", 15_000),
          "[arm: " <> String.duplicate("9", 60_000) <> "]",
          "[start: {#{String.duplicate("9", 60_000)}, 0, 0}]",
          "[arm: \"#{String.duplicate("a", 60_000)}\"]",
          "[#{String.duplicate("a", 60_000)}: 1]",
          "[arm: :#{String.duplicate("a", 60_000)}]",
          "[" <> Enum.map_join(1..5_000, ", ", &"a#{&1}: 1") <> "]",
          "[arm: " <> String.duplicate("-", 30_000) <> "1]"
        ] do
      {:reductions, before} = Process.info(self(), :reductions)
      {:error, lines} = Robot.File.parse(text)
      {:reductions, now} = Process.info(self(), :reductions)
      # Work, and not seconds: those depend on what else the machine does.
      assert now - before < 200_000_000
      assert Enum.all?(lines, &(String.length(&1) < 700)), inspect(lines, printable_limit: 900)
    end
  end

  test "random damage to a good file never raises" do
    text = File.read!(Path.join(@robots, "template.exs"))
    bytes = ~c"[]{}(),:;\"'#%&|^~@!?<>=+-*/\\ \n\tazAZ09_." ++ [0, 127, 200, 255]

    for _ <- 1..1_000 do
      at = :rand.uniform(byte_size(text)) - 1
      cut = :rand.uniform(8) - 1
      {head, rest} = :erlang.split_binary(text, at)

      rest =
        binary_part(rest, min(cut, byte_size(rest)), byte_size(rest) - min(cut, byte_size(rest)))

      new = for _ <- 1..:rand.uniform(4), into: "", do: <<Enum.random(bytes)>>
      damaged = head <> new <> rest

      case Robot.File.parse(damaged, colours: fn _path, _options -> {:error, "none"} end) do
        {:ok, _robot} -> :ok
        {:error, [_ | _] = lines} -> assert Enum.all?(lines, &is_binary/1)
      end
    end
  end

  test "record: says where and how much is recorded; wrong values name key and what is allowed" do
    assert {:ok, robot} = parse(~s(record: [folder: "/tmp/runs"]))
    assert robot.record == [folder: "/tmp/runs"]
    assert {:ok, %{record: nil}} = parse("record: nil")

    assert lines("record: [folder: 7, limit_mb: 1, limits: 3]") == [
             "mag1.exs:2: record.limits: is not known: allowed are folder, limit_mb, pictures; did you mean limit_mb?",
             "mag1.exs:2: record.folder: expected the path of a folder, got 7",
             "mag1.exs:2: record.limit_mb: expected a whole number from 4 to 1000000 MB, got 1"
           ]

    assert lines("record: [limit_mb: 8]") == [
             "mag1.exs:2: record.folder: is missing: expected the path of a folder"
           ]

    report = &Robot.File.Summary.report("mag1.exs", robot, fn _device -> true end, &1)
    said = Enum.join(report.(fn "/tmp/runs" -> true end), "\n")
    assert said =~ ~r"records +the newest 500 MB in /tmp/runs, for mix replay"
    refute said =~ "cannot be written"
    said = Enum.join(report.(fn "/tmp/runs" -> false end), "\n")
    assert said =~ "record.folder: /tmp/runs cannot be written on this machine"
  end

  test "the robots that come along are well, and so is the template" do
    for {name, file} <- [mag1: "mag1.exs", min1: "min1.exs", mag1: "template.exs"] do
      assert {:ok, robot} = Robot.File.load(Path.join(@robots, file))
      assert robot.id == name
      assert robot.arm == :manual
      assert {:ok, config} = Robot.File.config(robot)
      assert {Hal.RFlex.Driver, options} = config.drive
      assert options[:profile] == config.profile
      assert config.profile.max_linear == 0.3
    end
  end

  test "a file that cannot be read says why" do
    folder = Path.join(System.tmp_dir!(), "robot_file_#{System.unique_integer([:positive])}")
    File.mkdir_p!(folder)
    on_exit(fn -> File.rm_rf!(folder) end)
    assert {:error, [line]} = Robot.File.load(folder)
    assert line =~ "is a directory, where a file is needed"

    path = Path.join(folder, "mag1.exs")
    File.write!(path, "[#{@least}, colours: \"none.txt\"]")
    assert {:error, [line]} = Robot.File.load(path)

    assert line ==
             "#{path}:1: colours: #{Path.join(folder, "none.txt")}: no such file or directory"
  end

  test "a node is shown as it was written" do
    for text <- [
          "[1, -2.5, nil]",
          "[{:a, 2, \"b\"}, Some.Thing, :no_atom_of_ours]",
          "[arm: true, id: Some.Module]"
        ] do
      assert {:ok, node} = Reader.read(text)
      assert inspect(Terms.term(node)) == text
    end
  end
end
