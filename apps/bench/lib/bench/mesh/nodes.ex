defmodule Bench.Mesh.Nodes do
  @moduledoc false
  # Starts the nodes to measure, each a `Vm` of its own: this process is not part of the measurement.
  alias Bench.Mesh.{Bare, Convoy, Watch}
  alias Mesh.Secret

  @enforce_keys [:name, :node, :vm, :began_ns]
  defstruct @enforce_keys

  @typedoc "`began_ns` is when its start was requested."
  @type t :: %__MODULE__{}
  @typedoc "What the nodes of one fleet have in common; `kind` says whose code runs there."
  @type fleet :: %{
          kind: :ours | :bare,
          mesh: keyword() | false,
          prefix: String.t(),
          flags: list()
        }

  @host "127.0.0.1"
  @boot_ms 60_000

  @doc "A fleet with `count` names and a base; nothing is started yet."
  @spec fleet(:ours | :bare, pos_integer()) :: fleet()
  def fleet(kind, count) do
    {_, 0} = System.cmd("epmd", ["-daemon"], env: [{"ERL_EPMD_ADDRESS", @host}])
    prefix = "b#{:rand.uniform(999_999_999)}"
    mesh = if kind == :ours, do: mesh(prefix, count), else: false
    %{kind: kind, mesh: mesh, prefix: prefix, flags: flags(kind)}
  end

  # Otherwise a freeze is noticed only after more than a minute.
  defp flags(:bare), do: ~w(-kernel net_ticktime 4 -kernel logger_level none)
  defp flags(:ours), do: []

  @doc "The name of the n-th node, and of its robot; 0 is the base."
  @spec name(fleet(), non_neg_integer()) :: atom()
  def name(fleet, n), do: :"#{fleet.prefix}_#{n}"

  defp mesh(prefix, count) do
    secret = %Secret{
      path: "",
      key: :crypto.strong_rand_bytes(32),
      cookie: :"#{Base.encode32(:crypto.strong_rand_bytes(20), padding: false)}",
      fingerprint: ""
    }

    [
      secret: secret,
      fleet: for(n <- 0..(count + 1), do: :"#{prefix}_#{n}"),
      interface: {127, 0, 0, 1},
      port: 0,
      # The base is one node more.
      full_mesh: max(count + 1, 2),
      multicast: {{239, 255, 67, 86}, 20_000 + :rand.uniform(20_000)}
    ]
  end

  @doc "Starts a node with these robots. It is up when this returns."
  @spec start(fleet(), non_neg_integer(), [atom()], schedulers :: pos_integer()) :: t()
  def start(fleet, n, robots, schedulers \\ 1),
    do: hd(start_all(fleet, [{n, robots}], schedulers))

  @doc "Starts several at once."
  @spec start_all(fleet(), [{non_neg_integer(), [atom()]}], schedulers :: pos_integer()) :: [t()]
  def start_all(fleet, nodes, schedulers \\ 1) do
    began_ns = Watch.now_ns()
    flags = Vm.fleet_flags() ++ ["+S", "#{schedulers}:#{schedulers}"] ++ fleet.flags
    same = [host: @host, longnames: true, flags: flags]
    code = if fleet.kind == :ours, do: Convoy, else: Bare

    nodes
    |> Enum.zip(Vm.start(for({n, _robots} <- nodes, do: [name: name(fleet, n)] ++ same)))
    |> Enum.map(fn {{n, robots}, vm} ->
      Task.async(fn ->
        :ok = Vm.call(vm, code, :main, [fleet.mesh, robots], @boot_ms)
        %__MODULE__{name: name(fleet, n), node: vm.node, vm: vm, began_ns: began_ns}
      end)
    end)
    |> Task.await_many(@boot_ms)
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

  @doc "Its memory, the resident set, in bytes."
  @spec memory(t()) :: pos_integer() | nil
  def memory(node) do
    with {:ok, text} <- File.read("/proc/#{node.vm.pid}/status"),
         [_line, kilobytes] <- Regex.run(~r/VmRSS:\s+(\d+)/, text),
         do: 1024 * String.to_integer(kilobytes),
         else: (_unknown -> nil)
  end

  @doc "Ends nodes, even frozen ones."
  @spec stop([t()]) :: :ok
  def stop(nodes), do: Vm.stop(Enum.map(nodes, & &1.vm))
end
