defmodule Lab.Fleet.Nodes do
  @moduledoc """
  Runs world and robots, each in a process of the operating system of its own (`Lab.Node`), on loopback; this one, the
  launcher, starts them and listens to them.

  A robot whose process ends, for any reason, is dead. One that sends nothing, perhaps because
  it is frozen, is `:silent` until it sends again. When the world's process ends, it is started
  again from its last snapshot, and the robots, which stood meanwhile, go on;
  when it ends for the sixth time, so does the run.
  """
  @behaviour Lab.Fleet.Backend
  alias Lab.Node.Network
  alias Lab.VirtualRobot.Hardware
  alias Lab.Fleet.Nodes.{Command, Host}
  alias Sim.World
  alias Sim.World.Snapshot
  alias Lab.Node.Reporter
  alias Vm.Fleet

  # On a busy machine a start takes several seconds.
  @up_ms 20_000
  @silent_ms 1_000
  @world_starts 5

  @enforce_keys [:setup, :host, :nodes, :name, :world]
  defstruct @enforce_keys ++ [dead: [], server: nil, reports: %{}, world_starts: 0]

  @typedoc "`dead` are robots; `server` is that of the world; `reports` hold claim, counts, and the time of arrival."
  @type t :: %__MODULE__{}

  @impl Lab.Fleet.Backend
  def start(setup, _options) do
    ids = [:world | setup.options.robots]

    with {:ok, host} <- Host.start(setup.options.robots, [:world]) do
      name = {:world, System.pid(), System.unique_integer()}
      nodes = Fleet.new(tell: self())
      own = [setup: setup, host: host, nodes: nodes, name: name, world: setup.world]
      backend = struct!(__MODULE__, own)
      Fleet.start(nodes, Enum.map(ids, &about(backend, &1)))

      with line when line != nil <- Enum.find_value(ids, &fallen(backend, &1)) do
        stop(backend)
        {:error, line}
      else
        nil -> {:ok, %{backend | server: Fleet.await(nodes).world}}
      end
    end
  end

  defp fallen(backend, id) do
    case Fleet.outcome(backend.nodes, id) do
      {:ok, _facts} ->
        nil

      {:error, {:timeout, _call}} ->
        late(backend, id)

      {:error, {:no_vm, _reason}} ->
        "#{node_name(backend, id)} cannot start: is there a node of this name already?"

      {:error, reason} ->
        why = inspect(reason, limit: 10, printable_limit: 100)
        "#{node_name(backend, id)} ended at its start: #{why}"
    end
  end

  defp late(backend, id),
    do: "#{node_name(backend, id)} did not come up within #{div(@up_ms, 1000)} s"

  @impl Lab.Fleet.Backend
  def begin(backend) do
    # One that cannot arm says why in its status.
    for id <- living(backend),
        vm = Fleet.vm(backend.nodes, id),
        do: Vm.cast(vm, Lab.VirtualRobot, :begin, [id])

    :ok
  end

  @impl Lab.Fleet.Backend
  def living(backend), do: backend.setup.options.robots -- backend.dead

  @impl Lab.Fleet.Backend
  def claims(backend) do
    now = Hal.Clock.now_ms()

    for id <- living(backend) do
      case backend.reports[id] do
        {claim, _counts, at_ms} when now - at_ms <= @silent_ms -> {id, claim}
        _old_or_none -> {id, %{phase: :silent}}
      end
    end
  end

  @impl Lab.Fleet.Backend
  def kill(backend, id) do
    Fleet.kill(backend.nodes, id)
    wreck(backend, id)
  end

  # Also to our own copy, from which a server that is down or about to crash starts again.
  @impl Lab.Fleet.Backend
  def change(backend, change) do
    if pid = backend.server, do: World.Server.change(pid, change)
    %{backend | world: World.Server.changed(backend.world, change)}
  end

  @impl Lab.Fleet.Backend
  def world(backend), do: backend.world

  @impl Lab.Fleet.Backend
  def messages(backend) do
    for {_id, {_claim, counts, _at_ms}} <- backend.reports, reduce: %{sent: 0, lost: 0} do
      all -> Map.merge(all, counts, fn _key, a, b -> a + b end)
    end
  end

  @impl Lab.Fleet.Backend
  def lines(backend) do
    for id <- backend.setup.options.robots ++ [:world] do
      vm = if id in backend.dead, do: nil, else: Fleet.vm(backend.nodes, id)
      {id, node_name(backend, id), vm && vm.pid}
    end
    |> Command.lines(backend.host.home)
    |> Kernel.++(Hardware.lines(backend.setup.robots, backend.host.home))
  end

  @impl Lab.Fleet.Backend
  def hear(backend, {Reporter, :world, {:report, snapshot}}),
    do: {:ok, [], %{backend | world: Snapshot.onto(backend.setup.world, snapshot)}}

  def hear(backend, {Reporter, id, {:report, {claim, counts}}}),
    do: {:ok, [], put_in(backend.reports[id], {claim, counts, Hal.Clock.now_ms()})}

  def hear(backend, {Reporter, id, {:stage, %{robot: id, stage: stage} = about}}) do
    {:ok, [{:stage, stage, id, Map.drop(about, [:robot, :stage])}], begun(backend, id, stage)}
  end

  def hear(%{world_starts: starts} = backend, {Fleet, :world, {:up, _vm, server}, _us})
      when starts > 0,
      do: {:ok, [{:stage, :world_back, nil, %{}}], %{backend | server: server}}

  # None while the world is started again.
  def hear(backend, {Fleet, :world, {:down, words, _life}, _us}),
    do: world_again(%{backend | server: nil}, words)

  def hear(backend, {Fleet, id, {:down, _words, _life}, _us}) do
    if id in backend.dead,
      do: {:ok, [], backend},
      else: {:ok, [{:killed, id}], wreck(backend, id)}
  end

  def hear(%{world_starts: start, server: nil} = backend, {:late, start}) do
    Fleet.kill(backend.nodes, :world)
    {:ended, late(backend, :world), backend}
  end

  def hear(backend, _other), do: {:ok, [], backend}

  @impl Lab.Fleet.Backend
  def stop(backend) do
    Fleet.stop(backend.nodes)
    Host.stop(backend.host)
  end

  # Its next report will say so; until then the run log must not consider the search finished.
  defp begun(backend, id, :search) do
    {claim, counts, _at_ms} = Map.get(backend.reports, id, {%{}, %{}, 0})
    put_in(backend.reports[id], {Map.put(claim, :phase, :search), counts, Hal.Clock.now_ms()})
  end

  defp begun(backend, _id, _stage), do: backend

  defp wreck(backend, id),
    do: change(%{backend | dead: [id | backend.dead]}, {:kill, id})

  defp world_again(%{world_starts: @world_starts} = backend, words) do
    times = "has ended #{@world_starts + 1} times, last: #{words}"
    {:ended, "#{node_name(backend, :world)} #{times}", backend}
  end

  defp world_again(backend, _words) do
    backend = %{backend | world_starts: backend.world_starts + 1}
    Fleet.revive(backend.nodes, :world, about(backend, :world).main)
    Process.send_after(self(), {:late, backend.world_starts}, @up_ms)
    {:ok, [{:stage, :world_lost, nil, %{}}], backend}
  end

  defp node_name(backend, id), do: Network.node_name(backend.host.network, id)

  defp about(%{host: %{network: network, home: home}} = backend, id) do
    swarm = [
      mesh: Host.mesh(network, id),
      formations: Application.get_env(:swarm, :formations, [])
    ]

    arguments = [part(backend, id), [logger: [level: :error], swarm: swarm], [to: {self(), id}]]
    options = Network.vm(network, id) ++ [env: [{"HOME", home}]]
    # By its name: here no robot's module is called.
    %{name: id, vm: options, main: &Vm.call(&1, Lab.Node, :main, arguments, @up_ms)}
  end

  defp part(backend, :world), do: {Lab.Node.World, %{name: backend.name, world: backend.world}}

  defp part(%{setup: %{options: options} = setup} = backend, id) do
    index = Enum.find_index(setup.robots, &(&1.id == id))

    {Lab.Node.Robot,
     %{
       robot: Enum.at(setup.robots, index),
       world: backend.name,
       blobs: options.blobs,
       marks: Lab.Trial.Setup.looked_for(options),
       mission: setup.mission,
       plan: setup.plan,
       folder: backend.host.home,
       radio: %{options | seed: options.seed + index}
     }}
  end
end
