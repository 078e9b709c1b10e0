defmodule Mix.Tasks.Robot.ImportTest do
  use Hal.TaskCase, async: false
  import ExUnit.CaptureIO
  alias Mix.Tasks.Robot.Import

  @robots Path.expand("../../../../../config/robots", __DIR__)
  @player """
  driver ( name "rflex" rflex_serial_port "/dev/ttyS1" mm_length 500 mm_width 300
    odo_distance_conversion 190 odo_angle_conversion 60000 sonar_2nd_bank_start 8 )
  driver ( name "cmvision" colorfile "color.cfg" )
  """

  setup %{tmp_dir: folder} do
    File.cp!(Path.join(@robots, "landmark.txt"), Path.join(folder, "color.cfg"))
    file = Path.join(folder, "old.cfg")
    File.write!(file, @player)
    {:ok, player: file}
  end

  test "a Player file becomes a valid robot file", %{tmp_dir: folder, player: file} do
    out = Path.join(folder, "min7.exs")
    told = capture_io(:stderr, fn -> Import.run([file, "-o", out]) end)
    assert told =~ "#{file}:2: sonar_2nd_bank_start: all sonars are one list here"
    assert told =~ "Assumed; check whether this is right:"
    assert told =~ "#{out} written: 1 assumed, 1 not carried over"

    assert {:ok, %{id: :min7} = robot} = Robot.File.load(out)
    assert {:ok, _config} = Robot.File.config(robot)
    assert [%{name: "YellowLandmark"}] = robot.colours.classes

    assert refused(Import, [file, "-o", out]) == [
             "#{out} exists already; --force overwrites it"
           ]

    capture_io(:stderr, fn ->
      Import.run([file, "-o", out, "--force", "--profile", "magellan"])
    end)

    assert {:ok, %{id: :min7, profile: %{name: :magellan}}} = Robot.File.load(out)
  end

  test "a value that was carried over and is odd is reported at once", %{
    tmp_dir: folder,
    player: file
  } do
    File.write!(file, String.replace(@player, "conversion 190", "conversion 19"))
    out = Path.join(folder, "min7.exs")
    told = capture_io(:stderr, fn -> Import.run([file, "-o", out]) end)

    assert told =~
             "Odd; check whether this is meant:\n  drive: conversions.distance: 19000.0 units a metre"

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

  test "a colour file elsewhere is named by its whole path", %{tmp_dir: folder, player: file} do
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

  test "a missing colour file is reported, and the rest is written", %{
    player: file,
    tmp_dir: folder
  } do
    File.rm!(Path.join(folder, "color.cfg"))
    out = Path.join(folder, "min1.exs")
    told = capture_io(:stderr, fn -> assert refused(Import, [file, "-o", out]) == [] end)
    assert told =~ "colorfile: the colour file must be corrected: "
    assert {:error, [line]} = Robot.File.load(out)
    assert line =~ "color.cfg: no such file or directory"
    assert told =~ "To be corrected; no robot starts with this:\n  #{line}\n"

    told = capture_io(:stderr, fn -> capture_io(fn -> refused(Import, [file]) end) end)
    assert told =~ ~r/^  robot file:\d+: colours: .*color.cfg: no such file or directory$/m
  end

  test "an unknown driver is reported with the one that may be meant", context do
    camera = ~s|driver ( name "camerav41" port "/dev/video1" )\n|
    File.write!(context.player, @player <> camera)
    out = Path.join(context.tmp_dir, "min1.exs")
    told = capture_io(:stderr, fn -> Import.run([context.player, "-o", out]) end)

    assert told =~
             ":4: driver camerav41: none of our drivers does what it does; did you mean camerav4l?"
  end

  test "wrong arguments are an error of one line", %{tmp_dir: folder, player: file} do
    for {words, line} <- [
          {[], "FILE is missing: mix robot.import FILE"},
          {[file, file], "one file at a time, not 2"},
          {[file, "--outt", "x"], "robot.import: unknown option --outt; did you mean --out?"},
          {[file, "--player", "3"],
           ~s(robot.import: --player: expected 1 for 1.x or 2 for later ones, got "3")},
          {[file, "--player", "x"],
           ~s(robot.import: --player: expected 1 for 1.x or 2 for later ones, got "x")},
          {[file, "--profile", "magelan"],
           ~s(robot.import: --profile: expected burger, mag, min, waffle, magellan, atrv_mini, create2, kobuki, pioneer3, turtlebot3_burger or turtlebot3_waffle, got "magelan"; did you mean magellan?)},
          {[file, "--name", "Rover"], "--name Rover: expected #{Hal.RobotName.allowed()}"},
          {[file, "--name", "mag1", "-o", "mag2.exs"],
           "--name mag1 does not match a file named mag2.exs"},
          {[folder], "#{folder}: is a directory, not a file"},
          {["none.cfg"], "none.cfg: no such file or directory"},
          {[file, "-o", Path.join(folder, "no/x.exs")],
           "#{Path.join(folder, "no/x.exs")} cannot be written: no such file or directory"}
        ] do
      assert refused(Import, words) == [line]
    end

    File.write!(file, "driver\n( name")
    assert refused(Import, [file]) == ["#{file}:2: name has no value"]
    help = capture_io(fn -> Import.run(["--help"]) end)
    assert help =~ "Converts a configuration of the Player"
    assert help =~ ~r/^  --profile KIND/m
  end
end
