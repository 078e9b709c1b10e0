defmodule Swarm.Mesh.LibclusterTest do
  @moduledoc "Strategies of libcluster beside our own, on real nodes."
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Swarm.MeshNodes, as: Cluster
  @moduletag :realtime
  @moduletag adapter: :libcluster

  unless Code.ensure_loaded?(Elixir.Cluster.Supervisor),
    do: @moduletag(skip: "libcluster is not installed")

  defp alive(node) do
    for {other, %{status: :alive}} <- Cluster.call(node, Mesh, :view, []).nodes, do: other
  end

  defp linked(node), do: Cluster.call(node, Node, :list, [])

  defp full?(nodes) do
    Enum.all?(nodes, fn node ->
      others = Enum.sort(for other <- nodes, other != node, do: other.node)
      Enum.sort(alive(node)) == others and Enum.sort(linked(node)) == others
    end)
  end

  # The strategies are named as text would be: libcluster need not be there.
  defp lab(strategy, config),
    do: [lab: [strategy: Module.concat(Elixir.Cluster.Strategy, strategy), config: config]]

  # A node of the same fleet, with some options of the mesh different.
  defp join(one, options, more \\ []) do
    mesh = Cluster.call(one, Application, :get_env, [:swarm, :mesh])
    name = Enum.find(Enum.reverse(mesh[:fleet]), &(&1 not in (more[:taken] || [])))
    Cluster.call(one, Application, :put_env, [:swarm, :mesh, Keyword.merge(mesh, options)])
    node = Cluster.join([one], name, Keyword.take(more, [:host]))
    Cluster.call(one, Application, :put_env, [:swarm, :mesh, mesh])
    node
  end

  test "Gossip: nodes find each other, and another one by our own list" do
    gossip = lab(:Gossip, port: free_port(), secret: "of libcluster", multicast_if: "127.0.0.1")
    [one, two] = Cluster.start(2, mesh: [multicast: false, topologies: gossip])
    assert eventually(fn -> full?([one, two]) end)

    %{port: port} = Cluster.call(one, Mesh, :counts, [])
    three = join(one, topologies: [], peers: ["127.0.0.1:#{port}"])
    assert eventually(fn -> full?([one, two, three]) end)
  end

  test "Epmd: a node connects those that it names" do
    [one] = Cluster.start(1, mesh: [multicast: false])
    two = join(one, topologies: lab(:Epmd, hosts: [one.node], timeout: 200))
    assert eventually(fn -> full?([one, two]) end)
  end

  test "DNSPoll: a node connects those that a name server knows" do
    port = Swarm.LocalDns.start({127, 0, 0, 1})
    [one] = Cluster.start(1, host: "127.0.0.1", mesh: [multicast: false])

    dns =
      lab(:DNSPoll,
        query: "robots.lab",
        node_basename: "#{one.name}",
        polling_interval: 200,
        resolver: Swarm.LocalDns.resolver(port)
      )

    two = join(one, [topologies: dns], host: "127.0.0.1")
    assert eventually(fn -> full?([one, two]) end)
  end

  test "a node without the fleet's secret is not let in by any topology" do
    [one] = Cluster.start(1, mesh: [multicast: false])
    mesh = Cluster.call(one, Application, :get_env, [:swarm, :mesh])
    other = %{mesh[:secret] | key: :crypto.strong_rand_bytes(32), cookie: :of_others}
    topologies = lab(:Epmd, hosts: [one.node], timeout: 200)
    stranger = join(one, secret: other, topologies: topologies)

    # What its strategy does again and again, once more here, to see how it ends.
    assert Cluster.call(stranger, Elixir.Cluster.Strategy, :connect_nodes, [
             :lab,
             {:net_kernel, :connect_node, []},
             {:erlang, :nodes, [:connected]},
             [one.node]
           ]) == {:error, [{one.node, false}]}

    # Meanwhile one of the fleet is.
    two = join(one, [topologies: topologies], taken: [stranger.name])
    assert eventually(fn -> full?([one, two]) end)
    assert linked(stranger) == [] and alive(stranger) == []
  end

  # For the moment: libcluster opens it on all nodes of the topology.
  defp free_port do
    {:ok, socket} = :gen_udp.open(0)
    {:ok, port} = :inet.port(socket)
    :gen_udp.close(socket)
    port
  end
end
