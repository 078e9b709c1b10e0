defmodule Robot.File.BodiesTest do
  @moduledoc "Bodies are data: those that come along, files of one's own, and tables in the files of robots."
  use ExUnit.Case, async: true
  alias Hal.Profile
  alias Robot.File.{Bodies, Body, Summary, Warnings}
  @moduletag :tmp_dir

  @rover """
  [
    about: "a rover",
    length: 0.5,
    width: 0.3,
    offset: -0.05,
    wheel_base: 0.25,
    limits: [max_linear: 0.4, max_turn: 1.5],
    sonars: [{0.2, 0.0, 0.0}]
  ]
  """

  # A folder as `config`, with bodies and a robot's file; the robot, or the lines that are wrong.
  defp robot(folder, body, more) do
    for name <- ~w(bodies robots), do: File.mkdir_p!(Path.join(folder, name))
    File.write!(Path.join(folder, "bodies/rover.exs"), body)
    file = Path.join(folder, "robots/rex.exs")
    File.write!(file, "[id: :rex, drive: {Robot.FileDrive, port: \"/dev/ttyS1\"},\n#{more}]")
    Robot.File.load(file)
  end

  test "each body that comes along is whole, holds its sensors, and says what it is" do
    for body <- Bodies.all() do
      assert body.wheel_base > 0 and body.max_linear > 0 and body.max_turn > 0
      assert is_binary(body.about) and is_float(body.mass)
      assert 2 * body.radius + 0.001 >= max(body.length, body.width)

      for pose <- body.sonars,
          do: assert(Hal.Pose.distance({0.0, 0.0}, pose) <= body.radius + 0.005)

      if not Profile.round?(body), do: assert([_, _, _, _] = Profile.corners(body))
    end

    round = for body <- Bodies.all(), Profile.round?(body), do: body.name
    assert round == [:magellan, :create2, :kobuki]
  end

  test "their published numbers" do
    {:ok, burger} = Bodies.fetch(:turtlebot3_burger)
    assert %{length: 0.138, width: 0.178, wheel_base: 0.16, max_linear: 0.22, sonars: []} = burger
    assert_in_delta burger.radius, :math.sqrt(0.101 ** 2 + 0.089 ** 2), 1.0e-9
    assert burger.camera.max_pan == 0.0
    assert %{rays: 360, max: 3.5, period: 0.2, pose: %{x: -0.032}} = burger.scan
    assert burger.sonar_round_s == 0.2
    assert {:ok, %{radius: 0.17, wheel_base: 0.235, camera: nil}} = Bodies.fetch("create2")
    assert {:ok, %{max_linear: 0.7, max_acceleration: 0.3}} = Bodies.fetch("kobuki")
    assert {:ok, %{sonars: sonars, max_linear: 1.2}} = Bodies.fetch("pioneer3")
    assert length(sonars) == 16
    assert Bodies.fetch("mag") == {:ok, Profile.magellan()}
    assert Bodies.fetch("min") == {:ok, Profile.atrv_mini()}
  end

  test "a body of one's own is found by its file's name, and a robot's file changes it", %{
    tmp_dir: folder
  } do
    assert {:ok, robot} =
             robot(folder, @rover, "profile: :rover, body: [width: 0.32, camera: []]")

    assert %{name: :rover, length: 0.5, width: 0.32, offset: -0.05} = robot.profile
    assert robot.profile.radius == :math.sqrt(0.3 * 0.3 + 0.15 * 0.15)
    assert robot.profile.camera == Profile.camera()
    assert hd(Summary.lines(robot)) =~ "rex, a rover: 0.50 m long, 0.32 m wide, 0.34 m to"
    assert {:ok, robot} = robot(folder, @rover, "profile: :burger, body: [camera: nil]")
    assert %{name: :turtlebot3_burger, camera: nil} = robot.profile
  end

  test "a whole body in the file of the robot needs no other", %{tmp_dir: folder} do
    table = @rover |> String.trim() |> String.trim_leading("[") |> String.trim_trailing("]")
    assert {:ok, robot} = robot(folder, @rover, "body: [#{table}]")
    {:ok, rover} = Bodies.fetch("rover", [Path.join(folder, "bodies")])
    assert robot.profile == %{rover | name: :rex}
  end

  test "what is wrong is said in one line, where it is", %{tmp_dir: folder} do
    file = Path.join(folder, "robots/rex.exs")
    rover = Path.join(folder, "bodies/rover.exs")

    for {body, more, lines} <- [
          {@rover, "profile: :rovr",
           [
             "#{file}:2: profile: no body is named rovr: there are burger, mag, min, waffle, " <>
               "magellan, atrv_mini, create2, kobuki, pioneer3, turtlebot3_burger, " <>
               "turtlebot3_waffle, rover; did you mean rover?"
           ]},
          {@rover, "profile: 3",
           ["#{file}:2: profile: expected the name of a body, such as :magellan, got 3"]},
          {@rover, "profile: :\"../robots/rex\"",
           ["#{file}:2: profile: no body is named ../robots/rex: there are "]},
          {"[radius: 0.2,\n wheel_base: 9]", "profile: :rover",
           [
             "#{file}:2: profile: #{rover}:2: wheel_base: expected a number from 0.05 to 2.0 m, got 9"
           ]},
          {"[widht: 1]", "profile: :rover",
           ["#{file}:2: profile: #{rover}:1: widht: is not known: allowed are about, "]},
          {"halt()", "profile: :rover",
           ["#{file}:2: profile: #{rover}:1: a body is one list, [key: value, …]"]},
          {"[radius: 0.1, length: 0.4, width: 0.4, wheel_base: 0.3,\nlimits: [max_linear: 1, max_turn: 1]]",
           "profile: :rover",
           [
             "#{file}:2: profile: #{rover}:1: radius: expected at least 0.2, within which its sides are, got 0.1"
           ]},
          {@rover, "body: [length: 0.4]",
           [
             "#{file}:2: body.radius: is missing: a whole body has a radius, or a length and a width",
             "#{file}:2: body.wheel_base: is missing: a whole body says how far its wheels are apart",
             "#{file}:2: body.limits.max_linear: is missing: a whole body says how fast it drives",
             "#{file}:2: body.limits.max_turn: is missing: a whole body says how fast it turns"
           ]},
          {@rover, "profile: :rover, limits: [max_linear: 0.5]",
           ["#{file}:2: limits.max_linear: expected at most 0.4, which a rover can do, got 0.5"]},
          {@rover, "arm: :auto", ["#{file}:1: profile: is missing: expected the name of a body"]},
          {@rover, "profile: :create2, camera: {Robot.FileCamera, []}, colours: nil",
           ["#{file}:2: camera: "]}
        ] do
      assert {:error, said} = robot(folder, body, more)
      assert length(said) == length(lines), inspect(said)
      for {line, begins} <- Enum.zip(said, lines), do: assert(String.starts_with?(line, begins))
      refute Enum.any?(said, &(&1 =~ "\n"))
    end

    File.write!(Path.join(folder, "bodies/kobuki.exs"), @rover)

    assert Bodies.fetch("kobuki", [Path.join(folder, "bodies")]) ==
             {:error,
              [
                "#{folder}/bodies/kobuki.exs: kobuki is a body that comes along; another name is needed"
              ]}
  end

  test "a file of a body makes one atom, that of its own name", %{tmp_dir: folder} do
    name = "b#{System.unique_integer([:positive])}"
    File.write!(Path.join(folder, name <> ".exs"), @rover)
    none? = &match?({:error, _}, existing(&1))
    assert {:error, _lines} = Bodies.fetch("no_" <> name, [folder])
    assert {:error, _lines} = Body.parse("[no_key_of_#{name}: :no_value_of_#{name}]", :b, "b.exs")

    for text <- [name, "no_" <> name, "no_key_of_" <> name, "no_value_of_" <> name],
        do: assert(none?.(text), text)

    assert {:ok, %{name: atom}} = Bodies.fetch(name, [folder])
    assert existing(name) == {:ok, atom}
  end

  defp existing(text) do
    {:ok, String.to_existing_atom(text)}
  rescue
    ArgumentError -> {:error, :none}
  end

  test "names have one form, whatever they begin with", %{tmp_dir: folder} do
    text = &"[id: :#{&1}, profile: :create2, drive: {Robot.FileDrive, port: \"x\"}]"

    for name <- ["rex", "r_2", "a" <> String.duplicate("b", 30)] do
      assert {:ok, %{id: id}} = Robot.File.parse(text.(name))
      assert Atom.to_string(id) == name
    end

    for name <- ["Rex", "\"2nd\"", "\"ro ver\"", "a" <> String.duplicate("b", 31), "nil"] do
      assert {:error, [line]} = Robot.File.parse(text.(name), file: "rex.exs")

      assert line =~
               ~r/^rex.exs:1: id: expected a name of small letters, digits and _, at most 31, /
    end

    # A copy whose name was not changed.
    file = Path.join(folder, "rover2.exs")
    File.write!(file, text.("rover1"))
    assert {:error, [line]} = Robot.File.load(file)
    assert line =~ "id: is :rover1, but the file is named rover2.exs"
  end

  test "a body has a lidar by its keys, which need not be all, or gives its base's away" do
    lidar = fn values, base ->
      {:ok, body} = Body.build(:rover, values, base)
      {body.scan, body.sonar_round_s}
    end

    {:ok, burger} = Bodies.fetch("burger")
    whole = [radius: 0.2, wheel_base: 0.3, limits: [max_linear: 0.4, max_turn: 1.0]]
    assert lidar.(whole, nil) == {nil, 0.0}
    assert lidar.([scan: []] ++ whole, nil) == {Profile.scan(), 0.1}
    assert lidar.([scan: [max: 6.0]] ++ whole, nil) == {%{Profile.scan() | max: 6.0}, 0.1}
    assert lidar.([scan: [max: 8.0]], burger) == {%{burger.scan | max: 8.0}, 0.2}
    assert lidar.([scan: nil], burger) == {nil, 0.0}
    assert lidar.([mass: 2.0], burger) == {burger.scan, 0.2}
  end

  test "a lidar has a driver, and a driver of lidars a body that has one", %{tmp_dir: folder} do
    text = &"[id: :rex, profile: :#{&1}, drive: {Robot.FileDrive, port: \"/dev/ttyS1\"}#{&2}]"

    load = fn text ->
      File.write!(Path.join(folder, "rex.exs"), text)
      Robot.File.load(Path.join(folder, "rex.exs"))
    end

    {:ok, robot} = load.(text.("burger", ""))

    assert Enum.any?(
             Warnings.lines(robot, fn _ -> true end),
             &(&1 =~ "has a lidar, and no driver reads it")
           )

    assert {:error, [line]} = load.(text.("mag", ", scan: Robot.FileLidar"))
    assert line =~ "scan: is for a body with a lidar, and magellan has none"
    assert {:error, [line]} = load.(text.("burger", ", scan: Hal.RFlex.Driver"))
    assert line =~ "scan: names Hal.RFlex.Driver, which is not a Hal.Lidar"

    assert {:ok, robot} =
             load.(text.("burger", ", scan: {Robot.FileLidar, port: \"/dev/ttyUSB0\"}"))

    assert Warnings.lines(robot, fn _ -> true end) == []
    assert Enum.any?(Summary.lines(robot), &(&1 =~ "lidar     Robot.FileLidar on /dev/ttyUSB0"))
    assert {:ok, %{scan: {Robot.FileLidar, _}}} = Robot.File.config(robot)
  end

  test "a body without ranges is told so" do
    for {name, says} <- [
          {"create2", "create2 has no ranges: it stops by its bumpers only, once it touches"},
          {"burger", nil},
          {"pioneer3", nil}
        ] do
      {:ok, body} = Bodies.fetch(name)
      assert Warnings.blind(body) == says

      robot = %Robot.File{
        id: :rex,
        profile: body,
        drive: {Some.Drive, []},
        start: Hal.Pose.new(0, 0)
      }

      warned = Enum.filter(Warnings.lines(robot, fn _ -> true end), &(&1 =~ "no ranges"))

      assert warned ==
               if(says,
                 do: [says <> "; a fence, and limits: [max_linear: 0.2] or less, are usual"],
                 else: []
               )

      seen = Enum.any?(Summary.lines(robot), &(&1 =~ ~r/a lidar of|\d sonars/))
      assert seen == (says == nil)
    end
  end
end
