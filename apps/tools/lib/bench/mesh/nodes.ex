defmodule Bench.Mesh.Nodes do
  @moduledoc false
  # Starts the nodes to measure (`Vm.Fleet`): this process is not part of the measurement.
  alias Bench.Mesh.{Bare, Convoy, Watch}
  alias Lab.Node.Network
  alias Vm.Fleet

  @enforce_keys [:name, :node, :vm, :began_ns]
  defstruct @enforce_keys

  @typedoc "`began_ns` is when its start was requested."
  @type t :: %__MODULE__{}
  @typedoc "What the nodes of one fleet have in common; `kind` says whose code runs there."
  @type fleet :: %{
          kind: :ours | :bare,
          names: tuple(),
          network: Network.t(),
          nodes: Fleet.t()
        }

  @boot_ms 60_000

  @doc "A fleet with `count` names, a base and a newcomer; nothing is started yet."
  @spec fleet(:ours | :bare, pos_integer()) :: fleet()
  def fleet(kind, count) do
    {_, 0} = System.cmd("epmd", ["-daemon"], env: [{"ERL_EPMD_ADDRESS", "127.0.0.1"}])
    prefix = "b#{:rand.uniform(999_999_999)}"
    names = for n <- 0..(count + 1), do: :"#{prefix}_#{n}"
    {:ok, network} = Network.create(:group, names)
    %{kind: kind, names: List.to_tuple(names), network: network, nodes: Fleet.new()}
  end

  @doc "The name of the n-th node, and of its robot; 0 is the base."
  @spec name(fleet(), non_neg_integer()) :: atom()
  def name(fleet, n), do: elem(fleet.names, n)

  @doc "Starts a node with these robots, or starts it again. It is up when this returns."
  @spec start(fleet(), non_neg_integer(), [atom()], schedulers :: pos_integer()) :: t()
  def start(fleet, n, robots, schedulers \\ 1),
    do: hd(start_all(fleet, [{n, robots}], schedulers))

  @doc "Starts several at once."
  @spec start_all(fleet(), [{non_neg_integer(), [atom()]}], schedulers :: pos_integer()) :: [t()]
  def start_all(fleet, nodes, schedulers \\ 1) do
    began_ns = Watch.now_ns()
    abouts = for {n, robots} <- nodes, do: about(fleet, name(fleet, n), robots, schedulers)
    Fleet.start(fleet.nodes, abouts)
    names = for %{name: name} <- abouts, do: name
    Fleet.await(fleet.nodes, names)

    for name <- names,
        vm = Fleet.vm(fleet.nodes, name),
        do: %__MODULE__{name: name, node: vm.node, vm: vm, began_ns: began_ns}
  end

  defp about(%{kind: kind, network: network} = fleet, name, robots, schedulers) do
    # Otherwise a freeze is noticed only after more than a minute.
    flags = if kind == :bare, do: ~w(-kernel net_ticktime 4 -kernel logger_level none), else: []
    options = Network.vm(network, name, ["+S", "#{schedulers}:#{schedulers}"] ++ flags)
    code = if kind == :ours, do: Convoy, else: Bare
    # The newcomer has no node.
    full_mesh = [full_mesh: max(tuple_size(fleet.names) - 1, 2)]
    mesh = if kind == :ours, do: Network.mesh(network, name) ++ full_mesh, else: false
    %{name: name, vm: options, main: &Vm.call(&1, code, :main, [mesh, robots], @boot_ms)}
  end

  @doc "Calls a function there."
  @spec call(t(), module(), atom(), list(), timeout()) :: term()
  def call(node, m, f, a, timeout \\ 300_000), do: Vm.call(node.vm, m, f, a, timeout)

  @doc "Sends a signal to its process (KILL, STOP, CONT); returns when that was."
  @spec signal(t(), String.t()) :: at_ns :: integer()
  def signal(node, signal) do
    at_ns = Watch.now_ns()
    :ok = Vm.signal(node.vm, signal)
    at_ns
  end

  @doc "Ends all nodes, even frozen ones."
  @spec stop(fleet()) :: :ok
  def stop(fleet), do: Fleet.stop(fleet.nodes)
end
