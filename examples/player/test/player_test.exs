defmodule PlayerTest do
  use ExUnit.Case, async: true

  doctest Player.RFlexOptions
  doctest Player.Unsupported
  doctest Player.Addresses
  doctest Player.Parts
  doctest Player.Poses
  doctest Player.Sections
  doctest Player.Tokens
  doctest Player.Units
  doctest Player.Writer

  alias Player.{Sections, Writer}

  # A configuration of an ATRV mini for Player 1.6: millimetres, degrees, angles of sonars in
  # radians and first.
  @old """
  # A robot of old.
  define eyes driver ( name "cmvision" requires ["camera:0"] )
  driver
  (
    name "rflex"
    provides ["position:0" "sonar:0" "sonar:1" "power:0"]
    rflex_serial_port "/dev/ttyS1"   # not S2
    mm_length 500.0
    mm_width 300.0
    odo_distance_conversion 190
    odo_angle_conversion 60000
    default_trans_acceleration 250
    range_distance_conversion 1.476
    num_sonars 4
    num_sonars_in_bank [2, 2]
    sonar_2nd_bank_start 2
    mmrad_sonar_poses [0.0 200 100  1.570796 100 0150.0
                       -1.570796 100 -150 -3.14159 -200 -150]
    rflex_power_offset 12
    rflex_joy_pos_ratio 6
    odo_distence_conversion 7
  )
  driver ( name "sonyevid30" port "/dev/ttyS2" fov [3 30] )
  driver ( name "camerav4l" size [320 240] norm "ntsc" )
  eyes ( colorfile "color.cfg" minblobarea 30 )
  driver ( name "festival" port 7000 )
  include "more.inc"
  """

  # A configuration of a Magellan for Player 2, with the millimetres that public files of that
  # kind have.
  @new """
  unit_angle "degrees"
  driver (
    name "rflex" provides ["position2d:0" "sonar:::sonar:0" "bumper:0" "ir:0"]
    rflex_serial_port "/dev/ttyUSB0"
    m_length 0.4 m_width 0.4
    odo_distance_conversion 31387 odo_angle_conversion 4654.2
    default_trans_acceleration 0.1
    range_distance_conversion 1.474
    sonar_ping_delay 1250
    sonar_echo_delay 30000
    mrad_sonar_poses [ 0 200.0 0 1.5708 0 200.0 ]
    num_sonars_in_bank [2]
    rflex_bank_count 1
    rflex_banks [2]
    poses [ 200.0 0 0   0 200.0 90 ]
    rflex_ir_calib [4000 -2 4000 -2]
    bumper_count 16
  )
  """

  defp colours(_name), do: {"color.cfg", Vision.Colours.parse(colour_text(), [])}

  defp colour_text do
    "[Colors]\n(255,0,0) 0.5 10 Ball\n\n[Thresholds]\n(170:240,60:90,130:145)\n"
  end

  # What was written can be read again.
  defp again(text) do
    read = fn "color.cfg", _options -> Vision.Colours.parse(colour_text()) end
    assert {:ok, robot} = Robot.File.parse(text, colours: read)
    assert {:ok, _config} = Robot.File.config(robot)
    robot
  end

  defp options(%{drive: {_module, options}}), do: options

  test "a robot of Player 1.x is imported in metres, and the rest is reported with line and reason" do
    assert {:ok, result} = Player.import(@old, file: "old.cfg", colours: &colours/1)
    assert %{id: :min1, profile: :atrv_mini} = result
    robot = again(result.text)

    assert robot.profile.length == 0.5
    assert robot.profile.width == 0.3
    assert robot.profile.bumpers == 0

    assert Enum.map(robot.profile.sonars, &{&1.x, &1.y, Float.round(&1.heading, 4)}) == [
             {0.2, 0.1, 0.0},
             {0.1, 0.15, 1.5708},
             {0.1, -0.15, -1.5708},
             {-0.2, -0.15, -3.1416}
           ]

    assert options(robot)[:port] == "/dev/ttyS1"
    assert options(robot)[:sonar_banks] == [2, 2]
    assert options(robot)[:power_offset] == 1.2

    assert Enum.sort(options(robot)[:conversions]) ==
             [angle: 60_000.0, distance: 190_000.0, range: 1476.0]

    assert robot.limits == [max_acceleration: 0.25]
    assert {Hal.Visca.Driver, ptz} = robot.ptz
    assert ptz[:port] == "/dev/ttyS2"
    assert {tele, wide} = ptz[:lens]
    assert_in_delta tele, 0.0524, 1.0e-4
    assert_in_delta wide, 0.5236, 1.0e-4

    assert {Hal.Camera.FFmpeg, camera} = robot.camera
    assert Enum.sort(camera) == [norm: :ntsc, size: {320, 240}, source: "/dev/video0"]

    assert robot.colours.min_area == 20
    assert robot.policies == [colour: "Ball"]

    assert result.left == [
             {16, "sonar_2nd_bank_start", "all sonars are one list here"},
             {20, "rflex_joy_pos_ratio",
              "is part of joystick_ratios: of the drive, {m/s, rad/s} a count"},
             {21, "odo_distence_conversion",
              "is not an option of rflex; did you mean odo_distance_conversion?"},
             {26, "driver festival", "speech is not supported"},
             {27, "include \"more.inc\"",
              "other files are not read: import that file, or copy its text"}
           ]

    assert Enum.map(result.assumed, &elem(&1, 1)) == [
             "camera",
             "profile: :atrv_mini",
             "color.cfg"
           ]
  end

  test "numbers in an impossible unit are taken for the likely unit, and reported" do
    assert {:ok, result} = Player.import(@new, file: "new.cfg")
    robot = again(result.text)
    assert result.profile == :magellan
    assert options(robot)[:conversions][:range] == 1474.0
    assert options(robot)[:conversions][:distance] == 31_387.0
    assert options(robot)[:conversions][:ir_a] == 4000.0
    assert options(robot)[:sonar_times] == {30_000, 1250, 0}
    assert Enum.sort(options(robot)[:bumpers]) == [count: 16, style: :bit]
    assert options(robot)[:ir_order] == [0, 1]
    assert [%{x: 0.2, y: +0.0}, %{x: +0.0, y: 0.2, heading: left}] = robot.profile.irs
    assert_in_delta left, :math.pi() / 2, 1.0e-9
    assert [%{x: 0.2}, %{y: 0.2}] = robot.profile.sonars
    assert result.left == []

    assert for({line, what, _why} <- result.assumed, do: {line, what}) == [
             {1, "bumpers"},
             {1, "profile: :magellan"},
             {7, "default_trans_acceleration"},
             {8, "range_distance_conversion"},
             {11, "mrad_sonar_poses"},
             {15, "poses"}
           ]

    # The assumptions are at the head of the file, too.
    assert result.text =~ "#   line 8, range_distance_conversion: taken for units per millimetre"
  end

  test "the old formula of infrareds becomes the new one: the same volts, the same metres" do
    text = """
    driver ( name "rflex" mm_length 500 mm_width 500 poses [200 0 0]
      rflex_ir_calib [0.0005456 -2.086] )
    """

    assert {:ok, result} = Player.import(text)
    conversions = options(again(result.text))[:conversions]

    for {volts, mm} <- [{80, 687}, {100, 431}, {150, 185}, {200, 101}] do
      metres = conversions[:ir_a] * :math.pow(volts, conversions[:ir_b])
      assert trunc(metres * 1000) == mm
    end
  end

  test "sonars whose angle comes last are recognised by impossible angles" do
    text = """
    driver ( name "rflex" mm_length 630 mm_width 540
      mmrad_sonar_poses [0258.170 0114.700 0.0 -0258.170 -0114.700 -3.141592] )
    """

    assert {:ok, result} = Player.import(text)
    assert [first, second] = again(result.text).profile.sonars
    assert {first.x, first.y, first.heading} == {0.25817, 0.1147, 0.0}
    assert_in_delta second.heading, -3.141592, 1.0e-6

    assert {2, "mmrad_sonar_poses", "read as x, y, theta" <> _} =
             List.keyfind(result.assumed, 2, 0)
  end

  # A base larger than ours: two rings of 24 sonars on fourteen boards, 24 infrareds and 14
  # bumpers around it. Its angles count on beyond a turn, and there are more poses than sensors.
  defp ring(count, radius, from, form) do
    for k <- 0..(count - 1) do
      angle = from - 2 * :math.pi() * k / count
      form.(Float.round(angle, 6), radius * :math.cos(angle), radius * :math.sin(angle))
    end
  end

  # Without exponents, which Player does not read.
  defp words(tuples) do
    tuples |> List.flatten() |> Enum.map_join(" ", &:erlang.float_to_binary(&1, decimals: 6))
  end

  defp large(more \\ %{}) do
    theta_first = fn angle, x, y -> [angle, x, y] end
    upper = ring(24, 0.24, 7.5, theta_first)
    lower = ring(24, 0.26, 4.0, theta_first)
    spare = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]

    given =
      Map.merge(
        %{
          sonars: words(upper ++ lower ++ spare),
          count: 48,
          banks: "4 4 4 4 4 4 3 3 3 3 3 3 3 3",
          irs: words(ring(24, 0.25, 7.33, fn angle, x, y -> [x, y, angle] end)),
          boards: "4 4 4 4 4 4",
          bumpers: words(ring(14, 0.26, 2.6, fn angle, x, y -> [x, y, angle, 0.2, 0.26] end)),
          more: ""
        },
        more
      )

    """
    driver (
      name "rflex" provides ["position2d:0" "sonar:0" "ir:0" "bumper:0"]
      rflex_serial_port "/dev/ttyR0"
      m_length 0.5 m_width 0.5
      odo_distance_conversion 103000 odo_angle_conversion 35000
      default_trans_acceleration 0.5 default_rot_acceleration 0.017
      range_distance_conversion 1476
      num_sonars #{given.count}
      num_sonars_in_bank [#{given.banks}]
      mrad_sonar_poses [#{given.sonars}]
      rflex_banks [#{given.boards}]
      poses [#{given.irs}]
      bumper_count 14 rflex_bumper_style "addr"
      bumper_def [#{given.bumpers}]
      #{given.more}
    )
    """
  end

  test "the positions of sensors decide what their angles mean: radians that count on beyond a turn" do
    assert {:ok, result} = Player.import(large(), file: "large.cfg")
    robot = again(result.text)
    assert length(robot.profile.sonars) == 48
    assert length(robot.profile.irs) == 24

    for %{x: x, y: y, heading: heading} <- robot.profile.sonars ++ robot.profile.irs do
      assert abs(Hal.Pose.wrap(heading - :math.atan2(y, x))) < 1.0e-4
      assert abs(heading) <= 2 * :math.pi() + 0.01
    end

    assert %{x: x} = hd(robot.profile.sonars)
    assert_in_delta x, 0.24 * :math.cos(7.5), 1.0e-5
    assert options(robot)[:sonar_banks] == List.duplicate(4, 6) ++ List.duplicate(3, 8)
    assert options(robot)[:ir_banks] == List.duplicate(4, 6)
    assert options(robot)[:ir_order] == Enum.to_list(0..23)

    # The first is to the left behind, and the others follow clockwise.
    assert [7, 5, 4 | _] = options(robot)[:bumpers][:segments]
    assert length(options(robot)[:bumpers][:segments]) == 14

    # With it, reaching full turn speed would take a minute.
    assert robot.limits == [max_acceleration: 0.5]

    assert [{6, "default_rot_acceleration", why}] = result.left
    assert why =~ "with 0.017 rad/s2 it would take 59 s"

    assert [
             {1, "profile: :magellan", _},
             {10, "mrad_sonar_poses", sonars},
             {12, "poses", "angles taken for radians, some of them beyond a turn" <> _},
             {12, "rflex_ir_calib", "is not given" <> _}
           ] = result.assumed

    assert sonars ==
             "the first 48 of 50 poses are taken, as many sonars as num_sonars_in_bank says"
  end

  test "degrees are recognised by positions, too, whatever a file says" do
    degrees = words(ring(8, 0.2, 6.0, fn angle, x, y -> [x, y, angle * 180 / :math.pi()] end))
    small = words(ring(8, 0.2, 6.0, fn angle, x, y -> [x, y, angle] end))
    text = &~s|#{&2} driver ( name "rflex" m_length 0.4 rflex_banks [8] poses [#{&1}] )|

    for {poses, unit, assumed} <- [
          {degrees, "", "angles taken for degrees: so they point away from the middle"},
          {degrees, ~s(unit_angle "degrees"), nil},
          {degrees, ~s(unit_angle "radians"),
           "angles taken for degrees, not for radians: so they point away from the middle"},
          {small, "", nil},
          {small, ~s(unit_angle "degrees"),
           "angles taken for radians, not for degrees: so they point away from the middle"}
        ] do
      assert {:ok, result} = Player.import(text.(poses, unit))

      for %{x: x, y: y, heading: heading} <- again(result.text).profile.irs,
          do: assert(abs(Hal.Pose.wrap(heading - :math.atan2(y, x))) < 1.0e-4)

      assert assumed ==
               Enum.find_value(result.assumed, fn
                 {_, "poses", w} -> w
                 _ -> nil
               end)
    end
  end

  test "a file that leaves its sensors open is refused with the line, and nothing is guessed" do
    inwards = words(ring(24, 0.25, 7.33, fn angle, x, y -> [-x, -y, angle] end))
    few = words(ring(40, 0.25, 1.0, fn angle, x, y -> [angle, x, y] end))
    askew = words(ring(48, 0.25, 1.0, fn angle, x, y -> [angle + 1.6, x, y] end))

    for {more, line} <- [
          {%{irs: inwards},
           "12: poses: neither in radians nor in degrees do they point away from the middle"},
          {%{sonars: few},
           "10: mrad_sonar_poses: there are poses for 40 sonars, and num_sonars_in_bank says 48"},
          {%{sonars: askew}, "10: mrad_sonar_poses: neither as theta, x, y nor as x, y, theta"},
          {%{sonars: "1 2"},
           "10: mrad_sonar_poses: is not a list of three numbers for each sensor"},
          {%{count: 46}, "9: num_sonars_in_bank: adds up to 48 sonars, and num_sonars is 46"},
          {%{boards: "4 4 4 4 4 5"},
           "12: poses: there are poses for 24 infrareds, and rflex_banks says 25"},
          {%{boards: "24"},
           "11: rflex_banks: a board has 0 to 8 infrareds, and there are 8 boards"},
          {%{banks: "48"}, "9: num_sonars_in_bank: a bank has 0 to 16 sonars"},
          {%{more: "mrad_sonar_poses [0 1 1]"}, "15: mrad_sonar_poses: occurs twice"}
        ] do
      assert {:error, told} = Player.import(large(more), file: "large.cfg")
      assert String.starts_with?(told, "large.cfg:" <> line), told
    end

    # Without poses, those of the kind of robot are taken, if it has as many.
    text =
      &~s|driver ( name "rflex" m_length 0.4 num_sonars_in_bank [#{&1}] rflex_banks [#{&2}] )|

    assert {:error, told} = Player.import(text.("8 8 8", "8 8"), file: "x.cfg")
    assert told =~ "x.cfg:1: num_sonars_in_bank: adds up to 24 sonars, and there are no poses"
    assert {:error, told} = Player.import(text.("8 8", "8"), file: "x.cfg")
    assert told =~ "x.cfg:1: rflex_banks: adds up to 8 infrareds, and there are no poses"
    assert {:ok, result} = Player.import(text.("8 8", "8 8"), profile: :magellan)
    assert length(again(result.text).profile.irs) == 16
    why = "there are no poses: those of a magellan are taken"
    assert {1, "num_sonars_in_bank", why} in result.assumed
    assert {1, "rflex_banks", why} in result.assumed
  end

  test "what a person asks for wins over a guess" do
    assert {:ok, %{id: :min4, profile: :atrv_mini}} =
             Player.import(@new, id: :min4, profile: :atrv_mini)

    text = ~s|driver ( name "rflex" odo_distance_conversion 4000 odo_angle_conversion 1 )|
    assert {:ok, old} = Player.import(text, version: 1)
    assert options(again(old.text))[:conversions][:distance] == 4_000_000.0
    assert {:ok, new} = Player.import(text, version: 2)
    assert options(again(new.text))[:conversions][:distance] == 4000.0
  end

  test "old devices by interface, impossible limits and values, and repeated options" do
    text = """
    position:0 (
      driver "rflex"
      mm_length 630 mm_width 540
      default_trans_acceleration 1000
      odo_angle_conversion "much"
      bumper_count 99
      rflex_serial_port "/dev/ttyS1" rflex_serial_port "/dev/ttyS9"
    )
    driver ( name "rflex" )
    driver ( name "camerav4l" port "/dev/video1" )
    laser:0 ( driver "sicklms200" )
    """

    assert {:ok, result} = Player.import(text)
    assert options(again(result.text))[:port] == "/dev/ttyS9"

    assert for({line, what, _why} <- result.left, do: {line, what}) == [
             {4, "default_trans_acceleration"},
             {5, "odo_angle_conversion"},
             {6, "bumper_count"},
             {7, "rflex_serial_port"},
             {9, "driver rflex"},
             {10, "port"},
             {11, "laser:0"}
           ]
  end

  # A section for each interface, as in the first versions of Player; `given` adds lines on sonars
  # and others.
  defp pieces(sonars, more \\ "") do
    """
    position:0 ( driver "rflex_position"
      rflex_serial_port "/dev/ttyS1"
      mm_length "500.0"
      mm_width "500.0"
      odo_distance_conversion "31.387"
      odo_angle_conversion 4654.2 )
    sonar:0 ( driver "rflex_sonar" range_distance_conversion "1.4" #{sonars} )
    power:0 ( driver "rflex_power" rflex_power_offset 12 )
    laser:0 ( port "/dev/ttyS2" )
    #{more}
    """
  end

  test "a base split into one driver for each of its interfaces is one base" do
    poses = words(ring(6, 200.0, 3.0, fn angle, x, y -> [angle, x, y] end))
    text = pieces(~s|num_sonars "6" num_sonars_in_bank "3 3" mmrad_sonar_poses "#{poses}"|)
    assert {:ok, result} = Player.import(text, profile: :magellan)
    robot = again(result.text)
    assert %{port: "/dev/ttyS1", sonar_banks: [3, 3], power_offset: 1.2} = Map.new(options(robot))
    assert options(robot)[:conversions] == [distance: 31_387.0, angle: 4654.2, range: 1400.0]
    assert %{length: 0.5, width: 0.5, radius: 0.25} = robot.profile
    assert length(robot.profile.sonars) == 6
    assert [{9, "laser:0", _why}] = result.left

    # If any of the sections leaves sensors open, the file is refused, as with one section.
    assert {:error, line} = Player.import(pieces(~s|num_sonars_in_bank "3 many"|), file: "x.cfg")
    assert line =~ "x.cfg:7: num_sonars_in_bank: "
    more = ~s|sonar:1 ( driver "rflex_sonar" num_sonars_in_bank [8] )|
    text = pieces("num_sonars_in_bank [8 8]", more)
    assert {:error, line} = Player.import(text, file: "x.cfg", profile: :magellan)
    assert line =~ "x.cfg:10: num_sonars_in_bank: occurs twice"
  end

  test "infrareds without a formula are reported as not read, sensors beyond the body as odd" do
    ring = words(ring(8, 0.23, 1.0, fn angle, x, y -> [x, y, angle] end))
    text = ~s|driver ( name "rflex" m_length 0.4 m_width 0.4 rflex_banks [8] poses [#{ring}] )|
    assert {:ok, result} = Player.import(text, profile: :magellan)
    why = "is not given, so that no infrared is read"
    assert {1, "rflex_ir_calib", why} in result.assumed
    odd = Robot.File.Warnings.lines(again(result.text), fn _device -> true end)

    assert Enum.any?(odd, fn line ->
             line =~
               "body.irs: the farthest is 0.230 m from the middle, and the body's radius is 0.200"
           end)

    law = ~s|m_width 0.4 rflex_ir_calib [#{words(List.duplicate([4000.0, -2.0], 8))}]|
    text = String.replace(text, "m_width 0.4", law)
    assert {:ok, result} = Player.import(text, profile: :magellan)
    refute {1, "rflex_ir_calib", why} in result.assumed
  end

  test "norm and input of a frame grabber" do
    text = fn more ->
      """
      driver ( name "rflex" rflex_serial_port "/dev/ttyS1" )
      driver ( name "camerav4l" port "/dev/video1" #{more} )
      driver ( name "cmvision" colorfile "color.cfg" )
      """
    end

    file = [colours: &colours/1]
    assert {:ok, result} = Player.import(text.(~s(source 2 norm "PAL")), file)

    assert result.text =~
             ~s(camera: {Hal.Camera.FFmpeg, [source: "/dev/video1", input: 2, norm: :pal]})

    assert {:ok, %{left: []} = result} = Player.import(text.(~s(norm "UNKNOWN")), file)
    refute result.text =~ "norm"

    assert {:ok, result} = Player.import(text.(~s(source 99 norm "film")), file)
    assert for({_, what, _why} <- result.left, do: what) |> Enum.sort() == ["norm", "source"]
  end

  test "definitions are expanded, and a section's own options win" do
    text = """
    define base driver ( name "rflex" port 1 size [1 2] )
    define small base ( size [3] )
    small ( port 2 )
    plain
    (
      inner ( a -.5 )
      pose[0] [1 2]
    )
    """

    assert {:ok, %{sections: [small, plain]}} = Sections.parse(text)
    assert small.type == "driver"

    assert Enum.sort(small.options) == [
             {"name", 1, "rflex"},
             {"port", 3, 2},
             {"size", 2, {:tuple, [3]}}
           ]

    assert [%{type: "inner", options: [{"a", 6, -0.5}]}] = plain.sections
    assert plain.options == [{"pose[0]", 7, {:tuple, [1, 2]}}]
  end

  test "malformed files are reported by file and line" do
    for {text, line} <- [
          {"driver\n(\n name \"rflex\n)", "x.cfg:3: the text that begins here has no closing \""},
          {"driver\n(\n name \"rflex\"", "x.cfg:2: the ( here is never closed"},
          {"driver ( a [ 1\n 2", "x.cfg:1: the [ here is never closed"},
          {"driver ( a )", "x.cfg:1: a has no value"},
          {"driver (\n a\n b 1 )", "x.cfg:2: a has no value"},
          {"\n)", "x.cfg:2: ) is not an option or a section"},
          {"driver (\n 5 )", "x.cfg:2: 5 is not the name of an option"},
          {"define x ( a 1 )", "x.cfg:1: define is written: define new_name old_name ( … )"},
          {"a 1.2.3", "x.cfg:1: 1.2.3 is not a number: Player reads a sign, digits and a point"},
          {"a 1e-3", "x.cfg:1: 1e-3 is not a number: Player reads a sign, digits and a point"},
          {"a 0x31", "x.cfg:1: 0x31 is not a number: Player reads a sign, digits and a point"},
          {"# old\rdriver (\r b )", "x.cfg:3: b has no value"},
          {"a\n  b" <> <<200>>, "x.cfg:2: byte 200 is not allowed in a configuration file"},
          {"", "x.cfg:1: no robot is in it: it has no driver"},
          {String.duplicate("a ( ", 30), "x.cfg:1: nested more than 20 levels deep"},
          {"a " <> String.duplicate("[ ", 30), "x.cfg:1: nested more than 20 levels deep"}
        ] do
      assert Player.import(text, file: "x.cfg") == {:error, line}
    end
  end

  test "of definitions with one name the first counts" do
    text = """
    define base driver ( name "rflex" )
    define base driver ( name "p2os" )
    base ( rflex_serial_port "/dev/ttyS1" )
    """

    assert {:ok, %{left: []} = result} = Player.import(text)
    assert options(again(result.text))[:port] == "/dev/ttyS1"
  end

  test "a file with robots at several ports is read for the first of them" do
    text = """
    driver ( name "camerav4l" provides ["6666:camera:0"] port "/dev/video6" )
    driver ( name "rflex" provides ["odometry::6667:position2d:0" "6667:sonar:0"] rflex_serial_port "/dev/ttyS7" )
    driver ( name "rflex" provides ["position2d:0"] rflex_serial_port "/dev/ttyS5" )
    driver ( name "sonyevid30" provides ["6666:ptz:0"] port "/dev/ttyS6" )
    driver ( name "camerav4l" provides "6667:camera:0" port "/dev/video7" )
    driver ( name "cmvision" provides ["6667:blobfinder:0"] requires ["6667:camera:0"] colorfile "color.cfg" )
    """

    assert {:ok, result} = Player.import(text, colours: &colours/1)
    robot = again(result.text)
    assert options(robot)[:port] == "/dev/ttyS7"
    assert robot.ptz == nil
    assert {Hal.Camera.FFmpeg, [source: "/dev/video7"]} = robot.camera

    assert result.left == [
             {1, "driver camerav4l",
              "is of the robot at port 6666; the one at port 6667 is imported"},
             {3, "driver rflex",
              "is of the robot at port 6665; the one at port 6667 is imported"},
             {4, "driver sonyevid30",
              "is of the robot at port 6666; the one at port 6667 is imported"}
           ]
  end

  test "of several cameras the one that the blob finder requires is taken" do
    text = fn index ->
      """
      driver ( name "rflex" provides ["position2d:0"] rflex_serial_port "/dev/ttyS1" )
      driver ( name "camerav4l" provides ["camera:0"] port "/dev/video0" )
      driver ( name "camerav4l" provides ["camera:1"] port "/dev/video1" )
      driver ( name "cmvision" requires ["eye:::camera:#{index}"] colorfile "color.cfg" )
      """
    end

    for {index, other} <- [{0, 3}, {1, 2}] do
      assert {:ok, result} = Player.import(text.(index), colours: &colours/1)
      source = "/dev/video#{index}"
      assert {Hal.Camera.FFmpeg, [source: ^source]} = again(result.text).camera

      assert result.left == [
               {other, "driver camerav4l", "the blob finder looks at camera:#{index}"}
             ]
    end

    # Such as a camera:7 of a driver that is left out.
    assert {:ok, result} = Player.import(text.(7), colours: &colours/1)
    assert {Hal.Camera.FFmpeg, [source: "/dev/video0"]} = again(result.text).camera
    assert {4, _what, why} = List.keyfind(result.assumed, "requires", 1)
    assert why =~ "no known driver provides camera:7"
  end

  test "a file without a robot of ours says why, with the line" do
    for {text, line} <- [
          {~s|\ndriver ( name "sicklms200" )\ndriver ( name "erratic" )|,
           "3: no robot of ours is in it: its base has the driver erratic"},
          {~s|position:0 ( driver "p2os_position" )|,
           "1: no robot of ours is in it: its base has the driver p2os_position"},
          {~s|driver ( name "vfh" )\ndriver ( name "stage" worldfile "a.world" )|,
           "2: no real robot is in it: stage simulates its devices; a Stage world is played"},
          {~s|driver ( name "gz_position" )|,
           "1: no real robot is in it: gz_position simulates its devices"},
          {~s|\ndriver ( name "readlog" provides ["position2d:0"] )|,
           "2: no robot is in it: it plays a log"},
          {~s|\ninclude "base.inc"\ndriver ( name "festival" )|,
           "2: no robot is in it without \"base.inc\": other files are not read"},
          {~s|driver ( name "cvcam" ) driver ( name "festival" )|,
           "1: no robot is in it: none of its drivers is of a base (cvcam, festival)"},
          {"dio (\n port 1 )", "1: no robot is in it: it has no driver"}
        ] do
      assert {:error, told} = Player.import(text, file: "x.cfg")
      assert String.starts_with?(told, "x.cfg:" <> line), told
    end
  end

  test "definitions of definitions end before they fill the memory" do
    lines = for n <- 1..40, do: "define d#{n} d#{n - 1} ( d#{n - 1} ( a 1 ) d#{n - 1} ( a 1 ) )\n"
    assert {:error, line} = Player.import("define d0 driver ( a 1 )\n#{lines}d40 ( b 1 )")
    assert line =~ "more than 20000 options"
  end

  test "text that could make a file lie is left out" do
    for port <- ["/dev/tty\u202E1", "/dev/" <> <<255>>, "a\tb\u0000"] do
      text = "driver ( name \"rflex\" rflex_serial_port \"#{port}\" )"
      assert {:ok, result} = Player.import(text)
      assert {1, "rflex_serial_port", "is not plain text"} in result.left
      assert options(again(result.text))[:port] == "/dev/ttyR0"
    end

    # What looks like code is text.
    text = ~s|driver ( name "rflex" rflex_serial_port "a\#{1}\\\\b" )|
    assert {:ok, result} = Player.import(text)
    assert options(again(result.text))[:port] == "a\#{1}\\\\b"
  end

  test "a number of sonars that is not a number is reported, even with poses" do
    text = ~s|driver ( name "rflex" num_sonars "+" mrad_sonar_poses [0 200 0 1.5708 0 200] )|
    assert {:error, line} = Player.import(text)
    assert line =~ "num_sonars: has an impossible value"
  end

  test "boards without infrareds have no order, whatever poses there are" do
    text = String.replace(@new, "rflex_banks [2]", "rflex_banks [0]")

    assert {:ok, result} = Player.import(text, colours: &colours/1)
    options = options(again(result.text))
    assert options[:ir_order] == nil and options[:ir_banks] == nil
  end

  test "times of the sonars that are too long for all of them are left out" do
    text = String.replace(@old, "num_sonars 4", "num_sonars 4 sonar_echo_delay 300000")
    assert {:ok, result} = Player.import(text, colours: &colours/1)

    assert {14, "sonar_echo_delay",
            "a round of the sonars would take 2.1 s, and 2.0 s are allowed"} in result.left

    assert options(again(result.text))[:sonar_times] == nil
  end

  test "a head on the line of the base is left out" do
    text = String.replace(@old, "/dev/ttyS2", "/dev/ttyS1")
    assert {:ok, result} = Player.import(text, colours: &colours/1)
    assert {23, "port", "the camera's head is on the base's line, /dev/ttyS1"} in result.left
    assert again(result.text).ptz == nil
  end

  test "random damage never raises, and what is imported is always a robot" do
    bytes = ~c"[](),\"#.-+ \n\t0159azAZ_:" ++ [0, 200, 255]

    for text <- [@old, @new], _ <- 1..500 do
      at = :rand.uniform(byte_size(text)) - 1
      cut = min(:rand.uniform(8) - 1, byte_size(text) - at)
      new = for _ <- 1..:rand.uniform(4), into: "", do: <<Enum.random(bytes)>>
      rest = binary_part(text, at + cut, byte_size(text) - at - cut)

      case Player.import(binary_part(text, 0, at) <> new <> rest, colours: &colours/1) do
        {:ok, result} -> again(result.text)
        {:error, line} -> assert is_binary(line)
      end
    end
  end

  test "no name in a file becomes an atom" do
    strange = "strange#{System.unique_integer([:positive])}"

    assert {:ok, _result} =
             Player.import(
               "#{strange} 1 driver ( name \"rflex\" #{strange} #{strange} ) #{strange} ( a 1 )"
             )

    assert_raise ArgumentError, fn -> String.to_existing_atom(strange) end
  end

  test "all values that are written are read back unchanged" do
    values = [id: :mag1, start: {1.0e-7, -12.5, {:deg, -22.5}}, arm: :auto, limits: []]

    assert {:ok, {_, {:keys, keys}}} =
             values
             |> Keyword.drop([:limits])
             |> then(&Writer.text([], &1))
             |> Robot.File.Reader.read()

    assert [
             {"id", _, {_, {:name, "mag1"}}},
             {"start", _, {_, {:tuple, [{_, x}, {_, y}, {_, a}]}}} | _
           ] = keys

    assert {x, y} == {1.0e-7, -12.5}
    assert_in_delta a, -0.3927, 1.0e-4
  end
end
