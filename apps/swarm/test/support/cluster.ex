defmodule Swarm.Cluster do
  @moduledoc """
  Further nodes for tests (`Vm.Fleet`), with the application `:swarm` running on each.

      @tag :cluster
      test "…" do
        [north, south] = Swarm.Cluster.start_nodes(2)
        :erpc.call(north, Swarm, :status, [])

  Nodes connect only when told to (`connect/1`), as robots do: `-connect_all false`, and no overlapping
  partitions are prevented. A node ends with the test that started it, or when it is killed.
  """
  import ExUnit.Callbacks, only: [on_exit: 1]
  alias Vm.Fleet

  # Cheap starts on a machine with few processors.
  @flags ~w(-kernel prevent_overlapping_partitions false -kernel connect_all false +S 1 +sbwt none)

  @doc """
  Starts nodes, connected to this one and to each other. Options: `:connect` (`false`: to this one
  only), `:apps` (default `[:swarm]`), `:env` (`[swarm: [mesh: false]]`, set before the start),
  `:flags` (more arguments of the VM, as text).
  """
  @spec start_nodes(pos_integer(), keyword()) :: [node()]
  def start_nodes(count, options \\ []) do
    options = Keyword.validate!(options, connect: true, apps: [:swarm], env: [], flags: [])
    be_a_node()

    flags = @flags ++ options[:flags] ++ ["-setcookie", Atom.to_string(Node.get_cookie())]
    config = Keyword.merge([logger: [level: :critical]], options[:env])
    main = &Vm.start_apps(&1, options[:apps], config)
    names = for _ <- 1..count, do: :"c#{System.pid()}_#{System.unique_integer([:positive])}"
    fleet = Fleet.new()

    Fleet.start(
      fleet,
      for(name <- names, do: %{name: name, vm: [name: name, flags: flags], main: main})
    )

    Fleet.await(fleet)
    vms = for name <- names, do: Fleet.vm(fleet, name)
    on_exit(fn -> Vm.stop(vms) end)

    nodes =
      for {name, vm} <- Enum.zip(names, vms) do
        true = Node.connect(vm.node)
        :persistent_term.put({__MODULE__, vm.node}, {fleet, name})
        vm.node
      end

    if options[:connect], do: connect(nodes)
    nodes
  end

  @doc "Connects all of these nodes to each other."
  @spec connect([node()]) :: :ok
  def connect(nodes) do
    for a <- nodes, b <- nodes, a < b, do: true = :erpc.call(a, Node, :connect, [b])
    :ok
  end

  @doc "Ends a node as `kill -9` does, and waits until this node knows."
  @spec kill(node()) :: :ok
  def kill(node) do
    :ok = tell(node, :kill)
    await_down(node)
  end

  @doc "Freezes a node: it is there, and silent. `thaw/1` lets it go on."
  @spec freeze(node()) :: :ok
  def freeze(node), do: tell(node, :freeze)

  @doc "Lets a frozen node go on."
  @spec thaw(node()) :: :ok
  def thaw(node), do: tell(node, :thaw)

  defp tell(node, what),
    do: apply(Fleet, what, Tuple.to_list(:persistent_term.get({__MODULE__, node})))

  defp await_down(node) do
    Node.monitor(node, true)

    receive do
      {:nodedown, ^node} -> :ok
    after
      10_000 -> raise "#{node} is still there"
    end
  end

  # The node of the tests has a name only when a test needs it.
  defp be_a_node do
    unless Node.alive?() do
      {_text, 0} = System.cmd("epmd", ["-daemon"])
      {:ok, _} = Node.start(:"tests_#{System.pid()}", :shortnames)
      Node.set_cookie(:"#{Base.encode16(:crypto.strong_rand_bytes(16))}")
    end
  end
end
