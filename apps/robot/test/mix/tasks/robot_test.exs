defmodule Mix.Tasks.RobotTest do
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Mix.Tasks.Robot.{Check, Import}

  @moduletag :tmp_dir
  @robots Path.expand("../../../../../config/robots", __DIR__)
  @player """
  driver ( name "rflex" rflex_serial_port "/dev/ttyS1" mm_length 500 mm_width 300
    odo_distance_conversion 190 odo_angle_conversion 60000 sonar_2nd_bank_start 8 )
  driver ( name "cmvision" colorfile "color.cfg" )
  """

  setup %{tmp_dir: folder} do
    Mix.shell(Mix.Shell.Process)
    on_exit(fn -> Mix.shell(Mix.Shell.IO) end)
    File.cp!(Path.join(@robots, "landmark.txt"), Path.join(folder, "color.cfg"))
    file = Path.join(folder, "old.cfg")
    File.write!(file, @player)
    {:ok, player: file}
  end

  defp said do
    receive do
      {:mix_shell, :info, [line]} -> [line | said()]
    after
      0 -> []
    end
  end

  defp refused(task, words) do
    assert catch_exit(task.run(words)) == {:shutdown, 1}
    errors()
  end

  defp errors do
    receive do
      {:mix_shell, :error, [line]} -> [line | errors()]
    after
      0 -> []
    end
  end

  test "a file that is well is told in words: limits, way to stop, what is missing, how it arms" do
    path = Path.join(@robots, "mag1.exs")
    Check.run([path])
    lines = said()
    assert hd(lines) =~ "#{path}: well"
    text = Enum.join(lines, "\n")
    assert text =~ "mag1, a Magellan Pro of 20 kg: 0.40 m long"
    missing = "distance (units per metre), angle (units per radian): it will not arm"
    assert String.replace(text, ~r/\s+/, " ") =~ missing
    assert text =~ "moves     at most 0.30 m/s and 57° a second"
    # 0.3 m/s for 0.3 s, and 0.3^2 / (2 * 0.5) m.
    assert text =~ "stops     from full speed within 0.18 m"
    assert text =~ "arms      by hand"
    assert Enum.all?(lines, &(String.length(&1) <= 104))

    Check.run([Path.join(@robots, "min1.exs")])
    assert Enum.join(said(), "\n") =~ "min1, an ATRV mini of 40 kg"
  end

  defp checked(folder, file) do
    path = Path.join(folder, "mag1.exs")
    File.write!(path, file)
    Check.run([path])
    [title | lines] = said()
    {String.replace_prefix(title, path, ""), String.replace(Enum.join(lines, " "), ~r/\s+/, " ")}
  end

  test "what check says of arming is what the driver says", %{tmp_dir: folder} do
    laws = [[], [ir_a: 4000.0], [ir_a: 4000.0, ir_b: -2.0]]
    ranges = [[], [range: 1474.0]]
    wheels = [[], [distance: 31_387.0], [distance: 31_387.0, angle: 4654.2]]

    for law <- laws, range <- ranges, wheel <- wheels do
      conversions = wheel ++ range ++ law
      drive = "{Hal.RFlex.Driver, port: \"/dev/null\", conversions: #{inspect(conversions)}}"
      {_title, text} = checked(folder, "[id: :mag1, profile: :magellan, drive: #{drive}]")

      {:ok, robot} = Robot.File.load(Path.join(folder, "mag1.exs"))
      {:ok, %{drive: {Hal.RFlex.Driver, options}}} = Robot.File.config(robot)
      line = Path.join(folder, "line")
      {:ok, far} = Hal.Serial.open(pty: line)
      {:ok, driver} = Hal.RFlex.Driver.init(Keyword.put(options, :port, line))

      case Hal.RFlex.Driver.ready(driver) do
        :ok -> refute text =~ "it will not arm"
        {:error, why} -> assert text =~ why <> ": it will not arm"
      end

      assert text =~ "not read: no ir_a, no ir_b" == (law == [])
      Hal.RFlex.Driver.terminate(driver)
      Hal.Serial.close(far)
    end
  end

  test "what is odd is a warning, with what would be usual", %{tmp_dir: folder} do
    well = "distance: 31_387.0, angle: 4654.2, range: 1474.0, ir_a: 4000.0, ir_b: -2.0"

    file = fn conversions, more ->
      options = ~s([port: "/dev/null", conversions: [#{conversions}]#{more[:drive]}])
      keys = more[:keys] || ""
      "[id: :mag1, profile: :magellan, drive: {Hal.RFlex.Driver, #{options}}#{keys}]"
    end

    assert {": well", text} = checked(folder, file.(well, []))
    refute text =~ "WARNING"

    pose = fn n -> "{0.2, #{n / 100}, 0.0}" end
    fifty = "body: [sonars: [#{Enum.map_join(1..50, ", ", pose)}]]"
    far = String.replace(well, "31_387.0", "31.387")

    for {file, line} <- [
          {String.replace(file.(well, []), "/dev/null", "/dev/ttyNONE"),
           "/dev/ttyNONE is not on this machine; it must be on the robot's"},
          {file.(well, keys: ", limits: [max_turn_acceleration: 0.017]"),
           "limits.max_turn_acceleration: with 0.017 rad/s2 it takes 59 s to turn at full speed; 1.0 is usual"},
          {file.(well, keys: ", limits: [max_acceleration: 0.05]"),
           "limits.max_acceleration: with 0.05 m/s2 it takes 10 s to drive at full speed; 0.5 is usual"},
          {file.(well, keys: ", #{fifty}"),
           "drive: sonar_banks: is not given, and 50 poses are no full boards of 8 (48 or 56 would be)"},
          {file.(far, []),
           "drive: conversions.distance: 31.387 units a metre is odd; 31387.0 is usual"},
          {file.(well, drive: ", speed: 9600"),
           "drive: speed: 9600 baud is odd; 115200 is usual"},
          {file.(well, keys: ", body: [sonars: [{0.2, 0.0, 3.1}, {0.1, 0.1, 0.8}]]"),
           "body.sonars: number 1 looks into the body"},
          {file.(well, keys: ", body: [irs: [{0.2, 0.0, 0.0}, {0.2, 0.0, 0.0}]]"),
           "body.irs: 1 of the 2 poses are given twice"}
        ] do
      assert {title, text} = checked(folder, file)
      assert title =~ ": well, but for "
      assert text =~ "WARNING " <> line
    end
  end

  test "of several files, what is wrong in each is said, and the status is 1", %{tmp_dir: folder} do
    bad = Path.join(folder, "bad.exs")
    File.write!(bad, "[id: :mag1, profile: :magelan,\n dirve: 1]")
    lines = refused(Check, [Path.join(@robots, "mag1.exs"), bad, "none.exs"])

    assert lines == [
             "#{bad}:1: profile: cannot be :magelan: allowed: :magellan, :atrv_mini; did you mean :magellan?",
             "#{bad}:2: dirve: is no key; did you mean drive?",
             "#{bad}:1: drive: is missing",
             "none.exs: no such file or directory"
           ]

    assert refused(Check, ["--colour"]) == ["--colour is no option; --help lists them"]
    Check.run(["--help"])
    assert [_well | _lines] = said()
  end

  test "a Player file becomes a robot file that is well", %{tmp_dir: folder, player: file} do
    out = Path.join(folder, "min7.exs")
    told = capture_io(:stderr, fn -> Import.run([file, "-o", out]) end)
    assert told =~ "#{file}:2: sonar_2nd_bank_start: all sonars are one list here"
    assert told =~ "Assumed; look whether it is so:"
    assert told =~ "#{out} written: 1 assumed, 1 not carried over"

    assert {:ok, %{id: :min7} = robot} = Robot.File.load(out)
    assert {:ok, _config} = Robot.File.config(robot)
    assert [%{name: "YellowLandmark"}] = robot.colours.classes

    assert refused(Import, [file, "-o", out]) == [
             "#{out} is there already; --force writes over it"
           ]

    capture_io(:stderr, fn ->
      Import.run([file, "-o", out, "--force", "--profile", "magellan"])
    end)

    assert {:ok, %{id: :min7, profile: %{name: :magellan}}} = Robot.File.load(out)
  end

  test "what came over and is odd is told at once", %{tmp_dir: folder, player: file} do
    File.write!(file, String.replace(@player, "conversion 190", "conversion 19"))
    out = Path.join(folder, "min7.exs")
    told = capture_io(:stderr, fn -> Import.run([file, "-o", out]) end)

    assert told =~
             "Odd; look whether it is meant:\n  drive: conversions.distance: 19000.0 units a metre"

    File.write!(
      file,
      String.replace(
        @player,
        "conversion 190",
        "conversion 190 num_sonars 3 mmrad_sonar_poses [0 1 0]"
      )
    )

    assert [line] = refused(Import, [file, "-o", out, "--force"])
    assert line =~ "mmrad_sonar_poses: there are poses for 1 sonars, and num_sonars says 3"
  end

  test "elsewhere, the colour file is named by its whole path", %{tmp_dir: folder, player: file} do
    out = Path.join([folder, "robots", "min1.exs"])
    File.mkdir_p!(Path.dirname(out))
    capture_io(:stderr, fn -> Import.run([file, "-o", out]) end)
    assert {:ok, robot} = Robot.File.load(out)
    assert robot.colours != nil
    assert File.read!(out) =~ Path.join(folder, "color.cfg")
  end

  test "without OUT only the robot file is on standard output", %{player: file} do
    {text, _told} =
      with_io(:stderr, fn -> capture_io(fn -> Import.run([file, "--name", "min2"]) end) end)

    assert {:ok, %{id: :min2}} =
             Robot.File.parse(text,
               colours: fn "color.cfg", _ ->
                 Vision.Colours.read(Path.join(@robots, "landmark.txt"))
               end
             )
  end

  test "a colour file that is not there is told, and the rest is written", %{
    player: file,
    tmp_dir: folder
  } do
    File.rm!(Path.join(folder, "color.cfg"))
    out = Path.join(folder, "min1.exs")
    told = capture_io(:stderr, fn -> assert refused(Import, [file, "-o", out]) == [] end)
    assert told =~ "colorfile: the colour file is to be put right: "
    assert {:error, [line]} = Robot.File.load(out)
    assert line =~ "color.cfg: no such file or directory"
    assert told =~ "To be put right; no robot starts with this:\n  #{line}\n"

    told = capture_io(:stderr, fn -> capture_io(fn -> refused(Import, [file]) end) end)
    assert told =~ ~r/^  robot file:\d+: colours: .*color.cfg: no such file or directory$/m
  end

  test "a driver that is not known is told with the one that may be meant", context do
    camera = ~s|driver ( name "camerav41" port "/dev/video1" )\n|
    File.write!(context.player, @player <> camera)
    out = Path.join(context.tmp_dir, "min1.exs")
    told = capture_io(:stderr, fn -> Import.run([context.player, "-o", out]) end)

    assert told =~
             ":4: driver camerav41: none of our drivers does what it does; was camerav4l meant?"
  end

  test "wrong words are one line", %{tmp_dir: folder, player: file} do
    for {words, line} <- [
          {[], "which file? mix robot.import FILE"},
          {[file, file], "one file at a time, not 2"},
          {[file, "--outt", "x"], "--outt is no option; --help lists them"},
          {[file, "--player", "3"], "--player cannot be 3: 1 for 1.x, 2 for later ones"},
          {[file, "--player", "x"], "--player cannot be x; --help tells"},
          {[file, "--profile", "magelan"],
           "--profile cannot be magelan: magellan or atrv_mini; did you mean magellan?"},
          {[file, "--name", "rover"], "--name rover is no robot: mag1 to mag100, min1 to min100"},
          {[file, "--name", "mag1", "-o", "mag2.exs"],
           "--name mag1 does not go with a file named mag2.exs"},
          {[folder], "#{folder}: is a directory, where a file is needed"},
          {["none.cfg"], "none.cfg: no such file or directory"},
          {[file, "-o", Path.join(folder, "no/x.exs")],
           "#{Path.join(folder, "no/x.exs")} cannot be written: no such file or directory"}
        ] do
      assert refused(Import, words) == [line]
    end

    File.write!(file, "driver\n( name")
    assert refused(Import, [file]) == ["#{file}:2: name has no value"]
    Import.run(["--help"])
    assert ["Makes a robot file" <> _rest] = said()
  end
end
