for file <- ~w(case machine), do: Code.require_file("release/#{file}.exs", __DIR__)

# What a release takes from the machine that builds it.
erts = Path.join(:code.root_dir(), "erts-#{:erlang.system_info(:version)}/bin")

why_not =
  Enum.find_value(~w(erlexec beam.smp run_erl), fn name ->
    unless File.exists?(Path.join(erts, name)), do: "#{erts} has no #{name}"
  end)

no_machine = why_not || Release.Machine.why_not()
if why_not, do: IO.puts("the release is not tested: #{why_not}")
if no_machine, do: IO.puts("rel/deploy is not tested: #{no_machine}")

defmodule System.ReleaseTest do
  @moduledoc """
  The release of real robots, from outside: it is built, started, commanded, killed and started again, with the
  real driver on an emulated base.
  """
  use Release.Case, async: true
  @moduletag :realtime
  alias Hal.{Pose, Profile}
  alias Sim.{Emulator, World}

  @moduletag skip: why_not
  @root Path.expand("..", __DIR__)

  defp base(link) do
    start_supervised!(World.Directory)
    {:ok, map} = Sim.Floorplan.open("hall", 1)
    robot = %{id: :mag1, profile: Profile.magellan(), pose: Pose.new(-4, 0, 0), infrared: true}
    name = make_ref()
    world = World.new!(map: map, robots: [robot], noise: :off)
    server = start_supervised!({World.Server, name: name, world: world})
    body = {Sim.Device.Drive, world: name, robot: :mag1}

    start_supervised!(
      {Emulator, core: {Sim.Emulator.RFlexController, []}, link: link, body: body}
    )

    server
  end

  defp speed(server), do: elem(World.Server.world(server).robots.mag1.speed, 0)

  defp wait(true?, ms \\ 60_000) do
    cond do
      true?.() -> :ok
      ms < 0 -> flunk("it never came")
      true -> receive(do: (:never -> :ok), after: (5 -> wait(true?, ms - 5)))
    end
  end

  defp root?, do: System.cmd("id", ["-u"]) == {"0\n", 0}

  defp stopped({"", 0}, _pid, _folder), do: :ok

  # What the process does instead, and the end of its log.
  defp stopped({said, _status}, pid, folder) do
    shell = """
    cat /proc/#{pid}/status; kill -USR1 #{pid}; sleep 5
    grep -aE '^=proc:|^Name:|^Spawned as|^State:|^Program counter|^Message queue length: [1-9]|^=init|^=port|^Current call' #{folder}/dump | head -1500
    tail -n 20 #{folder}/log/*
    """

    {log, _} = System.cmd("sh", ["-c", shell])
    flunk(said <> log)
  end

  defp dist_port(file) do
    [_, port] = Regex.run(~r/dist_port: (\d+)/, File.read!(file))
    String.to_integer(port)
  end

  defp flood(port, n) do
    name = "flood-#{n}@nowhere"
    hello = <<?N, 0x0D07F7FBD::64, 1::32, byte_size(name)::16, name::binary>>

    with {:ok, socket} <-
           :gen_tcp.connect({127, 0, 0, 1}, port, [:binary, packet: 2, active: false]) do
      with :ok <- :gen_tcp.send(socket, hello), do: :gen_tcp.recv(socket, 0, 10_000)
      :gen_tcp.close(socket)
    end

    flood(port, n + 2)
  end

  test "it is lean, and its programs may be run" do
    apps = for path <- File.ls!(Path.join(release(), "lib")), do: hd(String.split(path, "-"))
    for app <- ~w(hal vision robot mesh swarm missions record agents), do: assert(app in apps)
    for app <- ~w(sim console tools vm), do: refute(app in apps)
    for app <- ~w(sim console mix ex_unit), do: refute(app in apps)

    for {name, mode} <- [
          {"hal*/priv/serial", 0o111},
          {"hal*/priv/newest_frame", 0o111},
          {"vision*/priv/blobs.so", 0}
        ] do
      assert [file] = Path.wildcard(Path.join([release(), "lib", name]))
      assert Bitwise.band(File.stat!(file).mode, mode) == mode
    end
  end

  test "started, armed, driven, killed by -9: the wheels stop; started again, disarmed", %{
    folder: folder
  } do
    link = Path.join(folder, "base")
    file = Path.join(folder, "mag1.exs")
    robot_file(file, link)
    server = base(link)

    environment = [
      {"ROBOT", "mag1"},
      {"CONVOY_ROBOT_FILE", file},
      {"CONVOY_SECRET_FILE", Path.join(folder, "secret")},
      {"RELEASE_TMP", folder},
      {"ERL_CRASH_DUMP_SECONDS", "-1"},
      {"ERL_CRASH_DUMP", Path.join(folder, "dump")}
    ]

    ask = fn arguments -> fn -> robot(arguments, environment) end end

    assert {said, 0} = robot(["check"], environment)
    assert said =~ "mag1, a Magellan Pro"
    assert {said, 1} = robot(["halt"], environment)
    assert said =~ "mag1: has no console: in its file; the power stays on"
    assert {"", 0} = robot(["daemon"], environment)
    pid = pid(ask.(["pid"]))
    # Where it is, its wheels have said.
    here = ~r/^#mag1 idle \(0\.00, 0\.00, 0 deg\) ±0\.\d+ m.* DISARMED/
    until(here, ask.(["status"]))
    left_start = Path.join(folder, "mag1.departed")
    refute File.exists?(left_start)

    # However often other programs of this machine call, and by how many names.
    flood = for n <- 1..2, do: Task.async(fn -> flood(dist_port(file), n) end)
    if root?(), do: for(_ <- 1..3, do: assert({"1\n", 0} = robot(["rpc", "1"], environment)))
    Enum.each(flood, &Task.shutdown(&1, :brutal_kill))

    # It moves only once a person has armed it.
    move = ~s|Swarm.tell(:mag1, "move:0.2:0")|
    # On a busy machine the first takes so long that the second is late.
    refused = ~S|{:error, "mag1: its wheels are disarmed; arm it first"}|
    both = ~r/^{{:error,\s+"expected one of .*"},\s+#{Regex.escape(refused)}}$/m
    until(both, ask.(["rpc", ~s|{Swarm.tell(:mag1, "armm"), #{move}}|]))
    assert speed(server) == 0.0
    until(~r/^{:ok, :ok}$/m, ask.(["rpc", "{Swarm.arm(:mag1), #{move}}"]))
    # On a busy machine it may have lost its line, at rest or while its wheels turned.
    again = ask.(["rpc", "{Swarm.acknowledge(:mag1), Swarm.arm(:mag1), #{move}}"])
    wait(fn -> speed(server) > 0.1 or (again.() && speed(server) > 0.1) end, 50)
    wait(fn -> File.exists?(left_start) end)

    {_, 0} = System.cmd("kill", ["-KILL", pid])
    wait(fn -> speed(server) == 0.0 end)
    refute there?(pid)

    # Now by systemd, as far as it can tell.
    {:ok, systemd} = :gen_udp.open(0, ifaddr: {:local, Path.join(folder, "systemd")})
    on_exit(fn -> :gen_udp.close(systemd) end)
    notify = {"NOTIFY_SOCKET", Path.join(folder, "systemd")}
    assert {"", 0} = robot(["daemon"], [notify | environment])
    again = pid(ask.(["pid"]))
    assert again != pid
    # Its wheels count from zero again, but it knows that it has left its start pose.
    until(~r/^#mag1 idle \(0\.00, 0\.00, 0 deg\) ±\d\d\.\d+ m.* DISARMED/, ask.(["status"]))
    # An order from before does not wait for it, nor does one that comes now.
    assert {said, 0} = robot(["rpc", move], environment)
    assert said == refused <> "\n"
    # Even if run_erl, whose child it is, does not look whether it has ended.
    [_, parent] = Regex.run(~r/^PPid:\t(\d+)$/m, File.read!("/proc/#{again}/status"))
    {_, 0} = System.cmd("kill", ["-STOP", parent])
    on_exit(fn -> System.cmd("kill", ["-KILL", parent], stderr_to_stdout: true) end)
    stopped(robot(["stop"], environment), again, folder)
    refute there?(again)
    {_, 0} = System.cmd("kill", ["-CONT", parent])
    # systemd deletes it, if this was by its order.
    assert File.exists?(left_start)
    assert speed(server) == 0.0

    # The same words whatever Elixir's are.
    for command <- [["status"], ["pid"], ["stop"], ["rpc", "1"]] do
      assert {said, 1} = robot(command, environment)
      assert said =~ ~r/^robot: the robot does not answer \(no\w+\)/
    end
  end

  test "in a clone, a robot that comes along is checked with the secret of the environment", %{
    folder: folder
  } do
    environment = [{"ROBOT", "mag1"}, {"CONVOY_SECRET_FILE", Path.join(folder, "secret")}]
    assert {said, 0} = robot(["check"], environment)
    assert said =~ ~r/robots\/mag1.exs: valid/
  end

  test "files may have umlauts in their names, whatever the locale", %{folder: folder} do
    folder = Path.join(folder, "Flügel")
    File.mkdir_p!(folder)
    file = Path.join(folder, "übung.exs")
    robot_file(file, "/dev/ttyS1")
    {:ok, _secret} = Mesh.Secret.create(Path.join(folder, "secret"), false)

    environment = [
      {"ROBOT", "mag1"},
      {"LC_ALL", "C"},
      {"CONVOY_ROBOT_FILE", file},
      {"CONVOY_SECRET_FILE", Path.join(folder, "secret")}
    ]

    assert {said, 0} = robot(["check"], environment)
    assert said =~ "#{file}: valid"
  end

  test "what is wrong is said in a line, and nothing starts", %{folder: folder} do
    file = Path.join(folder, "mag1.exs")
    robot_file(file, "/dev/ttyS1", ", arm: :maual")
    secret = Path.join(folder, "secret")
    environment = [{"ROBOT", "mag1"}, {"CONVOY_ROBOT_FILE", file}, {"CONVOY_SECRET_FILE", secret}]
    assert {said, 1} = robot(["start"], environment)
    assert said =~ ~r/mag1.exs:\d+: arm: expected .*, got :maual.*did you mean :manual/

    assert {said, 1} =
             robot(["start"], List.keyreplace(environment, "ROBOT", 0, {"ROBOT", "mag2"}))

    assert said =~ ~r/arm: expected .*, got :maual/
    robot_file(file, "/dev/ttyS1")
    File.rm!(secret)
    assert {said, 1} = robot(["start"], environment)
    assert said =~ "make one: (umask 077;"

    for {word, meant} <- [{"stpo", "stop"}, {"reomte", "remote"}, {"daemn", "daemon"}] do
      assert {said, 1} = robot([word], environment)
      assert said =~ "did you mean #{meant}?"
    end
  end

  test "a robot file may name the missions and formations of its build", %{folder: folder} do
    release = extended(folder)
    file = Path.join(folder, "mag1.exs")

    environment = [
      {"ROBOT", "mag1"},
      {"CONVOY_RELEASE", release},
      {"CONVOY_ROBOT_FILE", file},
      {"CONVOY_SECRET_FILE", Path.join(folder, "secret")}
    ]

    check = fn policies ->
      robot_file(file, "/dev/ttyS1", ", policies: [#{policies}]")
      robot(["check"], environment)
    end

    assert {said, 0} = check.("mission: :landmark, formation: {:echelon, 1.2}")
    assert said =~ ~r/mission +landmark, in echelon of 1.20 m$/m
    assert {said, 0} = check.("mission: :sentry")
    assert said =~ ~r/mission +sentry$/m
    assert {said, 1} = check.("mission: :landmark, formation: {:echeln, 1.2}")

    assert said =~
             ~r/mag1.exs:\d+: policies.formation: .*or :echelon, got .*; did you mean :echelon\?/

    assert {said, 1} = check.("mission: :sentyr")

    assert said =~
             ~r/mag1.exs:\d+: policies.mission: .*or :sentry, got .*; did you mean :sentry\?/
  end

  # The same release as a build has made it whose configuration names a mission and a formation of its own.
  defp extended(folder) do
    root = Path.join(folder, "release")
    File.mkdir_p!(Path.join(root, "lib"))

    for part <- ~w(bin releases),
        do: File.cp_r!(Path.join(release(), part), Path.join(root, part))

    [erts] = Path.wildcard(Path.join(release(), "erts-*"))
    File.ln_s!(erts, Path.join(root, Path.basename(erts)))

    for app <- File.ls!(Path.join(release(), "lib")) do
      copy = if app =~ ~r/^missions-/, do: &File.cp_r!/2, else: &File.ln_s!/2
      copy.(Path.join([release(), "lib", app]), Path.join([root, "lib", app]))
    end

    [ebin] = Path.wildcard(Path.join(root, "lib/missions-*/ebin"))

    for {module, beam} <-
          Code.compile_string("""
          defmodule Mine.Echelon do
            @behaviour Swarm.Formation.Kind
            def slot(rank, _robots), do: {-0.8 * rank, 0.8 * rank}
          end

          defmodule Mine.Sentry do
            @behaviour Robot.Mission
            def init(_robot, _options), do: {:idle, :idle, []}
            def handle(_event, mission), do: {:idle, mission, []}
          end
          """),
        do: File.write!(Path.join(ebin, "#{module}.beam"), beam)

    [path] = Path.wildcard(Path.join(root, "releases/*/sys.config"))
    {:ok, [settings]} = :file.consult(path)

    words = [
      missions: &(&1 ++ [sentry: Mine.Sentry]),
      formations: fn _ -> [echelon: Mine.Echelon] end
    ]

    settings =
      for {key, change} <- words, reduce: settings do
        settings -> Keyword.update!(settings, :swarm, &Keyword.put(&1, key, change.(&1[key])))
      end

    File.write!(path, :io_lib.format("~tp.~n", [settings]))
    root
  end

  @tag skip: unless(System.find_executable("systemd-analyze"), do: "systemd-analyze is not here")
  test "the unit for systemd is one", %{folder: folder} do
    # Its program is on robots only.
    unit = File.read!(Path.join(@root, "rel/convoy.service"))
    path = Path.join(folder, "convoy.service")
    File.write!(path, String.replace(unit, ~r/^ExecStart=.*/m, "ExecStart=/bin/true"))
    assert {"", 0} = System.cmd("systemd-analyze", ["verify", path], stderr_to_stdout: true)
  end
end

defmodule System.ReleaseAgainTest do
  @moduledoc "The release of real robots, started twice, and again right after it was stopped."
  use Release.Case, async: true
  @moduletag :realtime
  @moduletag skip: why_not

  test "a question may take long; a second start, and one right after a stop, are said in words",
       %{
         folder: folder
       } do
    file = Path.join(folder, "mag1.exs")
    robot_file(file, Path.join(folder, "none"))

    environment = [
      {"ROBOT", "mag1"},
      {"CONVOY_ROBOT_FILE", file},
      {"CONVOY_SECRET_FILE", Path.join(folder, "secret")},
      {"RELEASE_TMP", folder},
      # What loads all modules first, as on robots, is started in System.ReleaseTest.
      {"RELEASE_MODE", "interactive"}
    ]

    ask = fn arguments -> fn -> robot(arguments, environment) end end
    assert {"", 0} = robot(["daemon"], environment)
    first = pid(ask.(["pid"]))

    # Longer than net_ticktime, in which neither says anything else.
    assert {":done\n", 0} = robot(["rpc", "receive do after 12_000 -> :done end"], environment)

    for command <- ["start", "daemon"] do
      assert {said, 1} = robot([command], environment)
      assert [line] = String.split(said, "\n", trim: true)
      assert line =~ ~r/^mag1 does not start: its TCP port \d+ is in use/
      assert line =~ "it runs here already (robot status tells how it is, robot stop ends it)"
    end

    # It has ended when this returns.
    assert {"", 0} = robot(["stop"], environment)
    refute there?(first)
    assert {"", 0} = robot(["daemon"], environment)
    second = pid(ask.(["pid"]))
    assert second != first

    # Also without our own command, which waits for the end.
    release = Path.join(release(), "bin/robot")
    options = [env: environment, stderr_to_stdout: true]
    assert {_said, 0} = System.cmd(release, ["stop"], options)
    assert {"", 0} = System.cmd(release, ["daemon"], options)
    assert pid(ask.(["pid"])) not in [first, second]
    assert {"", 0} = robot(["stop"], environment)
  end

  @tag long: true, realtime: :long
  test "a part that hangs does not keep it from ending", %{folder: folder} do
    file = Path.join(folder, "mag1.exs")
    robot_file(file, Path.join(folder, "none"))

    environment = [
      {"ROBOT", "mag1"},
      {"CONVOY_ROBOT_FILE", file},
      {"CONVOY_SECRET_FILE", Path.join(folder, "secret")},
      {"RELEASE_TMP", folder}
    ]

    assert {"", 0} = robot(["daemon"], environment)
    pid = pid(fn -> robot(["pid"], environment) end)

    hangs = """
    hang = fn -> Process.flag(:trap_exit, true); receive(do: (:never -> :ok)) end
    part = %{id: :hung, start: {Task, :start_link, [hang]}, shutdown: :infinity}
    {:ok, _pid} = DynamicSupervisor.start_child(Robot.Fleet, part)
    :hangs
    """

    assert {":hangs\n", 0} = robot(["rpc", hangs], environment)
    assert {"", 0} = robot(["stop"], environment)
    refute there?(pid)
  end
end

defmodule System.DeployTest do
  @moduledoc "The release of real robots, deployed to a bare machine."
  use Release.Case, async: true
  @moduletag :realtime
  alias Release.Machine
  @moduletag skip: why_not
  @root Path.expand("..", __DIR__)

  describe "rel/deploy" do
    @describetag skip: no_machine

    setup %{folder: folder} do
      {machine, environment} = Machine.new(folder)
      file = Path.join(folder, "mag1.exs")
      robot_file(file, "/tmp/base")
      %{machine: machine, robot: file, environment: environment}
    end

    defp deploy(arguments, context) do
      options = [env: context.environment, stderr_to_stdout: true]
      System.cmd(Path.join(@root, "rel/deploy"), arguments, options)
    end

    defp to_machine(context, more \\ []) do
      secret = Path.join(context.folder, "secret")

      deploy(
        ["root@machine", "mag1", "--file", context.robot, "--secret", secret] ++ more,
        context
      )
    end

    # What of the release is looked at before its system is found to be another.
    defp bare(folder) do
      bare = Path.join(folder, "bare")
      for name <- ~w(bin robots), do: File.mkdir_p!(Path.join(bare, name))

      for name <- ~w(bin/robot system),
          do: File.cp!(Path.join(release(), name), Path.join(bare, name))

      bare
    end

    defp on_machine(command, context) do
      [{"PATH", path}] = context.environment
      ssh = Path.join(hd(String.split(path, ":")), "ssh")
      System.cmd(ssh, ["root@machine", command], stderr_to_stdout: true)
    end

    defp current(context), do: File.read_link(Path.join(context.machine, "opt/convoy/current"))

    test "--dry-run prints the commands, and does none", context do
      assert {said, 0} = to_machine(context, ["--dry-run"])
      assert said =~ ~r/^ssh root@machine .*tar -xz/m
      assert said =~ ~r/^root@machine: ROBOT=mag1 .*bin\/robot check$/m
      assert said =~ ~r/^root@machine: systemctl restart convoy/m
      assert File.ls!(Path.join(context.machine, "opt")) == []
    end

    test "what is wrong with the arguments is one line", context do
      for {arguments, line} <- [
            {[], "where is the robot?"},
            {["root@machine"], "which robot is root@machine?"},
            {["-oProxyCommand=x", "mag1"], "is not an option"},
            {["a;b", "mag1"], "a;b is not a host"},
            {["root@machine", "../mag1"], "../mag1 is not a name"},
            {["root@machine", "mag1", "mag2"], "what is mag2?"},
            {["root@machine", "mag1", "--fil", "x"], "did you mean --file?"},
            {["root@machine", "mag1", "--file"], "--file needs a value"},
            {["root@machine", "mag1", "--file", "/no"], "there is no robot file /no"},
            {["root@machine", "mag1", "--release", "/no"], "MIX_ENV=prod mix release robot"},
            {["root@machine", "mag1", "--secret", "/no"], "mix fleet.secret /no"},
            {["--back", "root@machine", "--file", "x"], "nothing is copied"}
          ] do
        assert {said, 1} = deploy(arguments, context)
        assert said =~ line
        assert [_one_line] = String.split(said, "\n", trim: true)
      end
    end

    test "a robot with another Debian than the builder's refuses the release, and says why",
         context do
      system = Path.join(context.machine, "etc/os-release")
      File.rm!(system)
      release = bare(context.folder)

      for {version, name} <- [{11, "bullseye"}, {14, "forky"}] do
        File.write!(system, """
        PRETTY_NAME="Debian GNU/Linux #{version} (#{name})"
        ID=debian
        VERSION_ID="#{version}"
        """)

        assert {said, 1} = to_machine(context, ["--release", release])
        assert [line] = String.split(said, "\n", trim: true)

        assert line =~
                 ~r/this release was built on .+ \(\w+ \S* ?\w+\), and this machine is debian #{version} /

        refute File.exists?(Path.join(context.machine, "opt/convoy/releases"))
        refute File.exists?(Path.join(context.machine, "opt/convoy/incoming"))
      end
    end

    @tag long: true, realtime: :long
    test "from a bare machine to a robot that runs; a wrong file changes nothing; and back",
         context do
      assert {said, 0} = to_machine(context)
      assert said =~ "mag1, a Magellan Pro"
      assert {:ok, first} = current(context)

      assert {"600 convoy /etc/convoy/secret\n", 0} =
               on_machine("stat -c '%a %U %n' /etc/convoy/secret", context)

      assert {groups, 0} = on_machine("id -nG convoy", context)
      assert "dialout" in String.split(groups) and "video" in String.split(groups)
      assert {"ROBOT=mag1\n", 0} = on_machine("cat /etc/convoy/robot.env", context)

      assert File.ls!(Path.join(context.machine, "opt/convoy")) |> Enum.sort() == [
               "current",
               "releases"
             ]

      # It runs as its own user, and root may command it.
      as_robot =
        "setpriv --reuid convoy --regid convoy --init-groups env RELEASE_TMP=/tmp robot daemon"

      assert {"", 0} = on_machine(as_robot, context)
      pid = pid(fn -> on_machine("robot pid", context) end)
      assert {"convoy\n", 0} = on_machine("stat -c %U /proc/#{pid}", context)
      assert {"#mag1 idle" <> _, 0} = on_machine("robot status", context)

      other = "setpriv --reuid nobody --regid nogroup --clear-groups robot status"
      assert {said, 1} = on_machine(other, context)
      assert said =~ "permission denied); do this as root, or as its owner"

      right = File.read!(context.robot)
      File.write!(context.robot, "[]")
      assert {said, 1} = to_machine(context)
      assert said =~ "drive: is missing"
      assert current(context) == {:ok, first}
      refute File.exists?(Path.join(context.machine, "opt/convoy/incoming"))
      File.write!(context.robot, right)

      # The one before stays, older ones go.
      File.mkdir_p!(Path.join(context.machine, "opt/convoy/releases/old"))
      assert {_said, 0} = to_machine(context)
      assert {:ok, second} = current(context)
      assert second != first
      assert {releases, 0} = on_machine("cd /opt/convoy && ls -d releases/*", context)
      assert Enum.sort([first, second]) == String.split(releases)

      for release <- [first, second] do
        assert {_said, 0} = deploy(["--back", "root@machine"], context)
        assert current(context) == {:ok, release}
      end
    end
  end
end
