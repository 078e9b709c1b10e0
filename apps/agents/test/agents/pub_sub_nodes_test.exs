defmodule Agents.PubSubNodesTest do
  @moduledoc "A bus on `Phoenix.PubSub` on real nodes of a fleet."
  use ExUnit.Case, async: true
  import Swarm.Case, only: [eventually: 1]
  alias Agents.FarBus
  alias Swarm.MeshNodes
  @moduletag :realtime
  @moduletag adapter: :phoenix_pubsub

  unless Code.ensure_loaded?(Phoenix.PubSub),
    do: @moduletag(skip: "phoenix_pubsub is not installed")

  @bus {Agents.PubSub.Phoenix, Hall.Events}

  setup_all do
    [one, two] = nodes = MeshNodes.start(2, robots: true)

    for node <- nodes do
      :ok = Vm.start_apps(node.vm, [:agents])
      :ok = MeshNodes.call(node, FarBus, :start, [@bus])
    end

    true = eventually(fn -> two.node in MeshNodes.call(one, Node, :list, []) end)
    %{one: one, two: two}
  end

  test "ours stays on its node, Phoenix's own crosses", %{one: one, two: two} do
    [near, far] =
      for node <- [one, two], do: MeshNodes.call(node, FarBus, :listen, [@bus, "poses"])

    assert MeshNodes.call(one, Agents.PubSub, :broadcast, [@bus, "poses", :near]) == :ok

    assert eventually(fn ->
             :ok = MeshNodes.call(one, Phoenix.PubSub, :broadcast, [Hall.Events, "poses", :all])
             :all in MeshNodes.call(two, FarBus, :heard, [far])
           end)

    refute :near in MeshNodes.call(two, FarBus, :heard, [far])
    assert [:near, :all | _] = MeshNodes.call(one, FarBus, :heard, [near])
  end

  test "a process hears of all robots of a running fleet", %{one: one, two: two} do
    far = MeshNodes.call(two, FarBus, :listen, [@bus, "fleet"])
    :ok = MeshNodes.call(one, FarBus, :feed, [Hall.Events])
    ids = Enum.sort([one.name, two.name])

    assert eventually(fn ->
             Enum.any?(MeshNodes.call(two, FarBus, :heard, [far]), fn {:fleet, robots} ->
               Enum.sort(Enum.map(robots, & &1.robot)) == ids
             end)
           end)
  end
end
