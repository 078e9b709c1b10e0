why_not = Vm.Net.why_not()
if why_not, do: IO.puts("network cards are not tested: #{why_not}")

defmodule Netns.Stopped do
  @moduledoc "Hears stops in place of a robot, on the node that it is shipped to."
  use GenServer
  alias Robot.Names

  def start, do: GenServer.start(__MODULE__, [], name: Names.via(:mag2, :estop))
  def heard, do: GenServer.call(Names.via(:mag2, :estop), :heard)

  @impl GenServer
  def init([]), do: {:ok, []}
  @impl GenServer
  def handle_cast({:estop, call, _age_ms}, calls), do: {:noreply, [call | calls]}
  @impl GenServer
  def handle_call(:heard, _from, calls), do: {:reply, calls, calls}
end
|> then(fn {:module, module, code, _last} -> :persistent_term.put(module, code) end)

defmodule System.NetnsCardsTest do
  @moduledoc "Nodes on machines with several network cards, or none, each in a network namespace of its own."
  use ExUnit.Case, async: true
  alias Mesh.Distribution.Epmd
  alias Swarm.EStop.Broadcaster
  alias Netns.Stopped
  alias Lab.Node.Network
  alias Vm.{Fleet, Net}
  @moduletag :realtime
  @moduletag skip: why_not
  @moduletag timeout: 120_000

  @names [:mag1, :mag2]

  setup do
    folder =
      Path.join(System.tmp_dir!(), "convoy-cards-#{System.pid()}-#{:rand.uniform(1_000_000)}")

    File.mkdir_p!(folder)
    net = Net.create(@names, folder)
    on_exit(fn -> Net.delete(net) end)
    {:ok, network} = Network.create(net, @names)
    %{net: net, network: network, folder: folder}
  end

  # Nodes with a mesh, each in the space of its name, or of another one.
  defp nodes(network, names \\ @names, options \\ [], space \\ & &1, env \\ []) do
    fleet = Fleet.new()

    abouts =
      for name <- names do
        vm = Keyword.merge(Network.vm(network, space.(name)), name: name, env: env)
        port = if space.(name) == name, do: 4370, else: 0
        mesh = Network.mesh(network, name) |> Keyword.merge([port: port] ++ options)
        config = [logger: [level: :none], swarm: [mesh: mesh]]
        %{name: name, vm: vm, main: &Vm.start_apps(&1, [:swarm], config)}
      end

    fleet |> Fleet.start(abouts) |> Fleet.await()
    for name <- names, do: Fleet.vm(fleet, name)
  end

  defp alive(node), do: Vm.call(node, Mesh, :alive, [])
  defp fault(node), do: Vm.call(node, Mesh, :fault, [])
  defp meet?(nodes), do: Enum.all?(nodes, &(length(alive(&1)) == length(nodes) - 1))

  defp eventually(true?, left_ms \\ 40_000) do
    value = true?.()

    cond do
      value -> value
      left_ms < 0 -> flunk("it never came")
      true -> receive(do: (:never -> :ok), after: (100 -> eventually(true?, left_ms - 100)))
    end
  end

  # A stop that one node calls, as the other hears it.
  defp stop(from, to) do
    code = :persistent_term.get(Stopped)
    {:module, Stopped} = Vm.call(to, :code, :load_binary, [Stopped, ~c"test", code])
    _started = Vm.call(to, Stopped, :start, [])
    call = Vm.call(from, Broadcaster, :call, [])
    :ok = Vm.call(from, Broadcaster, :sound, [call])
    eventually(fn -> call in Vm.call(to, Stopped, :heard, []) end)
  end

  test "without a default route, and with one by another card, nodes meet, and stops arrive", %{
    net: net,
    network: network
  } do
    for who <- @names do
      Net.ip(net, who, ~w(link add eth1 type veth peer name nobody))
      for card <- ~w(eth1 nobody), do: Net.ip(net, who, ~w(link set #{card} up))
    end

    [one, two] = nodes = nodes(network)
    eventually(fn -> meet?(nodes) end)
    eventually(fn -> Vm.call(one, Node, :list, []) == [two.node] end)
    stop(one, two)
    assert Enum.map(nodes, &fault/1) == [nil, nil]
    Vm.stop(nodes)

    for {who, n} <- Enum.with_index(@names, 1) do
      Net.ip(net, who, ~w(addr add 192.168.#{n}.1/24 dev eth1))
      Net.ip(net, who, ~w(route add default via 192.168.#{n}.2))
    end

    [one, two] = nodes = nodes(network)
    eventually(fn -> meet?(nodes) end)
    stop(two, one)
  end

  @tag long: true, realtime: :long
  test "cards that come and go are followed, and a network that is gone is told once", %{
    net: net,
    network: network,
    folder: folder
  } do
    Net.ip(net, :mag1, ~w(link set eth0 down))
    [one, two] = nodes = nodes(network)
    eventually(fn -> fault(one) end)
    log = log(one, folder)
    assert fault(one) == "no network card is up and has an IPv4 address"

    none =
      "no robot is known here to be held by it (no network: no network card is up and has an IPv4 address)"

    assert {:error, said} = Vm.call(one, Swarm, :estop, [])
    assert said =~ none

    Net.ip(net, :mag1, ~w(link set eth0 up))
    eventually(fn -> meet?(nodes) end)
    eventually(fn -> fault(one) == nil end)

    # Another card instead, with another address.
    Net.ip(net, :mag1, ~w(addr flush dev eth0))
    Net.ip(net, :mag1, ~w(link set eth0 down))
    eventually(fn -> fault(one) end)

    plug = [
      "link",
      "add",
      "p99",
      "type",
      "veth",
      "peer",
      "name",
      "wlan0",
      "netns",
      Net.space(net, :mag1)
    ]

    Net.ip(net, :switch, plug)
    Net.ip(net, :switch, ~w(link set p99 master br0 up))
    Net.ip(net, :mag1, ~w(addr add 10.77.0.55/24 dev wlan0))
    Net.ip(net, :mag1, ~w(link set wlan0 up))
    eventually(fn -> meet?(nodes) end)
    stop(two, one)
    Net.ip(net, :switch, ~w(link del p99))

    lines = fn -> lines(log, "robots are neither heard nor reached: no network card is up") end
    eventually(fn -> fault(one) && length(lines.()) == 2 end)
    assert lines(log, "no network") == lines.()
  end

  @tag long: true, realtime: :long
  test "a cable that is pulled is told by the name of its card", %{net: net, network: network} do
    [one] = nodes(network, [:mag1])
    Net.ip(net, :switch, ~w(link set p1 down))
    assert eventually(fn -> fault(one) end) == "eth0 is not connected"
  end

  test "nodes of one machine meet without any network", %{net: net, network: network} do
    Net.ip(net, :mag1, ~w(link set eth0 down))
    [one, two] = nodes(network, @names, [], fn _name -> :mag1 end)
    eventually(fn -> meet?([one, two]) end)
    Vm.stop(two)
    assert eventually(fn -> fault(one) end) == "no network card is up and has an IPv4 address"
  end

  @tag long: true, realtime: :long
  test "what nobody can be sent is told where multicast is off", %{network: network} do
    [one] = nodes(network, [:mag1], multicast: false, peers: ["192.168.77.7:4370"])
    assert eventually(fn -> fault(one) end) == "nothing can be sent: network is unreachable"
  end

  test "a node with a card is heard and connected by that one, also by its next address", %{
    net: net,
    network: network
  } do
    Net.ip(net, :mag1, ~w(link add eth1 type veth peer name nobody))
    for card <- ~w(eth1 nobody), do: Net.ip(net, :mag1, ~w(link set #{card} up))
    Net.ip(net, :mag1, ~w(addr add 10.78.0.1/24 dev eth1))
    Net.ip(net, :mag1, ~w(route add default via 10.78.0.2))
    [two] = nodes(network, [:mag2])
    [one] = with_interface(network, "eth0")
    met = fn -> meet?([one, two]) and Vm.call(two, Node, :list, []) == [one.node] end
    eventually(met)
    assert addresses(one) == [{10, 77, 0, 1}]

    Net.move(net, :mag1)
    eventually(fn -> addresses(one) == [Net.moved(net, :mag1)] end)
    for {a, b} <- [{one, two}, {two, one}], do: Vm.call(a, :erlang, :disconnect_node, [b.node])
    eventually(met)

    # Who calls another address is refused, though it is a fellow.
    Net.ip(net, :mag2, ~w(route add 10.78.0.0/24 via #{:inet.ntoa(Net.moved(net, :mag1))}))
    port = Epmd.default_port("mag1")
    # It may have hung up before we look.
    call = Vm.call(two, :gen_tcp, :connect, [{10, 78, 0, 1}, port, []])
    assert match?({:ok, _socket}, call) or call == {:error, :econnreset}
    eventually(fn -> match?(%{elsewhere: 1}, Vm.call(one, Mesh, :refused, [])) end)
  end

  @tag long: true, realtime: :long
  test "an interface that is absent is waited for, in words", %{net: net, network: network} do
    [two] = nodes(network, [:mag2])

    for {interface, line, comes} <- [
          {"10.77.0.9",
           "waits for 10.77.0.9, which no card has; there are eth0 10.77.0.1, lo 127.0.0.1",
           ~w(addr add 10.77.0.9/24 dev eth0)},
          {"wlan0", "waits for wlan0, which is no card of this machine; there are eth0, lo",
           ~w(link set eth0 name wlan0)}
        ] do
      [one] = with_interface(network, interface)
      assert eventually(fn -> fault(one) end) == line
      if interface == "wlan0", do: Net.ip(net, :mag1, ~w(link set eth0 down))
      Net.ip(net, :mag1, comes)
      if interface == "wlan0", do: Net.ip(net, :mag1, ~w(link set wlan0 up))
      eventually(fn -> meet?([one, two]) and Vm.call(two, Node, :list, []) == [one.node] end)
      eventually(fn -> fault(one) == nil end)
      Vm.stop(one)
      eventually(fn -> alive(two) == [] end)
      if interface == "10.77.0.9", do: Net.ip(net, :mag1, ~w(addr del 10.77.0.9/24 dev eth0))
    end
  end

  # As `bin/node` and releases give it: to the distribution by the environment, to the mesh as an option.
  defp with_interface(network, interface),
    do: nodes(network, [:mag1], [interface: interface], & &1, [{"CONVOY_INTERFACE", interface}])

  # Of the datagrams of a node.
  defp addresses(node) do
    protocol = Vm.call(node, :sys, :get_state, [Mesh.Server]).protocol
    for {ip, _port} <- protocol.addresses, do: ip
  end

  # The log of a node, as a file.
  defp log(node, folder) do
    path = Path.join(folder, "log")
    config = %{config: %{file: to_charlist(path)}}
    :ok = Vm.call(node, :logger, :set_primary_config, [:level, :warning])
    _ = Vm.call(node, :logger, :remove_handler, [Logger])
    :ok = Vm.call(node, :logger, :add_handler, [:file, :logger_std_h, config])
    path
  end

  defp lines(log, word),
    do: log |> File.read!() |> String.split("\n") |> Enum.filter(&(&1 =~ word))
end
