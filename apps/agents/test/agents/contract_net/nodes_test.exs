defmodule Agents.ContractNet.NodesTest do
  use Swarm.Case, async: false
  alias Agents.ContractNet
  alias Agents.Answerers
  alias Swarm.Cluster
  @moduletag :realtime
  @moduletag :cluster

  defp bidders(nodes, bids) do
    for {node, {name, cost}} <- Enum.zip(nodes, bids) do
      pid = :erpc.call(node, Answerers, :start_bidder, [name, cost])
      eventually(fn -> pid in Directory.members({:service, :tasks, name}) end)
      {name, :tasks}
    end
  end

  defp auction(how, peers, options),
    do: Task.async(fn -> ContractNet.auction({:carry, how}, peers, [from: :base] ++ options) end)

  test "a winner that is killed or frozen loses the task to the next, and at last to nobody" do
    [killed, frozen, well] = nodes = Cluster.start_nodes(3)
    peers = [_, _, last] = bidders(nodes, net_n0: 1, net_n1: 2, net_n2: 3)
    auction = auction({:tell, self()}, peers, silence_ms: 2_500, bid_ms: 300, rounds: 9)

    assert_receive {:working, :net_n0, _worker}
    Cluster.kill(killed)
    # Nobody waits until it has been silent for long enough.
    assert_receive {:working, :net_n1, _worker}, 2_000
    Cluster.freeze(frozen)
    assert_receive {:working, :net_n2, worker}
    send(worker, :go_on)
    assert Task.await(auction) == {:ok, last, {:carried_by, :net_n2}}

    # The frozen one does not bid; nobody waits for it any longer than that.
    assert {:ok, ^last, _} = Task.await(auction(1, peers, bid_ms: 200))

    Cluster.thaw(frozen)
    # While it was frozen it was told that nobody wants its work any more.
    eventually(fn ->
      match?({:ok, {:net_n1, :tasks}, _}, Task.await(auction(1, peers, bid_ms: 200)))
    end)

    Cluster.kill(well)
    Cluster.kill(frozen)
    assert Task.await(auction(1, peers, [])) == {:error, :nobody}
  end

  test "an absurd bid counts as any other number, or is not a bid" do
    huge = Bitwise.bsl(1, 80_000)
    nodes = Cluster.start_nodes(2)
    bids = [net_a: huge, net_b: 1.0e308, net_c: :cheap, net_d: nil, net_e: [1], net_f: "0"]
    peers = bidders(Stream.cycle(nodes), bids)
    assert {:ok, {:net_b, :tasks}, _} = Task.await(auction(1, peers, []))
    assert {:ok, {:net_a, :tasks}, _} = Task.await(auction(1, peers -- [{:net_b, :tasks}], []))
    assert Task.await(auction(1, Enum.drop(peers, 2), bid_ms: 100)) == {:error, :no_bids}
  end
end
