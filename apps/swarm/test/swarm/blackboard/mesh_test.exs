defmodule Swarm.Blackboard.MeshTest do
  # Real nodes on loopback.
  # Its nodes are VMs of their own, with names and ports of their own: nothing of this VM is shared.
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Swarm.{Blackboard, Status}
  alias Swarm.Blackboard.Hints
  alias Swarm.Discovery.RobotInfo
  alias Swarm.MeshNodes, as: Cluster
  alias Swarm.MeshNodes.Listener
  @moduletag :realtime

  defp get(node, robot, key),
    do: Cluster.call(node, Blackboard, :get, [robot, key, :infinity])

  defp news(node, what, robot) do
    Enum.find(Cluster.call(node, Listener, :news, []), fn news ->
      elem(news, 0) == what and elem(news, 1) == robot
    end)
  end

  test "rows and hints cross nodes, robots are found by their properties, and the matrix is full" do
    nodes = [one, two, three] = Cluster.start(3, robots: true)
    names = Enum.sort(Enum.map(nodes, & &1.name))
    assert eventually(fn -> Cluster.call(one, Swarm, :find, [[service: :drive]]) == names end)

    assert eventually(fn ->
             Cluster.call(three, Swarm, :find, [
               [profile: :magellan, calibrated: true, state: :idle]
             ]) == names
           end)

    :ok = Cluster.call(one, Blackboard, :put, [one.name, :door, %{open: true}])
    assert eventually(fn -> match?({:ok, %{open: true}, _}, get(two, one.name, :door)) end)
    assert {:error, _} = Cluster.call(two, Blackboard, :put, [one.name, :door, 1])

    big = :crypto.strong_rand_bytes(50_000)
    :ok = Cluster.call(one, Blackboard, :put, [one.name, :map, big])
    assert eventually(fn -> match?({:ok, ^big, _}, get(three, one.name, :map)) end)

    :ok = Cluster.call(two, Hints, :put, [two.name, {:searched, 7}, 1.5])

    assert eventually(fn ->
             Cluster.call(three, Hints, :get, [{:searched, 7}]) == {:ok, 1.5, two.name}
           end)

    # A node that comes later gets all of it.
    late =
      Cluster.join(
        nodes,
        :"#{hd(names)}" |> to_string() |> String.replace(~r/_.*/, "_90") |> String.to_atom()
      )

    assert eventually(fn -> match?({:ok, ^big, _}, get(late, one.name, :map)) end)

    assert eventually(fn ->
             Cluster.call(late, Hints, :get, [{:searched, 7}]) == {:ok, 1.5, two.name}
           end)

    assert eventually(fn ->
             matrix = Cluster.call(one, Swarm, :matrix, [])

             Enum.all?(names, fn a ->
               Enum.all?(names -- [a], &(Swarm.Status.Matrix.hears?(matrix, a, &1) == true))
             end)
           end)

    %{view: {number, members}} = Cluster.call(one, Swarm, :status, [two.name])
    assert number >= 2 and members == names
  end

  test "a robot without a connection is shown from its row" do
    [one, two] = Cluster.start(2, robots: true)

    assert eventually(fn ->
             match?(%Status{from: :robot}, Cluster.call(one, Swarm, :status, [two.name]))
           end)

    # A cookie that only this node has for the other, so that neither can connect again.
    Cluster.call(one, :erlang, :set_cookie, [two.node, :wrong])
    true = Cluster.call(one, Node, :disconnect, [two.node])

    assert eventually(fn ->
             match?(
               %Status{from: :row, state: :idle, age_ms: age} when age < 2_000,
               Cluster.call(one, Swarm, :status, [two.name])
             )
           end)

    # On a busy machine heartbeats may come late for a moment.
    assert eventually(fn ->
             all = Cluster.call(one, Swarm, :status, [])

             Enum.any?(all, &(&1.robot == two.name and &1.from == :row)) and
               Cluster.call(one, Swarm, :find, [[robot: two.name, service: :drive]]) == [two.name]
           end)
  end

  test "subscribers are notified of a join, of a kill at once, and of a robot that froze" do
    nodes = [one, two, three] = Cluster.start(3, robots: true)
    :ok = Cluster.call(one, Listener, :start, [])
    # Both planes know of both before anything happens.
    for other <- [two, three] do
      assert eventually(fn ->
               Map.has_key?(Cluster.call(one, Mesh, :robots, []), other.name)
             end)

      assert eventually(fn ->
               Cluster.call(one, Swarm.Directory, :whereis, [other.name]) != nil
             end)
    end

    Cluster.signal(two, "KILL")
    # From its connection, not only from its silence.
    assert {:leave, _, :nodedown} = eventually(fn -> news(one, :leave, two.name) end)
    Cluster.signal(three, "STOP")
    assert {:leave, _, :silent} = eventually(fn -> news(one, :leave, three.name) end)
    Cluster.signal(three, "CONT")
    assert {:join, _, %RobotInfo{}} = eventually(fn -> news(one, :join, three.name) end)
    back = Cluster.join(nodes, two.name, robots: true)
    assert {:join, _, %RobotInfo{}} = eventually(fn -> news(one, :join, back.name) end)
  end
end
