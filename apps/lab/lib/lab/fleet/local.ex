defmodule Lab.Fleet.Local do
  @moduledoc """
  Runs world and robots on this node: each robot the whole tree of `Robot.Supervisor`.

      supervisor (one_for_all, no restarts: a fleet cannot exist without its world)
      |-- Sim.World.Directory     unless another fleet of this node has it already
      |-- Sim.World.Server     the world
      |-- Lab.RadioServer  a radio that loses, duplicates and delays messages, if any is to
      |-- Lab.VirtualRobot.Hardware  emulated devices of those that have the real drivers, if any has
      `-- Robot.Fleet    the robots, each :temporary: one that ends for good is a wreck
  """
  @behaviour Lab.Fleet.Backend
  alias Robot.Names
  alias Hal.Event
  alias Lab.Fleet.Folder
  alias Lab.Trial.Setup
  alias Lab.VirtualRobot
  alias Lab.VirtualRobot.Hardware
  alias Lab.RadioServer
  alias Sim.World

  @enforce_keys [:supervisor, :server, :air, :order, :pids, :robots, :folder]
  # `holders` keep processes of frozen robots from going on.
  defstruct @enforce_keys ++ [holders: []]

  @impl Lab.Fleet.Backend
  def start(setup, options) do
    with {:ok, folder} <- folder(setup.options), do: {:ok, start(setup, options, folder)}
  end

  # Only serial lines need a folder.
  defp folder(%{hardware: []}), do: {:ok, nil}
  defp folder(_hardware), do: Folder.make()

  defp start(setup, options, folder) do
    name = make_ref()
    {:ok, supervisor} = Supervisor.start_link(parts(setup, name, folder), parts_options())
    part = fn id -> supervisor |> Supervisor.which_children() |> List.keyfind(id, 0) |> pid() end
    {transport, air} = RadioServer.radio(part.(RadioServer), self())
    :ok = Event.attach({__MODULE__, self()}, [:robot, :stage], &__MODULE__.stage/4, self())

    common = %{
      world: name,
      clock: VirtualRobot.clock(),
      transport: transport,
      blobs: setup.options.blobs,
      marks: Setup.looked_for(setup.options),
      mission: setup.mission,
      plan: setup.plan,
      trace: options[:trace],
      folder: folder
    }

    pids =
      for robot <- setup.robots, into: %{} do
        {:ok, pid} = VirtualRobot.start(part.(Robot.Fleet), robot, common)
        Process.monitor(pid)
        {pid, robot.id}
      end

    # So that it takes the first order of a person who has just started the fleet. A robot that cannot
    # arm does not delay the others for long.
    VirtualRobot.await_armed(Map.values(pids))

    %__MODULE__{
      supervisor: supervisor,
      server: part.(World.Server),
      air: air,
      order: setup.options.robots,
      pids: pids,
      robots: setup.robots,
      folder: folder
    }
  end

  @doc false
  @spec stage(Event.name(), map(), map(), pid()) :: term()
  def stage(_event, _measurements, about, fleet), do: send(fleet, {:stage, about})

  @impl Lab.Fleet.Backend
  def begin(backend) do
    # All at once: on a busy machine, a hundred pilots asked one after the other take long to
    # answer.
    options = [max_concurrency: 100, ordered: false, timeout: :infinity]
    backend |> living() |> Task.async_stream(&VirtualRobot.begin/1, options) |> Stream.run()
  end

  @impl Lab.Fleet.Backend
  def living(backend) do
    living = Map.values(backend.pids)
    Enum.filter(backend.order, &(&1 in living))
  end

  @impl Lab.Fleet.Backend
  def claims(backend), do: for(id <- living(backend), do: {id, VirtualRobot.claim(id)})

  @impl Lab.Fleet.Backend
  def kill(backend, id) do
    {pid, ^id} = Enum.find(backend.pids, fn {_pid, robot} -> robot == id end)
    Process.exit(pid, :kill)
    wreck(backend, pid)
  end

  @impl Lab.Fleet.Backend
  def suffer(backend, {:crash, id, role}) do
    with pid when pid != nil <- Names.whereis(id, role), do: Process.exit(pid, :kill)
    backend
  end

  def suffer(backend, {:hang, id, role, for_s}), do: suspend(backend, id, [role], for_s)
  def suffer(backend, {:blind, id, for_s}), do: suspend(backend, id, [:camera], for_s)

  # Its recorder may be that of others, too.
  def suffer(backend, {:freeze, id, for_s}),
    do: suspend(backend, id, Names.roles(id) -- [:recorder, :incidents], for_s)

  # They get no processor, as if the system had none for them. They go on when the process that holds them ends, with the fleet
  # at the latest.
  defp suspend(backend, id, roles, for_s) do
    pids = for role <- roles, pid = Names.whereis(id, role), do: pid

    holder =
      spawn_link(fn ->
        Enum.each(pids, &held/1)
        receive(do: (:never -> :ok), after: (round(for_s * 1000) -> :ok))
      end)

    %{backend | holders: [holder | Enum.filter(backend.holders, &Process.alive?/1)]}
  end

  defp held(pid) do
    :erlang.suspend_process(pid)
  rescue
    # It has ended.
    ArgumentError -> true
  end

  @impl Lab.Fleet.Backend
  def radio(backend, change) do
    RadioServer.change(backend.air, change)
    backend
  end

  @impl Lab.Fleet.Backend
  def change(backend, change) do
    :ok = World.Server.change(backend.server, change)
    backend
  end

  @impl Lab.Fleet.Backend
  def world(backend), do: World.Server.world(backend.server)

  @impl Lab.Fleet.Backend
  def messages(backend), do: RadioServer.counts(backend.air)

  @impl Lab.Fleet.Backend
  def lines(backend) do
    ["all robots live in process #{System.pid()}; see --nodes"] ++
      Hardware.lines(backend.robots, backend.folder)
  end

  @impl Lab.Fleet.Backend
  def hear(backend, {:stage, %{robot: id, stage: stage} = about}) do
    facts = Map.drop(about, [:robot, :stage])
    {:ok, if(id in living(backend), do: [{:stage, stage, id, facts}], else: []), backend}
  end

  # Whether it was killed, or has used up its restarts.
  def hear(%{pids: pids} = backend, {:DOWN, _monitor, :process, pid, _reason})
      when is_map_key(pids, pid),
      do: {:ok, [{:killed, pids[pid]}], wreck(backend, pid)}

  def hear(%{supervisor: supervisor}, {:EXIT, supervisor, reason}), do: {:stop, reason}
  def hear(backend, _other), do: {:ok, [], backend}

  @impl Lab.Fleet.Backend
  def stop(backend) do
    Event.detach({__MODULE__, self()})
    # What is frozen cannot end in order.
    Enum.each(backend.holders, &Process.exit(&1, :kill))
    if Process.alive?(backend.supervisor), do: Supervisor.stop(backend.supervisor, :shutdown)
    if backend.folder, do: Folder.remove(backend.folder)
  end

  defp wreck(backend, pid) do
    {id, pids} = Map.pop!(backend.pids, pid)
    change(%{backend | pids: pids}, {:kill, id})
  end

  defp parts(%{options: options, world: world, robots: robots}, name, folder) do
    worlds = if World.Directory.running?(), do: [], else: [World.Directory]

    server = [
      %{id: World.Server, start: {World.Server, :start_link, [[name: name, world: world]]}}
    ]

    worlds ++
      server ++
      RadioServer.parts(options, options.script ++ options.cuts != []) ++
      Hardware.parts(robots, name, folder) ++ [Robot.Fleet]
  end

  defp parts_options, do: [strategy: :one_for_all, max_restarts: 0]

  defp pid(nil), do: nil
  defp pid({_id, pid, _type, _modules}), do: pid
end
