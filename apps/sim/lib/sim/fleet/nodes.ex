defmodule Sim.Fleet.Nodes do
  @moduledoc """
  World and robots each in a process of the operating system of their own (`Sim.Node`), on loopback; this
  one, the launcher, starts them and listens.

  A robot whose process ends, whoever killed it, is dead. One that says nothing, frozen perhaps, is
  `:silent` until it speaks again. When the world's process ends, it is started again from the last
  snapshot that came from it, and the robots, which stood meanwhile, go on.
  """
  @behaviour Sim.Fleet.Backend
  alias Sim.Fleet.Hardware
  alias Sim.Fleet.Nodes.{Child, Command, Host}
  alias Sim.World
  alias Sim.World.Snapshot
  alias Sim.Node.{Config, Reporter}

  # On a machine that is busy with much else a start takes several seconds.
  @up_ms 20_000
  @silent_ms 1_000
  @world_starts 5

  @enforce_keys [:setup, :host, :name, :world]
  defstruct @enforce_keys ++ [children: %{}, reports: %{}, world_starts: 0]

  @typedoc "`children` by robot id and `:world`; `reports` hold claim, counts, and when they came."
  @type t :: %__MODULE__{}

  @impl Sim.Fleet.Backend
  def start(setup, _options) do
    ids = [:world | setup.options.robots]

    with {:ok, host} <- Host.start(setup.options.robots, Enum.map(ids, &node_name/1)) do
      name = {:world, System.pid(), System.unique_integer()}
      crew = %__MODULE__{setup: setup, host: host, name: name, world: setup.world}

      with {:ok, crew} <- launch(crew, ids), {:ok, crew} <- await_all(crew, ids) do
        {:ok, crew}
      else
        {:error, line, crew} ->
          stop(crew)
          {:error, line}
      end
    end
  end

  defp launch(crew, ids) do
    Enum.reduce_while(ids, {:ok, crew}, fn id, {:ok, crew} ->
      case Child.start(config(crew, id), crew.host.home) do
        {:ok, child} -> {:cont, {:ok, put_in(crew.children[id], child)}}
        {:error, line} -> {:halt, {:error, line, crew}}
      end
    end)
  end

  # As long as one after the other comes, the machine is only slow.
  defp await_all(crew, ids, deadline \\ now() + @up_ms) do
    case Enum.filter(ids, &(crew.children[&1].up == nil)) do
      [] ->
        {:ok, crew}

      missing ->
        receive do
          {Reporter, _pid, {:up, _facts}} = message ->
            crew |> told(message) |> await_all(missing)

          {Reporter, _pid, _what} = message ->
            crew |> told(message) |> await_all(missing, deadline)

          {port, {:data, _text}} = message when is_port(port) ->
            crew |> told(message) |> await_all(missing, deadline)

          {port, {:exit_status, _status}} when is_port(port) ->
            {:error, fallen(crew, port), crew}
        after
          max(deadline - now(), 0) -> {:error, late(crew, hd(missing)), crew}
        end
    end
  end

  defp told(crew, message) do
    {:ok, _events, crew} = hear(crew, message)
    crew
  end

  defp fallen(crew, port) do
    {_id, child} = Enum.find(crew.children, fn {_id, child} -> child.port == port end)
    "#{child.node} ended at its start: #{Child.last_line(child)}"
  end

  defp late(crew, id) do
    child = crew.children[id]
    "#{child.node} did not come up within #{div(@up_ms, 1000)} s: #{Child.last_line(child)}"
  end

  @impl Sim.Fleet.Backend
  def begin(crew) do
    for id <- living(crew), do: send(crew.children[id].up.main, :begin)
    :ok
  end

  @impl Sim.Fleet.Backend
  def living(crew), do: Enum.filter(crew.setup.options.robots, &is_map_key(crew.children, &1))

  @impl Sim.Fleet.Backend
  def claims(crew) do
    now = now()

    for id <- living(crew) do
      case crew.reports[id] do
        {claim, _counts, at_ms} when now - at_ms <= @silent_ms -> {id, claim}
        _old_or_none -> {id, %{phase: :silent}}
      end
    end
  end

  @impl Sim.Fleet.Backend
  def kill(crew, id) do
    {child, children} = Map.pop!(crew.children, id)
    Child.kill(child)
    change(%{crew | children: children}, {:kill, id})
  end

  # Also to our own copy: a server that is down or about to fall begins again with that.
  @impl Sim.Fleet.Backend
  def change(crew, change) do
    if pid = server(crew), do: World.Server.change(pid, change)
    %{crew | world: World.Server.changed(crew.world, change)}
  end

  @impl Sim.Fleet.Backend
  def world(crew), do: crew.world

  @impl Sim.Fleet.Backend
  def server(%{children: %{world: %{up: %{server: server}}}}), do: server
  def server(_down), do: nil

  @impl Sim.Fleet.Backend
  def messages(crew) do
    for {_id, {_claim, counts, _at_ms}} <- crew.reports, reduce: %{sent: 0, lost: 0} do
      all -> Map.merge(all, counts, fn _key, a, b -> a + b end)
    end
  end

  @impl Sim.Fleet.Backend
  def lines(crew) do
    for id <- crew.setup.options.robots ++ [:world] do
      child = crew.children[id]
      {id, node_name(id), child && child.pid}
    end
    |> Command.lines(crew.host.home)
    |> Kernel.++(Hardware.lines(crew.setup.robots, crew.host.home))
  end

  @impl Sim.Fleet.Backend
  def hear(crew, {Reporter, pid, what}) do
    case Enum.find(crew.children, fn {_id, child} -> child.pid == pid end) do
      {id, _child} -> heard(crew, id, what)
      nil -> {:ok, [], crew}
    end
  end

  def hear(crew, {port, {:data, text}}) when is_port(port),
    do:
      {:ok, [],
       with_child(crew, port, fn crew, id ->
         update_in(crew.children[id], &Child.said(&1, text))
       end)}

  def hear(crew, {port, {:exit_status, _status}}) when is_port(port) do
    case Enum.find(crew.children, fn {_id, child} -> child.port == port end) do
      {:world, child} -> world_again(crew, child)
      {id, _child} -> {:ok, [{:killed, id}], wreck(crew, id)}
      nil -> {:ok, [], crew}
    end
  end

  def hear(crew, {:late, :world, pid}) do
    case crew.children[:world] do
      %{pid: ^pid, up: nil} -> {:stop, {:shutdown, late(crew, :world)}}
      _up -> {:ok, [], crew}
    end
  end

  def hear(crew, _other), do: {:ok, [], crew}

  @impl Sim.Fleet.Backend
  def stop(crew) do
    children = Map.values(crew.children)
    Enum.each(children, &Child.kill/1)
    Child.await_ends(children)
    Host.stop(crew.host)
  end

  defp heard(crew, :world, {:up, facts}) do
    crew = put_in(crew.children[:world].up, facts)
    events = if crew.world_starts > 0, do: [{:stage, :world_back, nil, %{}}], else: []
    {:ok, events, crew}
  end

  defp heard(crew, id, {:up, facts}), do: {:ok, [], put_in(crew.children[id].up, facts)}

  defp heard(crew, :world, {:report, snapshot}),
    do: {:ok, [], %{crew | world: Snapshot.onto(crew.setup.world, snapshot)}}

  defp heard(crew, id, {:report, {claim, counts}}),
    do: {:ok, [], put_in(crew.reports[id], {claim, counts, now()})}

  defp heard(crew, id, {:stage, %{robot: id, stage: stage} = about}) do
    {:ok, [{:stage, stage, id, Map.drop(about, [:robot, :stage])}], begun(crew, id, stage)}
  end

  defp heard(crew, _id, _unknown), do: {:ok, [], crew}

  # Its next report will say so; until then the ledger must not take the search for over.
  defp begun(crew, id, :search) do
    {claim, counts, _at_ms} = Map.get(crew.reports, id, {%{}, %{}, 0})
    put_in(crew.reports[id], {Map.put(claim, :phase, :search), counts, now()})
  end

  defp begun(crew, _id, _stage), do: crew

  defp wreck(crew, id), do: change(%{crew | children: Map.delete(crew.children, id)}, {:kill, id})

  defp world_again(%{world_starts: @world_starts}, child),
    do: {:stop, {:shutdown, "#{child.node} ends again and again: #{Child.last_line(child)}"}}

  defp world_again(crew, _child) do
    crew = %{crew | world_starts: crew.world_starts + 1}

    case launch(crew, [:world]) do
      {:ok, crew} ->
        Process.send_after(self(), {:late, :world, crew.children.world.pid}, @up_ms)
        {:ok, [{:stage, :world_lost, nil, %{}}], crew}

      {:error, line, _crew} ->
        {:stop, {:shutdown, line}}
    end
  end

  defp with_child(crew, port, change) do
    case Enum.find(crew.children, fn {_id, child} -> child.port == port end) do
      {id, _child} -> change.(crew, id)
      nil -> crew
    end
  end

  defp config(crew, id) do
    %Config{
      node: node_name(id),
      launcher: self(),
      mesh: Host.mesh(crew.host, node_name(id)),
      part: part(crew, id)
    }
  end

  defp node_name(id), do: Command.node_name(id, Host.host())

  defp part(crew, :world), do: {Sim.Node.World, %{name: crew.name, world: crew.world}}

  defp part(%{setup: %{options: options} = setup} = crew, id) do
    index = Enum.find_index(setup.robots, &(&1.id == id))

    {Sim.Node.Robot,
     %{
       robot: Enum.at(setup.robots, index),
       world: crew.name,
       blobs: options.blobs,
       mission: setup.mission,
       folder: crew.host.home,
       loss: options.loss,
       seed: options.seed + index
     }}
  end

  defp now, do: System.monotonic_time(:millisecond)
end
