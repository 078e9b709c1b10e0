defmodule Lab.NodesTest do
  @moduledoc "The pure parts of fleets whose robots are processes of their own."
  use ExUnit.Case, async: true
  alias Lab.Fleet.Nodes
  alias Lab.Node.Network
  alias Lab.Fleet.Nodes.{Command, Host}
  doctest Lab.Fleet.Nodes.Command

  test "a node listens on loopback only, dials nobody by itself, and has no secret on its command line" do
    for place <- [:epmd, :group, :loopback] do
      {:ok, network} = Network.create(place, [:mag1, :mag2], [:world])
      options = Network.vm(network, :mag1)
      line = Enum.join(options[:flags], " ")
      assert line =~ "inet_dist_use_interface {127,0,0,1}"
      assert line =~ "prevent_overlapping_partitions false"
      assert line =~ "dist_auto_connect never"
      assert line =~ "-proto_dist Elixir.Mesh.Distribution.Tcp"
      refute inspect(options) =~ "#{network.secret.cookie}"
    end
  end

  test "nodes with known ports try all others, and no two have the same" do
    {:ok, network} = Network.create(:epmd, [:mag1, :mag2], [:world, :launcher])
    meshes = for name <- [:mag1, :mag2, :world, :launcher], do: Host.mesh(network, name)
    ports = for mesh <- meshes, do: mesh[:port]
    assert Enum.uniq(ports) == ports

    for mesh <- meshes do
      assert Enum.sort(for {_ip, port} <- mesh[:peers], do: port) ==
               Enum.sort(ports -- [mesh[:port]])

      assert mesh[:fleet] == [:mag1, :mag2]
    end
  end

  test "people are told about each process, and about those that are gone" do
    nodes = [{:mag1, :"mag1@127.0.0.1", nil}, {:min1, :"min1@127.0.0.1", "12"}]
    [gone, there, attach, kill] = Command.lines(nodes, "/tmp/x")
    assert gone =~ "mag1"
    assert gone =~ "gone"
    assert there == "min1 pid 12 node min1@127.0.0.1"
    assert attach =~ "--remsh min1@127.0.0.1"
    assert kill =~ "kill -9 12"
    assert kill =~ "kill -STOP 12"
    assert kill =~ "kill -CONT 12"
    assert [gone, _no_command] = Command.lines([hd(nodes)], "/tmp/x")
    assert gone =~ "gone"
  end

  test "a world that ends for the sixth time ends the run, which can still be asked" do
    {:ok, setup} = Lab.Trial.Setup.new(robots: [:mag1], map: "hall")
    {:ok, network} = Network.create(:epmd, [:mag1], [:world])

    backend = %Nodes{
      setup: setup,
      host: %Host{home: "", network: network, mesh: self(), named: :before},
      nodes: nil,
      name: :w,
      world: setup.world,
      world_starts: 5,
      server: self()
    }

    down = {Vm.Fleet, :world, {:down, "Killed", 6}, 0}
    assert {:ended, line, backend} = Nodes.hear(backend, down)
    assert line == "world@127.0.0.1 has ended 6 times, last: Killed"
    assert backend.server == nil
    assert Nodes.world(backend) == setup.world
  end
end
