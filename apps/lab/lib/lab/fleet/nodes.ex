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
  alias Lab.Fleet.Nodes
  alias Lab.Fleet.Hardware
  alias Lab.Fleet.Nodes.{Child, Command, Host}
  alias Sim.World
  alias Sim.World.Snapshot
  alias Lab.Node.Reporter

  # On a busy machine a start takes several seconds.
  @up_ms 20_000
  @silent_ms 1_000
  @world_starts 5

  @enforce_keys [:setup, :host, :name, :world]
  defstruct @enforce_keys ++ [children: %{}, reports: %{}, world_starts: 0]

  @typedoc """
  `children` by robot id and `:world`; `reports` hold claim, counts, and the time of arrival.
  """
  @type t :: %__MODULE__{}

  @impl Lab.Fleet.Backend
  def start(setup, _options) do
    ids = [:world | setup.options.robots]

    with {:ok, host} <- Host.start(setup.options.robots, Enum.map(ids, &node_name/1)) do
      name = {:world, System.pid(), System.unique_integer()}
      backend = %__MODULE__{setup: setup, host: host, name: name, world: setup.world}

      with {:ok, backend} <- launch(backend, ids), {:ok, backend} <- await_all(backend, ids) do
        {:ok, backend}
      else
        {:error, line, backend} ->
          stop(backend)
          {:error, line}
      end
    end
  end

  defp launch(backend, ids) do
    Enum.reduce_while(ids, {:ok, backend}, fn id, {:ok, backend} ->
      case Child.start(config(backend, id), backend.host.home) do
        {:ok, child} -> {:cont, {:ok, put_in(backend.children[id], child)}}
        {:error, line} -> {:halt, {:error, line, backend}}
      end
    end)
  end

  # As long as nodes come up one after the other, the machine is only slow.
  defp await_all(backend, ids, deadline \\ Hal.Clock.now_ms() + @up_ms) do
    case Enum.filter(ids, &(backend.children[&1].up == nil)) do
      [] ->
        {:ok, backend}

      missing ->
        receive do
          {Reporter, _pid, {:up, _facts}} = message ->
            backend |> told(message) |> await_all(missing)

          {Reporter, _pid, _what} = message ->
            backend |> told(message) |> await_all(missing, deadline)

          {port, {:data, _text}} = message when is_port(port) ->
            backend |> told(message) |> await_all(missing, deadline)

          {port, {:exit_status, _status}} when is_port(port) ->
            {:error, fallen(backend, port), backend}
        after
          max(deadline - Hal.Clock.now_ms(), 0) -> {:error, late(backend, hd(missing)), backend}
        end
    end
  end

  defp told(backend, message) do
    {:ok, _events, backend} = hear(backend, message)
    backend
  end

  defp fallen(backend, port) do
    {_id, child} = Enum.find(backend.children, fn {_id, child} -> child.port == port end)
    "#{child.node} ended at its start: #{Child.last_line(child)}"
  end

  defp late(backend, id) do
    child = backend.children[id]
    "#{child.node} did not come up within #{div(@up_ms, 1000)} s: #{Child.last_line(child)}"
  end

  @impl Lab.Fleet.Backend
  def begin(backend) do
    for id <- living(backend), do: send(backend.children[id].up.main, :begin)
    :ok
  end

  @impl Lab.Fleet.Backend
  def living(backend),
    do: Enum.filter(backend.setup.options.robots, &is_map_key(backend.children, &1))

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
    {child, children} = Map.pop!(backend.children, id)
    Child.kill(child)
    change(%{backend | children: children}, {:kill, id})
  end

  # Also to our own copy, from which a server that is down or about to crash starts again.
  @impl Lab.Fleet.Backend
  def change(backend, change) do
    if pid = server(backend), do: World.Server.change(pid, change)
    %{backend | world: World.Server.changed(backend.world, change)}
  end

  @impl Lab.Fleet.Backend
  def world(backend), do: backend.world

  # None while the world is started again.
  defp server(%{children: %{world: %{up: %{server: server}}}}), do: server
  defp server(_down), do: nil

  @impl Lab.Fleet.Backend
  def messages(backend) do
    for {_id, {_claim, counts, _at_ms}} <- backend.reports, reduce: %{sent: 0, lost: 0} do
      all -> Map.merge(all, counts, fn _key, a, b -> a + b end)
    end
  end

  @impl Lab.Fleet.Backend
  def lines(backend) do
    for id <- backend.setup.options.robots ++ [:world] do
      child = backend.children[id]
      {id, node_name(id), child && child.pid}
    end
    |> Command.lines(backend.host.home)
    |> Kernel.++(Hardware.lines(backend.setup.robots, backend.host.home))
  end

  @impl Lab.Fleet.Backend
  def hear(backend, {Reporter, pid, what}) do
    case Enum.find(backend.children, fn {_id, child} -> child.pid == pid end) do
      {id, _child} -> heard(backend, id, what)
      nil -> {:ok, [], backend}
    end
  end

  def hear(backend, {port, {:data, text}}) when is_port(port),
    do:
      {:ok, [],
       with_child(backend, port, fn backend, id ->
         update_in(backend.children[id], &Child.said(&1, text))
       end)}

  def hear(backend, {port, {:exit_status, _status}}) when is_port(port) do
    case Enum.find(backend.children, fn {_id, child} -> child.port == port end) do
      {:world, child} -> world_again(backend, child)
      {id, _child} -> {:ok, [{:killed, id}], wreck(backend, id)}
      nil -> {:ok, [], backend}
    end
  end

  def hear(backend, {:late, :world, pid}) do
    case backend.children[:world] do
      %{pid: ^pid, up: nil} = child ->
        Child.kill(child)
        ended(backend, late(backend, :world))

      _up ->
        {:ok, [], backend}
    end
  end

  def hear(backend, _other), do: {:ok, [], backend}

  @impl Lab.Fleet.Backend
  def stop(backend) do
    children = Map.values(backend.children)
    Enum.each(children, &Child.kill/1)
    Child.await_ends(children)
    Host.stop(backend.host)
  end

  defp heard(backend, :world, {:up, facts}) do
    backend = put_in(backend.children[:world].up, facts)
    events = if backend.world_starts > 0, do: [{:stage, :world_back, nil, %{}}], else: []
    {:ok, events, backend}
  end

  defp heard(backend, id, {:up, facts}), do: {:ok, [], put_in(backend.children[id].up, facts)}

  defp heard(backend, :world, {:report, snapshot}),
    do: {:ok, [], %{backend | world: Snapshot.onto(backend.setup.world, snapshot)}}

  defp heard(backend, id, {:report, {claim, counts}}),
    do: {:ok, [], put_in(backend.reports[id], {claim, counts, Hal.Clock.now_ms()})}

  defp heard(backend, id, {:stage, %{robot: id, stage: stage} = about}) do
    {:ok, [{:stage, stage, id, Map.drop(about, [:robot, :stage])}], begun(backend, id, stage)}
  end

  defp heard(backend, _id, _unknown), do: {:ok, [], backend}

  # Its next report will say so; until then the run log must not consider the search finished.
  defp begun(backend, id, :search) do
    {claim, counts, _at_ms} = Map.get(backend.reports, id, {%{}, %{}, 0})
    put_in(backend.reports[id], {Map.put(claim, :phase, :search), counts, Hal.Clock.now_ms()})
  end

  defp begun(backend, _id, _stage), do: backend

  defp wreck(backend, id),
    do: change(%{backend | children: Map.delete(backend.children, id)}, {:kill, id})

  defp world_again(%{world_starts: @world_starts} = backend, child) do
    line = "#{child.node} has ended #{@world_starts + 1} times, last: #{Child.last_line(child)}"
    ended(backend, line)
  end

  defp world_again(backend, _child) do
    backend = %{backend | world_starts: backend.world_starts + 1}

    case launch(backend, [:world]) do
      {:ok, backend} ->
        Process.send_after(self(), {:late, :world, backend.children.world.pid}, @up_ms)
        {:ok, [{:stage, :world_lost, nil, %{}}], backend}

      {:error, line, backend} ->
        ended(backend, line)
    end
  end

  defp ended(backend, line),
    do: {:ended, line, %{backend | children: Map.delete(backend.children, :world)}}

  defp with_child(backend, port, change) do
    case Enum.find(backend.children, fn {_id, child} -> child.port == port end) do
      {id, _child} -> change.(backend, id)
      nil -> backend
    end
  end

  defp config(backend, id) do
    %Nodes.Config{
      node: node_name(id),
      launcher: self(),
      mesh: Host.mesh(backend.host, node_name(id)),
      part: part(backend, id)
    }
  end

  defp node_name(id), do: Command.node_name(id, Host.host())

  defp part(backend, :world), do: {Lab.Node.World, %{name: backend.name, world: backend.world}}

  defp part(%{setup: %{options: options} = setup} = backend, id) do
    index = Enum.find_index(setup.robots, &(&1.id == id))

    {Lab.Node.Robot,
     %{
       robot: Enum.at(setup.robots, index),
       world: backend.name,
       blobs: options.blobs,
       mission: setup.mission,
       plan: setup.plan,
       folder: backend.host.home,
       radio: %{options | seed: options.seed + index}
     }}
  end
end
