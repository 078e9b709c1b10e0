defmodule Sim.Fleet.Local do
  @moduledoc """
  World and robots on this node: each robot the whole tree of `Robot.Supervisor`.

      supervisor (one_for_all, no restarts: without its world a fleet is none)
      |-- Sim.World.Directory     unless another fleet of this node has it already
      |-- Sim.World.Server     the world
      |-- Sim.Fleet.RadioServer  a radio that loses, if any is lost
      |-- Sim.Fleet.Hardware  emulated devices of those that have the real drivers, if any has
      `-- Robot.Fleet    the robots, each :temporary: one that ends for good is a wreck
  """
  @behaviour Sim.Fleet.Backend
  alias Hal.Event
  alias Sim.Fleet.{Folder, Hardware, RadioServer, Robot}
  alias Sim.World

  @armed_ms 5_000
  @look_ms 10

  @enforce_keys [:supervisor, :server, :air, :order, :pids, :robots, :folder]
  defstruct @enforce_keys

  @impl Sim.Fleet.Backend
  def start(setup, options) do
    with {:ok, folder} <- folder(setup.options), do: {:ok, start(setup, options, folder)}
  end

  # Only serial lines need one.
  defp folder(%{hardware: []}), do: {:ok, nil}
  defp folder(_hardware), do: Folder.make()

  defp start(setup, options, folder) do
    name = make_ref()
    {:ok, supervisor} = Supervisor.start_link(parts(setup, name, folder), parts_options())
    part = fn id -> supervisor |> Supervisor.which_children() |> List.keyfind(id, 0) |> pid() end
    {transport, air} = RadioServer.radio(part.(RadioServer))
    :ok = Event.attach({__MODULE__, self()}, [:robot, :stage], &__MODULE__.stage/4, self())

    common = %{
      world: name,
      clock: Robot.clock(),
      transport: transport,
      blobs: setup.options.blobs,
      mission: setup.mission,
      trace: options[:trace],
      folder: folder
    }

    pids =
      for robot <- setup.robots, into: %{} do
        {:ok, pid} = Robot.start(part.(Elixir.Robot.Fleet), robot, common)
        Process.monitor(pid)
        {pid, robot.id}
      end

    await_armed(Map.values(pids), System.monotonic_time(:millisecond) + @armed_ms)

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

  # Drives arm by themselves once they have reported. Until then a robot refuses what would move it, also
  # the first order of a person who has just started the fleet. One that cannot arm holds nobody up for long.
  defp await_armed(ids, until_ms) do
    late = Enum.reject(ids, &Robot.armed?/1)

    if late != [] and System.monotonic_time(:millisecond) < until_ms do
      Process.sleep(@look_ms)
      await_armed(late, until_ms)
    end
  end

  @doc false
  @spec stage(Event.name(), map(), map(), pid()) :: term()
  def stage(_event, _measurements, about, fleet), do: send(fleet, {:stage, about})

  @impl Sim.Fleet.Backend
  def begin(crew) do
    # All at once: on a busy machine a hundred pilots one after the other take long to answer.
    options = [max_concurrency: 100, ordered: false, timeout: :infinity]
    crew |> living() |> Task.async_stream(&Robot.begin/1, options) |> Stream.run()
  end

  @impl Sim.Fleet.Backend
  def living(crew) do
    living = Map.values(crew.pids)
    Enum.filter(crew.order, &(&1 in living))
  end

  @impl Sim.Fleet.Backend
  def claims(crew), do: for(id <- living(crew), do: {id, Robot.claim(id)})

  @impl Sim.Fleet.Backend
  def kill(crew, id) do
    {pid, ^id} = Enum.find(crew.pids, fn {_pid, robot} -> robot == id end)
    Process.exit(pid, :kill)
    wreck(crew, pid)
  end

  @impl Sim.Fleet.Backend
  def change(crew, change) do
    :ok = World.Server.change(crew.server, change)
    crew
  end

  @impl Sim.Fleet.Backend
  def world(crew), do: World.Server.world(crew.server)

  @impl Sim.Fleet.Backend
  def server(crew), do: crew.server

  @impl Sim.Fleet.Backend
  def messages(crew), do: RadioServer.counts(crew.air)

  @impl Sim.Fleet.Backend
  def lines(crew) do
    ["all robots live in process #{System.pid()}; see --nodes"] ++
      Hardware.lines(crew.robots, crew.folder)
  end

  @impl Sim.Fleet.Backend
  def hear(crew, {:stage, %{robot: id, stage: stage} = about}) do
    facts = Map.drop(about, [:robot, :stage])
    {:ok, if(id in living(crew), do: [{:stage, stage, id, facts}], else: []), crew}
  end

  # However it ended: killed, or with its restarts used up.
  def hear(%{pids: pids} = crew, {:DOWN, _monitor, :process, pid, _reason})
      when is_map_key(pids, pid),
      do: {:ok, [{:killed, pids[pid]}], wreck(crew, pid)}

  def hear(%{supervisor: supervisor}, {:EXIT, supervisor, reason}), do: {:stop, reason}
  def hear(crew, _other), do: {:ok, [], crew}

  @impl Sim.Fleet.Backend
  def stop(crew) do
    Event.detach({__MODULE__, self()})
    if Process.alive?(crew.supervisor), do: Supervisor.stop(crew.supervisor, :shutdown)
    if crew.folder, do: Folder.remove(crew.folder)
  end

  defp wreck(crew, pid) do
    {id, pids} = Map.pop!(crew.pids, pid)
    change(%{crew | pids: pids}, {:kill, id})
  end

  defp parts(%{options: options, world: world, robots: robots}, name, folder) do
    worlds = if World.Directory.running?(), do: [], else: [World.Directory]

    server = [
      %{id: World.Server, start: {World.Server, :start_link, [[name: name, world: world]]}}
    ]

    worlds ++
      server ++
      RadioServer.parts(options.loss, options.seed) ++
      Hardware.parts(robots, name, folder) ++ [Elixir.Robot.Fleet]
  end

  defp parts_options, do: [strategy: :one_for_all, max_restarts: 0]

  defp pid(nil), do: nil
  defp pid({_id, pid, _type, _modules}), do: pid
end
