defmodule Swarm.ConversationNodesTest do
  use Swarm.Case, async: false
  alias Agents.{Conversation, Envelope}
  alias Agents.Answerers
  alias Swarm.Cluster
  @moduletag :realtime
  @moduletag :cluster

  defp question(content), do: Envelope.new(:query, :asker, content)

  defp echoes(nodes) do
    for {node, n} <- Enum.with_index(nodes) do
      name = Enum.at([:talk_n0, :talk_n1, :talk_n2, :talk_n3], n)
      [pid] = :erpc.call(node, Answerers, :start, [[name], :far])
      # The second one can be found: they come one after the other.
      eventually(fn -> pid in Directory.members({:service, :far}) end)
      eventually(fn -> pid in Directory.members({:service, :far, name}) end)
      {{name, :far}, pid}
    end
  end

  test "a killed node is dropped at once, a frozen one at the deadline; nobody waits longer" do
    [killed, frozen, well] = nodes = Cluster.start_nodes(3)
    peers = for {peer, _pid} <- echoes(nodes), do: peer
    pids = for peer <- peers, do: elem(peer, 0)
    assert pids == [:talk_n0, :talk_n1, :talk_n2]
    assert {:complete, %{}, []} = Conversation.gather(peers, question(1), 5_000)

    # It dies while it is asked: it no longer answers, and everybody else has answered.
    test = self()

    asked =
      Task.async(fn ->
        Conversation.gather(Enum.take(peers, 1), question({:tell, test}), 60_000)
      end)

    assert_receive {:told, :talk_n0, _}
    Cluster.kill(killed)
    assert Task.await(asked) == {:partial, %{}, [{:talk_n0, :far}]}

    Cluster.freeze(frozen)
    started = System.monotonic_time(:millisecond)
    assert {:partial, answers, missing} = Conversation.gather(peers, question(2), 200)
    assert (System.monotonic_time(:millisecond) - started) in 190..2_000
    assert Map.keys(answers) == [{:talk_n2, :far}]
    assert Enum.sort(missing) == [{:talk_n0, :far}, {:talk_n1, :far}]

    # A quorum of those who answer is reached at once.
    assert {:complete, _, _} = Conversation.gather(peers, question(2), 60_000, 1)

    Cluster.thaw(frozen)
    eventually(fn -> match?({:ok, _}, Conversation.request({:talk_n1, :far}, question(3))) end)
    assert {:ok, _} = :erpc.call(well, Conversation, :request, [{:talk_n1, :far}, question(4)])
    refute_received %Envelope{}
  end

  test "a node that is not connected is neither dialled nor waited for" do
    [near, far] = Cluster.start_nodes(2, connect: false)
    [_, {_peer, pid}] = echoes([near, far])

    assert :erpc.call(near, Conversation, :request, [pid, question(1), 60_000]) ==
             {:error, :not_connected}

    refute far in :erpc.call(near, Node, :list, [])
    assert {:ok, %{content: 1}} = Conversation.request(pid, question(1))
  end

  # The connection's buffer is full because its node is frozen: a plain send would wait for ever.
  test "nobody waits for a full connection" do
    [node] = Cluster.start_nodes(1)
    [{peer, _pid}] = echoes([node])
    Cluster.freeze(node)
    load = question(:binary.copy("x", 100_000))

    full = eventually(fn -> match?({:error, _}, Conversation.tell(peer, load)) || nil end)
    assert full
    assert Conversation.tell(peer, load) == {:error, :busy}
    assert Conversation.request(peer, load, 60_000) == {:error, :busy}
    assert {:partial, %{}, [^peer]} = Conversation.gather([peer], load, 60_000)
  end
end
