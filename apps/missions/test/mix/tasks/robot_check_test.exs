defmodule Mix.Tasks.Robot.CheckTest do
  use Hal.TaskCase, async: false
  alias Mix.Tasks.Robot.Check
  alias Robot.File.Schema
  alias Swarm.Host.ReleaseBoot

  @robots Path.expand("../../../../../config/robots", __DIR__)

  setup %{tmp_dir: folder} do
    File.cp!(Path.join(@robots, "landmark.txt"), Path.join(folder, "color.cfg"))
    :ok
  end

  test "a valid file is summarised: limits, stopping distance, what is missing, how it arms" do
    path = Path.join(@robots, "mag1.exs")
    Check.run([path])
    lines = said()
    assert hd(lines) =~ "#{path}: valid"
    text = Enum.join(lines, "\n")
    assert text =~ "mag1, a Magellan Pro of 20 kg: 0.40 m long"
    missing = "distance (units per metre), angle (units per radian): it will not arm"
    assert String.replace(text, ~r/\s+/, " ") =~ missing
    assert text =~ "moves     at most 0.30 m/s and 57° a second"
    # 0.3 m/s for 0.3 s, and 0.3^2 / (2 * 0.5) m.
    assert text =~ "stops     from full speed within 0.18 m"
    assert text =~ "arms      by hand"
    assert Enum.all?(tl(lines), &(String.length(&1) <= 104))

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

  test "the check says the same about arming as the driver", %{tmp_dir: folder} do
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

  test "an odd value is a warning, with the usual value", %{tmp_dir: folder} do
    well = "distance: 31_387.0, angle: 4654.2, range: 1474.0, ir_a: 4000.0, ir_b: -2.0"

    file = fn conversions, more ->
      options = ~s([port: "/dev/null", conversions: [#{conversions}]#{more[:drive]}])
      keys = more[:keys] || ""
      "[id: :mag1, profile: :magellan, drive: {Hal.RFlex.Driver, #{options}}#{keys}]"
    end

    assert {": valid", text} = checked(folder, file.(well, []))
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
           "drive: sonar_banks: is not given, and 50 poses are not full boards of 8 (48 or 56 would be)"},
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
      assert title =~ ": valid, "
      assert text =~ "WARNING " <> line
    end
  end

  test "a network of other names is summarised", %{tmp_dir: folder} do
    drive = ~s(drive: {Hal.RFlex.Driver, port: "/dev/null"})

    network =
      ~s(network: [interface: "10.0.0.7", multicast: false, peers: ["10.0.0.8:4370"], fleet: ["mag1", "tb1"]])

    {_title, text} = checked(folder, "[id: :mag1, profile: :magellan, #{drive}, #{network}]")
    assert text =~ "fleet of mag1, tb1"
    assert text =~ "peers: 1"
    assert text =~ "no multicast"
  end

  test "for several files, the errors of each are reported, and the status is 1", %{
    tmp_dir: folder
  } do
    bad = Path.join(folder, "bad.exs")
    File.write!(bad, "[id: :mag1, profile: :magelan,\n dirve: 1]")
    lines = refused(Check, [Path.join(@robots, "mag1.exs"), bad, "none.exs"])

    {:keys, table} =
      Schema.table(%{bodies: nil, bodiless?: true, colours: nil, map: nil, tables: []})

    keys = table |> Keyword.keys() |> Enum.join(", ")

    assert lines == [
             "#{bad}:1: profile: no body is named magelan: there are burger, mag, min, waffle, magellan, atrv_mini, create2, kobuki, pioneer3, turtlebot3_burger, turtlebot3_waffle; did you mean magellan?",
             "#{bad}:1: drive: is missing: expected {driver, options}, such as {Hal.RFlex.Driver, […]}",
             "#{bad}:2: dirve: is not known: allowed are #{keys}; did you mean drive?",
             "none.exs: no such file or directory"
           ]

    assert refused(Check, ["--colour"]) == [
             "robot.check: unknown option --colour; known are --help"
           ]

    assert ExUnit.CaptureIO.capture_io(fn -> Check.run(["--help"]) end) =~ "mix robot.check [FILE"
  end

  defmodule Echelon do
    @moduledoc "A formation that a build adds."
    @behaviour Swarm.Formation.Kind

    @impl Swarm.Formation.Kind
    def slot(rank, _robots), do: {-0.8 * rank, 0.8 * rank}
  end

  defmodule Patrol do
    @moduledoc "A mission that a build adds."
    @behaviour Robot.Mission

    @impl Robot.Mission
    def init(_robot, options), do: {:idle, options, []}

    @impl Robot.Mission
    def handle(_event, mission), do: {:idle, mission, []}

    @impl Robot.Mission
    def option_table, do: [rounds_of_patrol: {:integer, 1, 99}]

    @impl Robot.Mission
    def options(options, _robots), do: {:ok, options}
  end

  defmodule Guard do
    @moduledoc "A mission that a build adds, which checks its options without a table."
    @behaviour Robot.Mission

    @impl Robot.Mission
    defdelegate init(robot, options), to: Patrol

    @impl Robot.Mission
    defdelegate handle(event, mission), to: Patrol

    @impl Robot.Mission
    def options([gate_of_guard: :north] = options, _robots), do: {:ok, options}
    def options([], _robots), do: {:ok, []}
    def options(_other, _robots), do: {:error, "only gate_of_guard: :north is allowed"}
  end

  describe "a mission and a formation of this build" do
    setup %{tmp_dir: folder} do
      missions = Application.fetch_env!(:swarm, :missions)
      Application.put_env(:swarm, :missions, missions ++ [sentry: Patrol, guard: Guard])
      Application.put_env(:swarm, :formations, echelon: Echelon)

      on_exit(fn ->
        Application.put_env(:swarm, :missions, missions)
        Application.delete_env(:swarm, :formations)
      end)

      path = Path.join(folder, "mag1.exs")
      secret = Path.join(folder, "secret")
      {:ok, _secret} = Mesh.Secret.create(secret, true)

      machine = %{
        "ROBOT" => "mag1",
        "CONVOY_ROBOT_FILE" => path,
        "CONVOY_SECRET_FILE" => secret
      }

      %{path: path, machine: machine}
    end

    defp write(path, policies) do
      drive = ~s(drive: {Hal.RFlex.Driver, port: "/dev/null"})
      File.write!(path, "[id: :mag1, profile: :magellan, #{drive},\npolicies: [#{policies}]]")
    end

    test "may stand in a robot file", %{path: path, machine: machine} do
      for {policies, told} <- [
            {"mission: :landmark, formation: {:echelon, 1.2}", "landmark, in echelon of 1.20 m"},
            {"formation: {:echelon, 1.2}", "none until it is told one"},
            {"mission: :sentry, rounds_of_patrol: 3", "sentry"},
            {"mission: :sentry", "sentry"},
            {"mission: {:sentry, rounds_of_patrol: 3}", "sentry, rounds_of_patrol 3"},
            {"mission: {:sentry, []}", "sentry"},
            {"mission: {#{inspect(Patrol)}, rounds_of_patrol: 3}",
             "#{inspect(Patrol)}, rounds_of_patrol 3"},
            {"mission: #{inspect(Patrol)}", inspect(Patrol)},
            {"mission: :guard, gate_of_guard: :north", "guard"}
          ] do
        write(path, policies)
        Check.run([path])
        lines = said()
        assert hd(lines) =~ "#{path}: valid"
        assert Enum.any?(lines, &(&1 =~ ~r/mission +#{told}$/))
        assert {0, answer, []} = ReleaseBoot.answer("check", machine)
        assert Enum.map(answer, &String.trim/1) == Enum.map(lines, &String.trim/1)
      end

      write(path, "mission: :sentry, rounds_of_patrol: 3")
      assert {:ok, {_file, config}} = ReleaseBoot.robot(machine)
      assert config.mission == {Patrol, rounds_of_patrol: 3}
      write(path, "mission: {#{inspect(Patrol)}, rounds_of_patrol: 3}")
      assert {:ok, {_file, ^config}} = ReleaseBoot.robot(machine)
    end

    test "are suggested for a typo", %{path: path, machine: machine} do
      for {policies, line} <- [
            {"mission: :landmark, formation: {:echeln, 1.2}",
             "policies.formation: expected :column, :line, :wedge, :triangle, :diamond, :circle or :echelon, got :echeln; did you mean :echelon?"},
            {"mission: :sentyr, rounds_of_patrol: 3",
             "policies.mission: expected nil, :landmark, :patrol, :flock, :explore, :chase, :push, :teleop, :sentry or :guard, got :sentyr; did you mean :sentry?"},
            {"mission: :sentry, rounds_of_patorl: 3",
             "policies.rounds_of_patorl: is not known: allowed are mission, rounds_of_patrol; did you mean rounds_of_patrol?"},
            {"mission: :sentry, formation: {:echelon, 1.2}",
             "policies.formation: is not known: allowed are mission, rounds_of_patrol"},
            {"mission: {:sentyr, rounds_of_patrol: 3}",
             "policies.mission: expected nil, :landmark, :patrol, :flock, :explore, :chase, :push, :teleop, :sentry or :guard, got :sentyr; did you mean :sentry?"},
            {"mission: {:sentry, rounds_of_patorl: 3}",
             "policies.mission.rounds_of_patorl: is not known: allowed are rounds_of_patrol; did you mean rounds_of_patrol?"},
            {"mission: {:sentry, rounds_of_patrol: 0}",
             "policies.mission.rounds_of_patrol: expected a whole number from 1 to 99, got 0"},
            {"mission: {:sentry, rounds_of_patrol: 3}, formation: {:echelon, 1.2}",
             "policies.formation: is not allowed beside {:sentry, …}: write it in there"},
            {"mission: {:guard, gate_of_guard: :no_name_of_any_gate}",
             "policies.mission: expected a name that this build knows, got :no_name_of_any_gate"},
            {"mission: {:guard, gate_of_guard: :patrol}",
             "policies.mission: only gate_of_guard: :north is allowed"},
            {"mission: :guard, gate_of_guard: :patrol",
             "policies: only gate_of_guard: :north is allowed"},
            {"mission: :guard, gate_of_guard: :no_name_of_any_gate",
             "policies: expected a name that this build knows, got :no_name_of_any_gate"}
          ] do
        write(path, policies)
        assert refused(Check, [path]) == ["#{path}:2: #{line}"]
        assert {1, [], ["#{path}:2: #{line}"]} == ReleaseBoot.answer("check", machine)
      end
    end
  end
end
