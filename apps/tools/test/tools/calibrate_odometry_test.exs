defmodule Tools.CalibrateOdometryTest do
  @moduledoc """
  The whole calibration of a real robot, from its file to its file: real driver, emulated base, a
  person who types.
  """
  use ExUnit.Case, async: false
  import ExUnit.CaptureIO
  alias Tools.Calibrate.{Odometry, Options, Report}
  alias Console.Person
  alias Console.Cli.Diff
  alias Hal.{Pose, Profile}
  alias Sim.{Emulator, World}
  @moduletag :realtime

  doctest Console.Cli.Diff
  doctest Tools.Calibrate.Options
  doctest Tools.Calibrate.Report
  doctest Tools.Calibrate.RobotFile
  doctest Robot.File.Edit, import: true
  doctest Robot.Calibration.Keys

  @moduletag :tmp_dir
  # The values of the file; the emulated base has these units, except for the errors of its
  # wheels.
  @conversions "distance: 31387.0, angle: 4654.2, range: 1474.0, ir_a: 4000.0, ir_b: -2.0"

  defp base(folder, wheels) do
    {:ok, _apps} = Application.ensure_all_started(:swarm)
    unless World.Directory.running?(), do: start_supervised!(World.Directory)
    {:ok, map} = Sim.Floorplan.open("hall", 1)

    robot = %{
      id: :mag1,
      profile: Profile.magellan(),
      pose: Pose.new(0, 0, 0),
      infrared: true,
      wheels: wheels
    }

    name = make_ref()
    world = World.new!(map: map, robots: [robot], noise: :off)
    server = start_supervised!({World.Server, name: name, world: world})
    link = Path.join(folder, "base")

    start_supervised!(
      {Emulator,
       core: {Sim.Emulator.RFlexController, kind: :magellan},
       link: link,
       body: {Sim.Device.Drive, world: name, robot: :mag1}}
    )

    file = Path.join(folder, "mag1.exs")

    File.write!(file, """
    # Our message.
    [
      id: :mag1,
      profile: :magellan,
      drive: {Hal.RFlex.Driver, port: "#{link}", conversions: [#{@conversions}]},
      # Slow.
      limits: [max_linear: 0.4]
    ]
    """)

    {server, file}
  end

  defp run(words, person) do
    {:ok, options} = Options.parse(words)

    Task.async(fn ->
      Process.group_leader(self(), person)
      Odometry.run(options)
    end)
    |> Task.await(120_000)
  end

  # The person measures from where the robot stood at "go".
  defp measure(server, answers) do
    Person.start(fn text ->
      truth = fn -> World.truth(World.Server.world(server), :mag1) end

      cond do
        text =~ "go, skip or quit" ->
          Process.put(:mark, truth.())
          Map.get(answers, :go, "go")

        text =~ "How far is it" ->
          way = Pose.distance(Process.get(:mark), truth.())
          :erlang.float_to_binary(way, decimals: 4)

        text =~ "By how many degrees" ->
          turned = abs(Pose.wrap(truth.().heading - Process.get(:mark).heading))
          :erlang.float_to_binary(turned * 180 / :math.pi(), decimals: 2)

        text =~ "write it?" ->
          "yes"

        true ->
          nil
      end
    end)
  end

  test "a robot is driven and measured, and its file is corrected", %{tmp_dir: folder} do
    {server, file} = base(folder, distance: 1.04, base: 1.05)
    before = File.read!(file)
    person = measure(server, %{})
    words = [file, "--distance", "0.8", "--angle", "90", "--squares", "0", "--speed", "0.4"]

    assert run(words, person) == :ok
    heard = Person.heard(person)
    assert heard =~ "Now 0.80 m straight ahead."
    assert heard =~ ~r/distance     1\.0[34]\d+ \(\+/
    assert heard =~ ~r/5 - +drive: .*distance: 31387.0, angle: 4654.2/

    {:ok, robot} = Robot.File.load(file)
    {_driver, options} = robot.drive
    conversions = options[:conversions]
    # A course of 0.8 m and a quarter turn is not more precise than this.
    assert_in_delta conversions[:distance] / (31_387.0 / 1.04), 1.0, 0.005
    assert_in_delta conversions[:angle] / (4654.2 * 1.05 / 1.04), 1.0, 0.01
    assert conversions[:range] == 1474.0
    # Everything else is unchanged, comments too.
    assert length(Diff.lines(before, File.read!(file))) == 2
    assert Robot.Names.whereis(:mag1, :robot) == nil
  end

  test "any input while it drives stops it, and holds it until reset", %{tmp_dir: folder} do
    {server, file} = base(folder, [])
    before = File.read!(file)
    me = self()

    person =
      Person.start(fn text ->
        cond do
          text =~ "go, skip or quit" ->
            send(me, :asked)
            if Process.put(:once, true), do: "quit", else: "go"

          text =~ "type reset" ->
            {:ok, board} = Robot.Board.find(:mag1)

            send(
              me,
              {:stopped, World.truth(World.Server.world(server), :mag1),
               Robot.Board.latched?(board)}
            )

            "reset"

          true ->
            nil
        end
      end)

    stop = fn ->
      assert_receive :asked, 30_000
      wait(fn -> World.truth(World.Server.world(server), :mag1).x > 0.2 end)
      Person.type(person, "")
    end

    task =
      Task.async(fn ->
        run([file, "--distance", "5", "--angle", "0", "--squares", "0"], person)
      end)

    stop.()
    assert {:error, "ended by the user; nothing is written"} = Task.await(task, 60_000)
    assert_received {:stopped, pose, true}
    assert pose.x < 1.0
    assert World.truth(World.Server.world(server), :mag1).x - pose.x < 0.15
    assert Person.heard(person) =~ "EMERGENCY STOP: mag1 is held"
    assert Person.heard(person) =~ "stopped by the user"
    assert File.read!(file) == before
  end

  # For half a minute.
  defp wait(done?, left \\ 600) do
    cond do
      done?.() -> :ok
      left == 0 -> flunk("in vain")
      true -> receive(do: (:never -> :ok), after: (50 -> wait(done?, left - 1)))
    end
  end

  test "an earlier emergency stop holds it until a person resets it", %{tmp_dir: folder} do
    {server, file} = base(folder, [])
    latch = Path.join(folder, "estop")
    File.write!(latch, "")
    text = File.read!(file)
    File.write!(file, String.replace(text, "limits:", ~s(estop_file: "#{latch}",\n  limits:)))

    person =
      Person.start(fn text ->
        if text =~ "go, skip or quit" do
          n = Process.get(:asked, 0)
          Process.put(:asked, n + 1)
          Enum.at(["go", "reset", "quit"], n)
        end
      end)

    words = [file, "--distance", "1", "--angle", "0", "--squares", "0"]
    assert {:error, "ended by the user; nothing is written"} = run(words, person)
    assert Person.heard(person) =~ "reset releases an emergency stop"
    refute File.exists?(latch)
    assert World.truth(World.Server.world(server), :mag1) == Pose.new(0, 0)
  end

  test "without a person no wheel turns", %{tmp_dir: folder} do
    {server, file} = base(folder, [])

    capture_io("", fn ->
      {:ok, options} = Options.parse([file])
      assert Odometry.run(options) == {:error, "ended by the user; nothing is written"}
    end)

    assert World.truth(World.Server.world(server), :mag1) == Pose.new(0, 0)
  end

  test "a dry run prints the plan, and needs no robot", %{tmp_dir: folder} do
    file = Path.join(folder, "mag2.exs")

    File.write!(
      file,
      ~s([id: :mag2, profile: :magellan, drive: {Hal.RFlex.Driver, port: "/dev/none"}])
    )

    {:ok, options} = Options.parse([file, "--dry-run"])
    text = capture_io(fn -> assert Odometry.run(options) == :ok end)
    assert text =~ "distance and angle not known yet"
    assert text =~ "720 degrees to the left"
    assert text =~ "a square of 4.0 m, clockwise: go 4.00, turn -90"
  end

  test "numbers that were measured elsewhere are enough", %{tmp_dir: folder} do
    file = Path.join(folder, "mag2.exs")

    File.write!(file, """
    [id: :mag2, profile: :magellan,
     drive: {Hal.RFlex.Driver, port: "/dev/none", conversions: [
       # from the old file: distance: 5
       range: 1474.0]}]
    """)

    words = ~w(--distance 5 --measured 5.5 --angle 360 --turned 330 --turned -330 --write)
    {:ok, options} = Options.parse([file | words])
    text = capture_io(fn -> assert Odometry.run(options) == :ok end)
    assert text =~ "distance     1.1000 (+10.00 %)"
    {:ok, robot} = Robot.File.load(file)
    {_driver, options} = robot.drive
    assert_in_delta options[:conversions][:distance], 31_387.0 / 1.1, 0.01
    assert_in_delta options[:conversions][:angle], 4654.2 * 360 / 330, 0.01
    refute Keyword.has_key?(options[:conversions], :wheel_ratio)
    assert File.read!(file) =~ "# from the old file: distance: 5"
  end

  test "wrong arguments are reported", %{tmp_dir: folder} do
    for {words, line} <- [
          {~w(mag1.exs --side 0.1), ~s(--side: expected a number from 1 to 20, got "0.1")},
          {~w(mag1.exs --distance 0.1),
           ~s(--distance: expected 0 or a number from 0.5 to 50, got "0.1")},
          {~w(mag1.exs --squares 1e9),
           ~s(--squares: expected a whole number from 0 to 50, got "1e9")},
          {~w(mag1.exs --cw 1),
           ~s(--cw: expected X,Y in metres, each from -1000 to 1000, got "1")},
          {~w(mag1.exs --seed 3), "--seed is for a simulated robot: add --simulate"},
          {~w(mag1.exs --simulate), "a simulated robot has no file: mag1.exs or --simulate"},
          {~w(mag1.exs mag2.exs), "one robot file at a time, not 2: mag1.exs, mag2.exs"},
          {~w(mag1.exs --dry-rum), ~s(unknown option --dry-rum; did you mean --dry-run?)}
        ] do
      assert Options.parse(words) == {:error, [line]}
    end

    {:ok, options} = Options.parse(~w(no/such.exs))
    assert Odometry.run(options) == {:error, ["no/such.exs: no such file or directory"]}
    dry = Path.join(folder, "mag3.exs")

    File.write!(
      dry,
      ~s([id: :mag3, profile: :magellan, dry_run: true, drive: {Hal.RFlex.Driver, port: "/dev/none"}])
    )

    {:ok, options} = Options.parse([dry])

    capture_io(fn ->
      assert Odometry.run(options) == {:error, "#{dry}: dry_run is true, so nothing would move"}
    end)

    {:ok, options} = Options.parse(~w(--cw 0.1,0.1))
    assert {:error, "no square was driven counter-clockwise" <> _} = Odometry.run(options)
  end

  test "slip leaves the wheel ratio unchanged, and is reported" do
    runs = for d <- [:cw, :ccw], k <- [-1, 1], do: {d, {0.1 + k * 0.3, 0.1}}
    measured = %{distances: [], angles: [{6.28, 6.6}, {-6.28, -6.0}], runs: runs, side: 4.0}
    {:ok, _wheels, squares} = Robot.Calibration.estimate(measured, 0.3)
    assert Report.found(measured) == [:base]
    assert [slip, unsure | _] = Report.remarks(squares, measured)
    assert slip =~ "its wheels slip"
    assert unsure =~ ~r/the squares scatter: .* \d+ squares in each direction would suffice/
  end

  test "seeds are run and judged" do
    {:ok, options} = Options.parse(~w(--simulate --seeds 2 --squares 2))
    text = capture_io(fn -> assert Odometry.run(options) == :ok end)
    assert text =~ "base: at most"
    assert text =~ "2 of 2 within 0.5 %"
  end
end
