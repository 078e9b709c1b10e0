defmodule Swarm.MeshTest do
  # Real nodes on loopback.
  # Its nodes are VMs of their own, with names and ports of their own: nothing of this VM is shared.
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Swarm.MeshNodes, as: Cluster
  @moduletag :realtime

  # Those that see each other fall silent and come back; whoever ends one for good has others of its own.
  setup_all do
    %{nodes: Cluster.start(3, robots: true)}
  end

  defp alive(node) do
    for {other, %{status: :alive}} <- Cluster.call(node, Mesh, :view, []).nodes, do: other
  end

  defp linked(node), do: Cluster.call(node, Node, :list, [])
  defp full?(nodes), do: Enum.all?(nodes, &(met?(&1, nodes) and joined?(&1, nodes)))
  defp met?(node, nodes), do: Enum.sort(alive(node)) == others(node, nodes)
  defp joined?(node, nodes), do: Enum.sort(linked(node)) == others(node, nodes)
  defp others(node, nodes), do: Enum.sort(for n <- nodes, n.node != node.node, do: n.node)

  defp status(node, robot), do: Cluster.call(node, Swarm, :status, [robot])

  test "nodes find each other, a command crosses, and each hears all", %{nodes: nodes} do
    [one, two, _three] = nodes
    assert eventually(fn -> full?(nodes) end)
    assert eventually(fn -> Cluster.call(one, Swarm, :stop, [two.name]) == :ok end)

    assert eventually(fn ->
             match?(%{peers: peers} when map_size(peers) == 2, status(one, two.name))
           end)

    # Its robot is in its next beacon.
    assert eventually(fn ->
             seen = Cluster.call(one, Mesh, :view, []).nodes[two.node]
             %{status: :alive, connected: true, robots: robots} = seen
             robots == [two.name]
           end)
  end

  test "a killed node is gone, and works as before when it comes back" do
    nodes = [one, two, three] = Cluster.start(3, robots: true)
    assert eventually(fn -> full?(nodes) end)
    Cluster.signal(three, "KILL")
    assert eventually(fn -> alive(one) == [two.node] end)
    back = Cluster.join(nodes, three.name, robots: true)
    assert eventually(fn -> full?([one, two, back]) end)
    assert eventually(fn -> Cluster.call(one, Swarm, :stop, [three.name]) == :ok end)
  end

  test "a frozen node is gone for the others although its connections exist, and comes back", %{
    nodes: nodes
  } do
    [one, two, three] = nodes
    assert eventually(fn -> full?(nodes) end)
    Cluster.signal(two, "STOP")
    assert eventually(fn -> alive(one) == [three.node] and alive(three) == [one.node] end)
    assert two.node in linked(one)
    Cluster.signal(two, "CONT")
    assert eventually(fn -> full?(nodes) end)
  end

  test "one connection cut for good changes neither the others nor any view", %{nodes: nodes} do
    [one, two, three] = nodes
    assert eventually(fn -> full?(nodes) end)
    cookie = Cluster.call(one, Node, :get_cookie, [])
    # A cookie that only these two have for each other, so that neither can connect again.
    Cluster.call(one, :erlang, :set_cookie, [two.node, :wrong])
    true = Cluster.call(one, Node, :disconnect, [two.node])
    number = Cluster.call(three, Mesh, :view, []).number
    assert eventually(fn -> two.node not in linked(one) end)
    assert Enum.sort(linked(three)) == others(three, nodes)
    assert met?(one, nodes) and met?(two, nodes)
    assert Cluster.call(three, Mesh, :view, []).number == number

    # The command goes through the third node.
    assert eventually(fn -> Cluster.call(one, Swarm, :stop, [two.name]) == :ok end)
    Cluster.call(one, :erlang, :set_cookie, [two.node, cookie])
    assert eventually(fn -> full?(nodes) end)
  end

  test "if multicast is blocked, a list of addresses suffices" do
    [one] = Cluster.start(1, mesh: [multicast: false])
    %{port: port} = Cluster.call(one, Mesh, :counts, [])
    mesh = Cluster.call(one, Application, :get_env, [:swarm, :mesh])
    peers = Keyword.put(mesh, :peers, ["127.0.0.1:#{port}"])
    Cluster.call(one, Application, :put_env, [:swarm, :mesh, peers])
    [name | _] = Enum.reverse(mesh[:fleet])
    two = Cluster.join([one], name)
    assert eventually(fn -> full?([one, two]) end)
  end

  test "nodes that somebody has connected by hand, or libcluster, introduce themselves" do
    [one, two] = Cluster.start(2, mesh: [multicast: false])
    assert alive(one) == []
    true = Cluster.call(one, :net_kernel, :connect_node, [two.node])
    assert eventually(fn -> full?([one, two]) end)
  end
end
