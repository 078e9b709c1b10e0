defmodule Agents.TopicTest do
  use Swarm.Case, async: false
  alias Agents.{Conversation, Envelope, Responder, Topic}
  alias Agents.Answerers
  alias Swarm.Cluster
  @moduletag :realtime

  defp members(topic, count),
    do: eventually(fn -> length(Directory.members({:topic, topic})) == count end)

  test "subscribers get what they ask for, by template and within their limit" do
    {:ok, all} = Topic.subscribe(:topic_poses)
    {:ok, some} = Topic.subscribe(:topic_poses, template: [from: :mag1], limit: 2)
    {:ok, other} = Topic.subscribe("topic_other")
    members(:topic_poses, 2)

    for n <- 1..5, do: assert(Topic.publish(:topic_poses, :mag1, n, class: :telemetry) == 2)
    assert Topic.publish(:topic_poses, :mag2, 6) == 2
    assert Topic.publish("topic_nobody", :mag2, 6) == 0

    for n <- 1..6, do: assert({:ok, %{content: ^n}} = Topic.next(all, 1_000))
    assert {:ok, %{content: 4, topic: :topic_poses}} = Topic.next(some, 1_000)
    assert {:ok, %{content: 5}} = Topic.next(some, 1_000)
    assert Topic.next(some, 0) == :none
    assert Topic.next(other, 0) == :none
    assert %{telemetry: 3, unwanted: 1, waiting: 0} = Topic.counts(some)

    # A reader that has given up waiting is not sent anything.
    Topic.publish(:topic_poses, :mag1, 7)
    assert %{waiting: 1} = Topic.counts(some)
    refute_received {:topic, _, _}
    Topic.more(some)
    assert_receive {:topic, ^some, %{content: 7}}

    Topic.unsubscribe(some)
    members(:topic_poses, 1)
    assert Topic.next(some, 0) == :none
  end

  test "urgent news goes first; junk in the group is counted" do
    {:ok, sub} = Topic.subscribe(:topic_urgent)
    members(:topic_urgent, 1)
    for n <- 1..3, do: Topic.publish(:topic_urgent, :mag1, n)
    Topic.publish(:topic_urgent, :mag1, :stop, class: :urgent)
    for junk <- [:junk, %{__struct__: Envelope}, {:more, 1}], do: send(sub, junk)
    GenServer.cast(sub, :junk)
    send(sub, {:"$gen_call", {self(), make_ref()}, :junk})
    # Only its owner may ask.
    Task.await(Task.async(fn -> Topic.more(sub) end))
    assert %{rejected: 3, waiting: 4} = Topic.counts(sub)
    assert {:ok, %{content: :stop}} = Topic.next(sub, 1_000)
    assert {:ok, %{content: 1}} = Topic.next(sub, 1_000)
  end

  test "a subscription ends with its owner, and joins a restarted directory" do
    parent = self()

    owner =
      spawn(fn ->
        {:ok, sub} = Topic.subscribe(:topic_owner)
        send(parent, {:sub, sub})
        receive do: (:end -> :ok)
      end)

    assert_receive {:sub, sub}
    monitor = Process.monitor(sub)
    members(:topic_owner, 1)
    Process.exit(Process.whereis(Directory), :kill)
    members(:topic_owner, 1)
    send(owner, :end)
    assert_receive {:DOWN, ^monitor, _, _, :normal}
  end

  test "a robot's program hears topics" do
    options = [service: :topic_ear, module: Answerers.Echo, topics: [:topic_ears]]
    start_supervised!({Responder, {:topic_robot, options}})
    members(:topic_ears, 1)
    eventually(fn -> Directory.members({:service, :topic_ear, :topic_robot}) != [] end)
    assert Topic.publish(:topic_ears, :mag1, {:tell, self()}) == 1
    assert_receive {:told, :topic_robot, %Envelope{topic: :topic_ears, from: :mag1}}

    assert {:ok, _} =
             Conversation.request({:topic_robot, :topic_ear}, Envelope.new(:query, :me, 1))
  end

  test "wrong options are an error of one line" do
    for {topic, options} <- [
          {nil, []},
          {"", []},
          {5, []},
          {:t, [limit: 0]},
          {:t, [limit: :x]},
          {:t, [template: [speed: 1]]},
          {:t, [size: 1]},
          {:t, :x}
        ] do
      assert {:error, line} = Topic.subscribe(topic, options)
      refute line =~ "\n"
    end

    assert_raise ArgumentError, fn -> Topic.publish("", :mag1, 1) end
    assert_raise ArgumentError, fn -> Topic.publish(:t, "mag1", 1) end
  end

  @tag :cluster
  test "news crosses nodes, and nobody waits for a node that is gone" do
    [node, dead] = Cluster.start_nodes(2)
    {:ok, sub} = Topic.subscribe("topic nodes")

    eventually(fn -> :erpc.call(node, Topic, :publish, ["topic nodes", :far, :hello]) == 1 end)
    assert {:ok, %{from: :far, content: :hello}} = Topic.next(sub, 5_000)

    for n <- [node, dead] do
      :erpc.call(n, Answerers, :start_topic, ["topic nodes"])
    end

    members("topic nodes", 3)
    Cluster.freeze(dead)
    assert Topic.publish("topic nodes", :near, {:tell, self()}) == 3
    assert_receive {:told, :topic_far, %{from: :near}}
  end
end
