defmodule Mesh.PureTest do
  use ExUnit.Case, async: true
  alias Mesh.Options
  alias Mesh.Protocol.{Beacon, NodeTable, Routing}
  alias Mesh.Distribution.Access.Networks
  alias Mesh.Distribution.Topology

  doctest Mesh.Environment
  doctest Mesh.Backoff
  doctest Mesh.Fault
  doctest Mesh.Interface
  doctest Mesh.Protocol.Beacon
  doctest Mesh.Protocol.Challenge
  doctest Mesh.Protocol.ClockOffset
  doctest Mesh.Distribution.Certs
  doctest Mesh.Protocol.Packet.ReplayProtection
  doctest Mesh.Protocol.Packet.SequenceWindow
  doctest Mesh.Log
  doctest Mesh.Protocol.Namesake
  doctest Mesh.Protocol.NodeTable
  doctest Mesh.Protocol.Packet
  doctest Mesh.Distribution.Topology
  doctest Mesh.Protocol.Roster
  doctest Mesh.Protocol.Routing
  doctest Mesh.Strategy.Static
  doctest Mesh.Protocol.WireTerm

  test "up to 30 nodes everybody is connected to everybody, above that to few, and all hang together" do
    for count <- [2, 30, 31, 60, 100] do
      names = for n <- 1..count, do: "mag#{100 + n}@lab"
      links = Map.new(names, &{&1, Topology.peers(&1, names, 30, 8)})

      if count <= 30,
        do: assert(Enum.all?(links, fn {me, peers} -> peers == names -- [me] end)),
        else: assert(Enum.all?(links, fn {_me, peers} -> length(peers) in 6..8 end))

      # What one plans the other plans too.
      for {me, peers} <- links, peer <- peers, do: assert(me in links[peer])

      for other <- tl(names) do
        route = Topology.route(hd(names), other, links)
        assert List.last(route) == other and length(route) <= 7
      end
    end
  end

  test "the number of the view grows with a node that goes and comes, not with one that is late" do
    place = {{10, 0, 0, 7}, 4370}
    {node_table, [up: "b"]} = NodeTable.hear(NodeTable.new("a"), "b", place, 0)
    {late, [suspect: "b"]} = NodeTable.age(node_table, 1_500)
    {back, [up: "b"]} = NodeTable.hear(late, "b", place, 1_600)
    assert {node_table.number, late.number, back.number} == {1, 1, 1}
    {gone, [gone: "b"]} = NodeTable.age(back, 3_600)
    {again, [up: "b"]} = NodeTable.hear(gone, "b", place, 9_000)
    assert {gone.number, again.number} == {2, 3}
  end

  test "there is no way to where no connection leads" do
    assert Topology.route("a", "z", %{"a" => ["b"], "b" => ["a"], "z" => []}) == nil
  end

  # What "a" knows at 5 s: all of "b", of "c" that it has been silent for 3 s, though TCP has not noticed.
  defp torn(hears) do
    address = {{10, 0, 0, 1}, 1}
    {node_table, _up} = NodeTable.hear(NodeTable.new("a"), "c", address, 2_000)
    node_table = NodeTable.robot(node_table, "c", :mag3, {1, 1}, 2_000)
    {node_table, _up} = NodeTable.hear(node_table, "b", address, 5_000)
    hears = for name <- hears, do: {name, address}

    NodeTable.beacon(
      node_table,
      "b",
      %Beacon{hears: hears, links: ["a", "c"], port: 0},
      5_000
    )
  end

  test "where a link is silent the way leads over one that hears both" do
    node_table = torn(["a", "c"])
    ways = Routing.ways("a", ["b", "c"], onward(node_table))
    assert ways == %{"a" => ["b"], "b" => ["a", "c"]}
    assert Topology.route("a", "c", ways) == ["b", "c"]
    assert Routing.beyond(node_table, 5_000) == [:mag3]
  end

  test "there is no way to a node that nobody hears" do
    node_table = torn(["a"])
    assert Topology.route("a", "c", Routing.ways("a", ["b", "c"], onward(node_table))) == nil
    assert Routing.beyond(node_table, 5_000) == []
  end

  # Of those that are heard at 5 s.
  defp onward(node_table) do
    for {name, _address} <- NodeTable.hears(node_table, 5_000),
        into: %{},
        do: {name, Routing.onward(node_table.nodes[name])}
  end

  test "the names of a fleet come as text from this machine's configuration, and from nowhere else" do
    name = "rover_#{System.unique_integer([:positive])}"
    secret = Mesh.Air.secret()
    roster = Mesh.Protocol.Roster.new(:mag1@lab, Hal.RobotName.usual())
    assert Mesh.Protocol.Roster.guest?(roster, name <> "@lab")
    assert :error == Hal.ExternalTerm.atom(name)

    assert Mesh.Environment.check(%{"CONVOY_FLEET" => "mag1, Rover"}) ==
             {:error,
              [~s(CONVOY_FLEET: expected a robot's name such as "mag1" or "rover_2", got "Rover")]}

    assert :error == Hal.ExternalTerm.atom(name)

    assert {:ok, %Options{fleet: [:mag1, rover]}} =
             Options.new(secret: secret, fleet: ["mag1", name])

    assert Atom.to_string(rover) == name
    roster = Mesh.Protocol.Roster.new(:mag1@lab, [:mag1, rover])
    assert Mesh.Protocol.Roster.robot?(roster, rover)
    refute Mesh.Protocol.Roster.robot?(roster, :mag2)
    assert {:ok, %Options{fleet: usual}} = Options.new(secret: secret)
    assert usual == Hal.RobotName.usual() and length(usual) == 200
  end

  test "options are checked by name" do
    secret = Mesh.Air.secret()

    for {options, word} <- [
          {[prot: 1], "mesh option prot is not known: allowed are secret_file"},
          {[port: -1], "mesh option port: expected a whole number from 0 to 65535, got -1"},
          {[multicast: {{10, 0, 0, 1}, 1}], "mesh option multicast: expected a group"},
          {[multicast: {{239, 999, 0, 1}, 1}],
           "mesh option multicast: expected a group and a port"},
          {[multicast: "239.0.0.1:1"], "mesh option multicast: expected a group and a port"},
          {[peers: ["10.0.0.1"]],
           ~s(mesh option peers: expected an address such as "10.0.0.7:4370")},
          {[addresses: ["10.0.0.1"]], "mesh option addresses.1: expected"},
          {[addresses: List.duplicate("10.0.0.1:1", 9)], "mesh option addresses: expected"},
          {[peers: :all], "mesh option peers: expected a list of addresses such as"},
          {[allow: ["10.0.1.7/24"]], ~s(mesh option allow.1: expected an address or a network)},
          {[interface: "300.1.2.3"],
           ~s(mesh option interface: expected an IPv4 address such as "10.0.0.7", or the name of a network card)},
          {[multicast: nil], ~r/mesh option multicast: expected .*, got nil/},
          {[fleet: []], ~r/mesh option fleet: expected .*, got \[\]/},
          {[fleet: [:"mag1\n"]], "mesh option fleet.1: expected"},
          {[fleet: ["Mag1"]], ~s(mesh option fleet.1: expected a robot's name such as "mag1")},
          {[strategies: [String]],
           "mesh option strategies: expected {Module, options}, got String"},
          {[strategies: [{String, 1}]], "strategies names String, which is not a Mesh.Strategy"},
          {[secret: "cookie"], ~s(mesh option secret: expected a %Mesh.Secret{})},
          {[full_mesh: 1], "mesh option full_mesh: expected a whole number from 2 to 1000"},
          {[topologies: [lab: [strategy: Nowhere]]], "mesh option topologies need libcluster"},
          {[topologies: :lab], "mesh option topologies: expected [name: [strategy"}
        ] do
      assert {:error, line} = Options.new(Keyword.merge([secret: secret], options))
      assert line =~ word
      refute line =~ "\n"
    end

    assert {:ok, %Options{port: 4370, addresses: []}} = Options.new(secret: secret)
    assert {:ok, options} = Options.new(secret: secret, addresses: ["10.0.0.7:4370"])
    assert options.addresses == [{{10, 0, 0, 7}, 4370}]
  end

  test "allowed networks and the addresses of peers may connect" do
    secret = Mesh.Air.secret()
    options = [secret: secret, peers: ["10.0.0.7:4370"], allow: ["10.0.1.0/24", "10.0.0.20"]]
    assert {:ok, options} = Options.new(options)
    networks = Options.networks(options)

    for {ip, in?} <- [{{10, 0, 0, 7}, true}, {{10, 0, 1, 99}, true}, {{10, 0, 0, 21}, false}],
        do: assert(Networks.find(networks, ip) != nil == in?)
  end
end
