defmodule Swarm.MeshNodes do
  @moduledoc """
  Real nodes (`Vm.Fleet`): whatever happens to their network the test still reaches them. They end with
  the process that starts them, a test or a module's `setup_all`. Names and ports are new for each fleet: the tests
  of several checkouts may run at once.

      nodes = Swarm.MeshNodes.start(3)
      Swarm.MeshNodes.call(hd(nodes), Mesh, :view, [])
      Swarm.MeshNodes.signal(hd(nodes), "KILL")

  `start/2` takes `mesh: false` for nodes without a mesh, mesh options under `mesh: [...]`, further
  arguments of the VM under `args:`, `robots: true` for a robot with fake wheels on each node, of the node's name,
  `one_by_one: true` for nodes that join the fleet in their order, not all at once, `host: "127.0.0.1"` for long names
  with that part.
  """
  alias Mesh.Secret
  alias Vm.Fleet

  @enforce_keys [:fleet, :vm, :node, :name]
  defstruct @enforce_keys

  @type t :: %__MODULE__{fleet: Fleet.t(), vm: Vm.t(), node: node(), name: atom()}

  @doc "Starts nodes."
  @spec start(pos_integer(), keyword()) :: [t()]
  def start(count, options \\ []) do
    run = run()
    names = for n <- 1..count, do: :"t#{run}_#{n}"
    mesh = mesh(names, run, Keyword.get(options, :mesh, []))
    fleet = Fleet.new()

    if options[:one_by_one],
      do: Enum.flat_map(names, &boot(fleet, [&1], mesh, options)),
      else: boot(fleet, names, mesh, options)
  end

  @doc "One more node of the same fleet, or one that was killed, again."
  @spec join([t()], atom(), keyword()) :: t()
  def join([one | _], name, options \\ []) do
    mesh = call(one, Application, :get_env, [:swarm, :mesh])
    hd(boot(one.fleet, [name], mesh, options))
  end

  @doc "Calls a function there, over standard input and output."
  @spec call(t(), module(), atom(), list(), timeout()) :: term()
  def call(node, m, f, a, timeout \\ 10_000), do: Vm.call(node.vm, m, f, a, timeout)

  @doc "Sends a signal to its process of the operating system: KILL, STOP, CONT."
  @spec signal(t(), String.t()) :: :ok
  def signal(node, signal), do: Vm.signal(node.vm, signal)

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

  defp boot(fleet, names, mesh, options) do
    flags = Vm.fleet_flags() ++ Keyword.get(options, :args, [])
    place = if host = options[:host], do: [host: host, longnames: true], else: []
    missions = Application.get_env(:swarm, :missions, [])
    config = [logger: [level: :none], swarm: [mesh: mesh, missions: missions]]

    main = fn vm, name ->
      :ok = Vm.start_apps(vm, [:logger, :swarm], config)
      if options[:robots], do: :ok = Vm.call(vm, Swarm.MeshNodes.Wheels, :robot, [name])
    end

    nodes =
      for name <- names,
          do: %{name: name, vm: [name: name, flags: flags] ++ place, main: &main.(&1, name)}

    Fleet.start(fleet, nodes)
    Fleet.await(fleet, names)

    for name <- names,
        vm = Fleet.vm(fleet, name),
        do: %__MODULE__{fleet: fleet, vm: vm, node: vm.node, name: name}
  end
end
