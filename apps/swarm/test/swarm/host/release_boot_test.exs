defmodule Swarm.Host.ReleaseBootTest do
  use ExUnit.Case, async: true
  alias Swarm.Host.ReleaseBoot
  alias Mesh.Secret
  @moduletag :realtime

  doctest ReleaseBoot
  doctest Swarm.Host.Machine

  @moduletag :tmp_dir

  defp machine(folder, file, more \\ %{}) do
    path = Path.join(folder, "mag1.exs")
    File.write!(path, file)
    secret = Path.join(folder, "secret")
    {:ok, _secret} = Secret.create(secret, true)

    Map.merge(
      %{"ROBOT" => "mag1", "CONVOY_ROBOT_FILE" => path, "CONVOY_SECRET_FILE" => secret},
      more
    )
  end

  defp file(more \\ "") do
    drive = ~s(drive: {Hal.RFlex.Driver, port: "/dev/null"})
    "[id: :mag1, profile: :magellan, #{drive}#{more}]"
  end

  test "the release of real robots needs a file, and says where it looked; a base station needs none" do
    real = %{"RELEASE_NAME" => "robot", "ROBOT" => "mag9", "RELEASE_ROOT" => "/nowhere"}

    assert ReleaseBoot.robot(real) ==
             {:error,
              [
                "mag9 has no robot file; looked for /etc/convoy/robots/mag9.exs and /nowhere/robots/mag9.exs"
              ]}

    assert ReleaseBoot.robot(%{real | "RELEASE_NAME" => "fleet", "ROBOT" => "base"}) == {:ok, nil}
  end

  test "the machine's own file takes precedence over that of the release" do
    environment = %{"ROBOT" => "mag1", "RELEASE_ROOT" => "/opt/convoy/current"}

    assert ReleaseBoot.place(environment, fn _ -> true end) ==
             {:ok, "/etc/convoy/robots/mag1.exs"}
  end

  test "a robot has its mission and its comms process, and is disarmed", %{tmp_dir: folder} do
    environment = machine(folder, file(", policies: [mission: :landmark]"))
    assert {:ok, {%Robot.File{id: :mag1}, config}} = ReleaseBoot.robot(environment)
    assert config.arm == :manual
    assert {Swarm.StandMission, _options} = config.mission
    assert List.keymember?(config.companions, Swarm.Comms, 0)
  end

  test "a file of another robot, or a wrong one, is refused with errors", %{tmp_dir: folder} do
    environment = machine(folder, file(), %{"ROBOT" => "mag2"})
    assert {:error, [line]} = ReleaseBoot.robot(environment)
    assert line =~ "mag1.exs is that of mag1, and this machine is ROBOT=mag2"

    environment = %{environment | "ROBOT" => "mag1"}
    File.write!(environment["CONVOY_ROBOT_FILE"], file(", arm: :maual, limit: []"))
    assert {:error, lines} = ReleaseBoot.robot(environment)
    assert Enum.any?(lines, &(&1 =~ ~r/mag1\.exs:1: arm: expected .*, got :maual/))
    assert Enum.any?(lines, &(&1 =~ "limit: is not known: allowed are id, profile"))
    assert {1, [], ^lines} = ReleaseBoot.answer("start", environment)
    assert {1, [], ^lines} = ReleaseBoot.answer("check", environment)
  end

  test "a running robot can be reached even if its file is wrong by now", context do
    environment = machine(context.tmp_dir, "[", %{"CONVOY_DIST_PORT" => "9400"})
    secret = environment["CONVOY_SECRET_FILE"]

    for command <- ~w(remote rpc stop restart pid) do
      assert {0, [cookie, ^secret, "9400", ""], [_line]} =
               ReleaseBoot.answer(command, environment)

      assert cookie =~ ~r/\A[a-z2-7]{52}\z/
    end
  end

  test "the network keys of the file take precedence over the environment", %{tmp_dir: folder} do
    more = %{"CONVOY_DIST_PORT" => "9400", "CONVOY_INTERFACE" => "10.0.0.1"}
    environment = machine(folder, file(), more)
    {:ok, secret} = Secret.load(environment["CONVOY_SECRET_FILE"])
    other = Path.join(folder, "other")
    {:ok, %{cookie: cookie}} = Secret.create(other, false)

    assert {:ok, {plain, _config}} = ReleaseBoot.robot(environment)

    assert ReleaseBoot.settings(environment, plain) ==
             {:ok,
              %{
                secret_file: secret.path,
                cookie: Atom.to_string(secret.cookie),
                dist_port: 9400,
                interface: "10.0.0.1"
              }}

    assert {:ok, %{dist_port: 9101}} =
             ReleaseBoot.settings(Map.delete(environment, "CONVOY_DIST_PORT"), plain)

    network = ~s(, network: [secret_file: "#{other}", dist_port: 9500, interface: "10.0.0.2"])

    File.write!(environment["CONVOY_ROBOT_FILE"], file(network))
    assert {:ok, {told, _config}} = ReleaseBoot.robot(environment)

    assert ReleaseBoot.settings(environment, told) ==
             {:ok,
              %{
                secret_file: other,
                cookie: Atom.to_string(cookie),
                dist_port: 9500,
                interface: "10.0.0.2"
              }}
  end

  test "an interface is an address or the name of a card, for check and start alike", %{
    tmp_dir: folder
  } do
    environment = machine(folder, file(), %{"CONVOY_DIST_PORT" => "9499"})
    with_interface = &Map.put(environment, "CONVOY_INTERFACE", &1)

    for wrong <- ["300.1.2.3", "10.0.0.7/24", "fe80::1", "wlan 0"],
        command <- ~w(check start daemon) do
      assert {1, [], [line]} = ReleaseBoot.answer(command, with_interface.(wrong), 0)
      assert line =~ ~s(CONVOY_INTERFACE: expected an IPv4 address such as)
    end

    # Who runs already, is reached.
    assert {0, [_cookie | _], [_line]} = ReleaseBoot.answer("rpc", with_interface.("300.1.2.3"))

    for absent <- ["203.0.113.9", "no-card"] do
      assert {0, lines, []} = ReleaseBoot.answer("check", with_interface.(absent))
      assert Enum.any?(lines, &(&1 =~ "no network here; waits for #{absent}, which "))
      assert {0, [_, _, _, ^absent], []} = ReleaseBoot.answer("start", with_interface.(absent), 0)
    end

    network = ~s(, network: [interface: "no-card"])
    File.write!(environment["CONVOY_ROBOT_FILE"], file(network))
    assert {0, lines, []} = ReleaseBoot.answer("check", environment)
    assert Enum.any?(lines, &(&1 =~ ~r/network +on no-card/))
    File.write!(environment["CONVOY_ROBOT_FILE"], file(~s(, network: [interface: "10.0.0.300"])))
    assert {1, [], [line]} = ReleaseBoot.answer("check", environment)
    assert line =~ ~s(mag1.exs:1: network.interface: expected an IPv4 address)
  end

  test "settings of the environment are checked as those of the file; none is dropped in silence",
       %{
         tmp_dir: folder
       } do
    for {name, wrong} <- [
          {"CONVOY_PEERS", "mag1@10.0.0.7"},
          {"CONVOY_PEERS", "mag1@convoy=10.0.0.7:99999"},
          {"CONVOY_PEERS", "mag1@convoy=10.0.0.7;mag2@convoy=10.0.0.8"},
          {"CONVOY_PEERS", "mag1@convoy=robot.lab"},
          {"CONVOY_ALLOW", "10.0.0.0/33"},
          {"CONVOY_ALLOW", "300.1.1.1"},
          {"CONVOY_DIST_PORT", "99999"},
          {"CONVOY_DIST_PORT", "0"},
          {"CONVOY_DIST_PORT", "9101x"},
          {"CONVOY_TLS", "yes"},
          {"CONVOY_UDP_PORT", "-1"},
          {"CONVOY_UDP_PEERS", "10.0.0.7:0"},
          {"CONVOY_PEER", "mag1@convoy=10.0.0.7"}
        ],
        command <- ~w(check start) do
      assert {1, [], [line]} =
               ReleaseBoot.answer(command, machine(folder, file(), %{name => wrong}), 0)

      assert line =~ ~r/\A#{name}(: expected .*, got| is not known; did you mean CONVOY_PEERS\?)/
    end

    right = %{
      "CONVOY_PEERS" => "mag2@convoy=10.0.0.12:9400, min1@convoy=[fe80::1]",
      "CONVOY_ALLOW" => "10.0.0.20,10.0.1.0/24",
      "CONVOY_DIST_PORT" => "9499",
      "CONVOY_TLS" => "1",
      "CONVOY_UDP_PEERS" => "10.0.0.7:4370"
    }

    assert {0, _lines, []} = ReleaseBoot.answer("check", machine(folder, file(), right))
  end

  test "the robots of the release use the secret of the environment", %{tmp_dir: folder} do
    environment = machine(folder, file())

    for id <- ~w(mag1 min1) do
      path = Path.expand("../../../../../config/robots/#{id}.exs", __DIR__)
      environment = Map.merge(environment, %{"ROBOT" => id, "CONVOY_ROBOT_FILE" => path})
      assert {0, [first | _], []} = ReleaseBoot.answer("check", environment)
      assert first =~ path <> ": valid"
    end
  end

  test "a file that names another secret than the environment says so", %{tmp_dir: folder} do
    environment = machine(folder, file(~s(, network: [secret_file: "/nowhere/secret"])))
    assert {1, [], [line]} = ReleaseBoot.answer("check", environment)
    assert line =~ "/nowhere/secret does not exist"
    secret = environment["CONVOY_SECRET_FILE"]
    assert line =~ "(network.secret_file of the robot file takes precedence over #{secret})"
  end

  test "nothing starts if its port is in use, unless the other program is ending", %{
    tmp_dir: folder
  } do
    {:ok, socket} = :gen_tcp.listen(0, ip: {127, 0, 0, 1})
    {:ok, port} = :inet.port(socket)
    more = %{"CONVOY_DIST_PORT" => "#{port}", "CONVOY_INTERFACE" => "127.0.0.1"}
    environment = machine(folder, file(), more)

    for command <- ~w(start start_iex daemon daemon_iex) do
      assert {1, [], [line]} = ReleaseBoot.answer(command, environment, 0)
      assert line =~ "mag1 does not start: its TCP port #{port} is in use"
    end

    # Other commands reach the robot that has it.
    assert {0, [_cookie | _], []} = ReleaseBoot.answer("rpc", environment, 0)

    test = self()

    ending =
      spawn_link(fn ->
        receive do: (:end -> :gen_tcp.close(socket))
      end)

    :ok = :gen_tcp.controlling_process(socket, ending)
    spawn_link(fn -> send(test, {:answer, ReleaseBoot.answer("start", environment, 60_000)}) end)
    refute_receive {:answer, _}, 150
    send(ending, :end)
    assert_receive {:answer, {0, [_cookie | _], []}}, 5_000
  end

  test "without a secret the answer only says how to make one", %{tmp_dir: folder} do
    environment = machine(folder, file())
    File.rm!(environment["CONVOY_SECRET_FILE"])

    for command <- ~w(start rpc check) do
      assert {1, [], [line]} = ReleaseBoot.answer(command, environment)
      assert line =~ "does not exist; make one"
    end
  end

  describe "halt" do
    defp wired(folder) do
      [base, console] = for name <- ~w(base console), do: Path.join(folder, name)
      {:ok, base_end} = Hal.Serial.open(pty: base)
      {:ok, console_end} = Hal.Serial.open(pty: console)
      drive = ~s(drive: {Hal.RFlex.Driver, port: "#{base}"})
      {base, base_end, console, console_end, "[id: :mag1, profile: :magellan, #{drive}"}
    end

    defp heard(line, text, until) do
      if String.ends_with?(text, until) do
        text
      else
        assert_receive message

        case Hal.Serial.handle(line, message) do
          {:data, bytes} -> heard(line, text <> bytes, until)
          _other -> heard(line, text, until)
        end
      end
    end

    test "sends the phrase of the file to its console, and nothing else", %{tmp_dir: folder} do
      {_base, base_end, console, console_end, file} = wired(folder)
      options = ~s(port: "#{console}", phrase: "System halted")
      environment = machine(folder, file <> ", console: [#{options}]]")
      assert {0, [line], []} = ReleaseBoot.answer("halt", environment)

      assert line ==
               "#{console} got the phrase; a controller that listens there cuts the power now"

      assert heard(console_end, "", "halted\r\n") == "\r\nSystem halted\r\n"
      for line <- [base_end, console_end], do: Hal.Serial.close(line)
    end

    test "sends nothing while a robot has its base, nor if no console is configured", %{
      tmp_dir: folder
    } do
      {base, base_end, console, console_end, file} = wired(folder)
      assert {1, [], [line]} = ReleaseBoot.answer("halt", machine(folder, file <> "]"))
      assert line == "mag1: has no console: in its file; the power stays on"
      {:ok, robot} = Hal.Serial.open(port: base)
      environment = machine(folder, file <> ~s(, console: [port: "#{console}"]]))
      assert {1, [], [line]} = ReleaseBoot.answer("halt", environment)

      assert line ==
               "mag1: a robot runs here: #{base}: another program uses it; the power stays on"

      Hal.Serial.close(robot)
      assert {0, [_], []} = ReleaseBoot.answer("halt", environment)
      # The first thing that the console hears is from the last call.
      halted = "\r\nThe system is halted\r\n"
      assert heard(console_end, "", halted) == halted
      for line <- [base_end, console_end], do: Hal.Serial.close(line)
    end

    test "sends nothing if it is unknown whether a robot runs", %{tmp_dir: folder} do
      {_base, base_end, console, console_end, _file} = wired(folder)
      odd = Path.join(folder, "odd")
      File.write!(odd, "")
      drive = ~s(drive: {Hal.RFlex.Driver, port: "#{odd}"})
      file = ~s([id: :mag1, profile: :magellan, #{drive}, console: [port: "#{console}"]])
      assert {1, [], [line]} = ReleaseBoot.answer("halt", machine(folder, file))
      assert line == "mag1: a robot may run here: #{odd}: not a serial device; the power stays on"
      # A base that does not exist cannot drive.
      File.rm!(odd)
      assert {0, [_told], []} = ReleaseBoot.answer("halt", machine(folder, file))
      halted = "\r\nThe system is halted\r\n"
      assert heard(console_end, "", halted) == halted
      for line <- [base_end, console_end], do: Hal.Serial.close(line)
    end

    test "sends nothing for a file that is wrong", %{tmp_dir: folder} do
      environment = machine(folder, file(~s(, console: [port: "/dev/ttyS0", phrase: "häh"])))
      assert {1, [], [line]} = ReleaseBoot.answer("halt", environment)
      assert line =~ "console.phrase: expected"
      environment = machine(folder, file(~s(, console: [phrase: "x"])))
      assert {1, [], [line]} = ReleaseBoot.answer("halt", environment)
      assert line =~ "console.port: is missing"
    end
  end

  test "check says what the robot is", %{tmp_dir: folder} do
    environment = machine(folder, file())

    assert {0, ["" <> first, "mag1, a Magellan Pro" <> _ | _], []} =
             ReleaseBoot.answer("check", environment)

    assert first == environment["CONVOY_ROBOT_FILE"] <> ": valid"
  end
end
