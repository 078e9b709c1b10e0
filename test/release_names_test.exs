Code.require_file("release/case.exs", __DIR__)
why_not = Vm.Net.why_not()
if why_not, do: IO.puts("commands without a name server are not tested: #{why_not}")

defmodule System.ReleaseNamesTest do
  @moduledoc """
  The commands of a robot on a machine whose network is not as it should be, in a namespace: a name server that never
  answers, an interface that is absent or nonsense.
  """
  use Release.Case, async: true
  alias Vm.Net
  @moduletag long: true, realtime: :long
  @moduletag skip: why_not
  @root Path.expand("..", __DIR__)

  # A machine of its own: the command sees these files, and this name.
  @inside """
  mount --bind "$1/resolv.conf" /etc/resolv.conf
  mount --bind "$1/hosts" /etc/hosts
  hostname lostbot
  shift
  exec "$@"
  """

  setup %{folder: folder} do
    net = Net.create([:mag1], Path.join(folder, "net"), [:names])
    on_exit(fn -> Net.delete(net) end)
    names = net |> Net.address(:names) |> :inet.ntoa()
    Net.ip(net, :mag1, ~w(route add default via #{names}))

    for chain <- ["-p udp --dport 53 -j DROP", "-p tcp --dport 53 -j DROP"],
        do: iptables(net, "-A INPUT #{chain}")

    File.write!(Path.join(folder, "resolv.conf"), "nameserver #{names}\n")
    File.write!(Path.join(folder, "hosts"), "127.0.0.1 localhost\n")
    file = Path.join(folder, "mag1.exs")

    environment = [
      {"ROBOT", "mag1"},
      {"CONVOY_ROBOT_FILE", file},
      {"CONVOY_SECRET_FILE", Path.join(folder, "secret")},
      {"RELEASE_TMP", folder},
      {"RELEASE_MODE", "interactive"}
    ]

    %{net: net, robot: file, environment: environment}
  end

  defp iptables(net, words),
    do:
      System.cmd(
        "ip",
        ~w(netns exec #{Net.space(net, :names)} iptables -w) ++ String.split(words)
      )

  # How often the name server was asked.
  defp asked(net) do
    {text, 0} = iptables(net, "-L INPUT -n -v -x")
    text |> String.split("\n") |> Enum.drop(2) |> Enum.map(&count/1) |> Enum.sum()
  end

  defp count(line),
    do: with([count | _] <- String.split(line), do: String.to_integer(count), else: (_ -> 0))

  defp run(context, program, arguments, more) do
    enter = ["netns", "exec", Net.space(context.net, :mag1), "unshare", "--mount", "--uts"]
    command = ["sh", "-eu", "-c", @inside, "sh", context.folder, Path.join(@root, program)]
    options = [env: more ++ context.environment, stderr_to_stdout: true]
    System.cmd("ip", enter ++ command ++ arguments, options)
  end

  defp robot(context, arguments, more), do: run(context, "bin/robot", arguments, more)

  test "no command waits for a name server, and what the robot starts may ask one", context do
    robot_file(context.robot, Path.join(context.folder, "none"))
    assert {said, 0} = robot(context, ["check"], [])
    assert said =~ ~s(/etc/hosts lacks the line "127.0.1.1 lostbot")
    assert {"", 0} = robot(context, ["daemon"], [])
    pid(fn -> robot(context, ["pid"], []) end)
    assert {said, status} = robot(context, ["rpc", "Swarm.estop()"], [])
    assert {status, said} == {0, ":ok\n"}
    assert {"#mag1 " <> _, 0} = robot(context, ["status"], [])
    assert {_said, 0} = robot(context, ["restart"], [])
    until(~r/^#mag1 .* E-STOP|^#mag1 idle/, fn -> robot(context, ["status"], []) end)
    assert {"4\n", 0} = robot(context, ["eval", "IO.puts(2 + 2)"], [])
    assert asked(context.net) == 0

    ask = ~s|{System.get_env("RES_OPTIONS"), :inet.gethostbyname(~c"camera.example")}|
    assert {said, 0} = robot(context, ["rpc", ask], [])
    assert said =~ "{nil, {:error, "
    assert asked(context.net) > 0
    iptables(context.net, "-Z INPUT")
    assert {"", 0} = robot(context, ["stop"], [])
    assert asked(context.net) == 0
  end

  test "a node of a clone does not wait for one either", context do
    code = "IO.puts(node()); System.halt()"

    assert {said, 0} =
             run(context, "bin/node", ["mag2", "-e", code], [{"MIX_ENV", "#{Mix.env()}"}])

    assert said =~ "mag2@convoy"
    # It would do so under the other nodes of this clone.
    refute said =~ "Compiling"
    assert asked(context.net) == 0
  end

  test "what check says of an interface is what start does", context do
    robot_file(context.robot, Path.join(context.folder, "none"))
    text = String.replace(File.read!(context.robot), ~s(interface: "127.0.0.1", ), "")
    File.write!(context.robot, text)

    for command <- ["check", "start", "daemon"],
        wrong <- ["300.1.2.3", "10.0.0.7/24", "wlan 0"] do
      assert {said, 1} = robot(context, [command], [{"CONVOY_INTERFACE", wrong}])

      assert said =~
               ~s(CONVOY_INTERFACE: expected an IPv4 address such as "10.0.0.7", or the name of)
    end

    for {interface, comes} <- [
          {"10.77.0.9", ~w(addr add 10.77.0.9/24 dev eth0)},
          {"wlan0", ~w(link set eth0 name wlan0)}
        ] do
      given = [{"CONVOY_INTERFACE", interface}]
      assert {said, 0} = robot(context, ["check"], given)
      assert said =~ "no network here; waits for #{interface}, which"
      assert {"", 0} = robot(context, ["daemon"], given)
      pid(fn -> robot(context, ["pid"], given) end)

      until(~r/NO NETWORK \(waits for #{interface}, which/, fn ->
        robot(context, ["status"], given)
      end)

      if interface == "wlan0", do: Net.ip(context.net, :mag1, ~w(link set eth0 down))
      Net.ip(context.net, :mag1, comes)
      if interface == "wlan0", do: Net.ip(context.net, :mag1, ~w(link set wlan0 up))
      until(~r/hears 0, age/, fn -> robot(context, ["status"], given) end)
      assert {"", 0} = robot(context, ["stop"], given)
    end

    node = [
      "mag2",
      "-e",
      "receive(do: (:never -> 0), after: (4_000 -> IO.puts(Mesh.fault()))); System.halt()"
    ]

    given = [{"CONVOY_INTERFACE", "eth0"}, {"MIX_ENV", "#{Mix.env()}"}]
    assert {said, 0} = run(context, "bin/node", node, given)
    assert said =~ "waits for eth0, which is no card of this machine; there are lo, wlan0"
    given = [{"CONVOY_INTERFACE", "300.1.2.3"}, {"MIX_ENV", "#{Mix.env()}"}]
    assert {said, status} = run(context, "bin/node", node, given)
    assert status != 0
    assert said =~ ~S(CONVOY_INTERFACE: expected an IPv4 address)
  end
end
