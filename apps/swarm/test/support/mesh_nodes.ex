defmodule Swarm.MeshNodes do
  @moduledoc """
  Real nodes, each a VM of its own, controlled over standard input and output, so that whatever
  happens to their network the test still reaches them. Names and ports are new for each test: the tests of
  several checkouts may run at once.

      nodes = Swarm.MeshNodes.start(3)
      Swarm.MeshNodes.call(hd(nodes), Mesh, :view, [])
      Swarm.MeshNodes.signal(hd(nodes), "KILL")

  `start/2` takes `mesh: false` for nodes without a mesh, mesh options under `mesh: [...]`, further
  arguments of the VM under `args:`, `robots: true` for a robot with fake wheels on each node, of the node's name,
  `one_by_one: true` for nodes that join the fleet in their order, not all at once.
  """
  import ExUnit.Callbacks, only: [on_exit: 1]
  alias Mesh.Secret

  @enforce_keys [:peer, :node, :name, :pid]
  defstruct @enforce_keys

  @type t :: %__MODULE__{peer: pid(), node: node(), name: atom(), pid: String.t()}

  @flags ~w(-kernel prevent_overlapping_partitions false -kernel connect_all false
            -kernel dist_auto_connect never -kernel inet_dist_use_interface {127,0,0,1}
            +S 1:1 +SDio 1 +sbwt none +sbwtdcpu none +sbwtdio none)

  @doc "Starts nodes; they end with the test."
  @spec start(pos_integer(), keyword()) :: [t()]
  def start(count, options \\ []) do
    {_, 0} = System.cmd("epmd", ["-daemon"])
    run = run()
    names = for n <- 1..count, do: :"t#{run}_#{n}"
    mesh = mesh(names, run, Keyword.get(options, :mesh, []))

    names
    |> Enum.map(&Task.async(fn -> boot(&1, options) end))
    |> Enum.map(&(&1 |> Task.await(20_000) |> end_with_test()))
    |> join_all(mesh, options)
  end

  defp join_all(nodes, mesh, options) do
    if options[:one_by_one],
      do: Enum.map(nodes, &prepare(&1, mesh, options)),
      else:
        Task.await_many(
          for(n <- nodes, do: Task.async(fn -> prepare(n, mesh, options) end)),
          30_000
        )
  end

  @doc "One more node of the same fleet, or one that was killed, again."
  @spec join([t()], atom(), keyword()) :: t()
  def join([one | _], name, options \\ []) do
    mesh = call(one, Application, :get_env, [:swarm, :mesh])
    name |> boot(options) |> end_with_test() |> prepare(mesh, options)
  end

  @doc "Calls a function there, over standard input and output."
  @spec call(t(), module(), atom(), list(), timeout()) :: term()
  def call(node, m, f, a, timeout \\ 10_000), do: :peer.call(node.peer, m, f, a, timeout)

  @doc "Sends a signal to its process of the operating system: KILL, STOP, CONT."
  @spec signal(t(), String.t()) :: :ok
  def signal(%{pid: pid}, signal) do
    {_, 0} = System.cmd("kill", ["-#{signal}", pid])
    :ok
  end

  # Half a million runs an hour apart share no name.
  defp run,
    do: rem(System.unique_integer([:positive]) + :rand.uniform(1_000_000_000), 1_000_000_000)

  defp mesh(_names, _run, false), do: false

  defp mesh(names, run, options) do
    secret = %Secret{
      path: "",
      key: :crypto.hash(:sha256, "#{run}"),
      cookie: :"c#{run}",
      fingerprint: ""
    }

    fleet = names ++ for n <- 90..99, do: :"t#{run}_#{n}"
    group = {{239, 255, 67, 86}, 20_000 + rem(run, 40_000)}

    [secret: secret, fleet: fleet, interface: {127, 0, 0, 1}, port: 0, multicast: group]
    |> Keyword.merge(options)
  end

  defp boot(name, options) do
    args = Enum.map(@flags ++ Keyword.get(options, :args, []), &String.to_charlist/1)

    {:ok, peer, node} =
      :peer.start(%{name: name, connection: :standard_io, args: args, wait_boot: 20_000})

    %__MODULE__{peer: peer, node: node, name: name, pid: ""}
  end

  defp end_with_test(node) do
    node = %{node | pid: "#{call(node, :os, :getpid, [])}"}
    on_exit(fn -> stop(node) end)
    node
  end

  defp prepare(node, mesh, options) do
    call(node, :code, :add_paths, [:code.get_path()])
    {:ok, _} = call(node, Application, :ensure_all_started, [:logger])
    call(node, Logger, :configure, [[level: :none]])
    call(node, Application, :put_env, [:swarm, :mesh, mesh])
    missions = Application.get_env(:swarm, :missions, [])
    call(node, Application, :put_env, [:swarm, :missions, missions])
    {:ok, _} = call(node, Application, :ensure_all_started, [:swarm])
    if options[:robots], do: :ok = call(node, Swarm.MeshNodes.Wheels, :robot, [node.name])
    node
  end

  # A frozen node does not hear that it shall end.
  defp stop(node) do
    _ = System.cmd("kill", ["-KILL", node.pid], stderr_to_stdout: true)
    if Process.alive?(node.peer), do: Process.exit(node.peer, :kill)
  end
end
