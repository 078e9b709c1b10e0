defmodule Soak.Fleet do
  @moduledoc """
  Keeps the nodes of a run and what they have in common: one for each robot, one for the world, each with a keeper
  (`Soak.Fleet.Keeper`). The robots stand abreast before the landmark. The first has the real drivers of a
  Magellan, on emulated devices behind serial lines, so that there are port programs to be left behind.
  """
  alias Soak.Fleet
  alias Soak.Fleet.{Keeper, Network}
  alias Soak.WorldHost
  alias Hal.Pose
  alias Lab.Trial.Setup
  alias Sim.World

  @boot_ms 60_000

  @enforce_keys [:robots, :folder, :network, :world, :starts, :mark, :keepers]
  defstruct @enforce_keys

  @type t :: %__MODULE__{}

  @doc "Makes folder and network; nothing runs yet."
  @spec create([atom()], integer(), boolean(), String.t()) :: t()
  def create(robots, seed, namespaces?, mark) do
    folder = Path.join(System.tmp_dir!(), "convoy-soak-#{mark}")
    File.mkdir_p!(folder)
    File.chmod!(folder, 0o700)
    starts = for {robot, n} <- Enum.with_index(robots), do: {robot, place(n)}
    {:ok, map} = Sim.Floorplan.open("hall", length(robots))

    bodies =
      for {robot, pose} <- starts, do: %{id: robot, profile: Setup.profile(robot), pose: pose}

    world = World.new!(map: map, robots: bodies, landmark: {0.0, 0.0}, seed: seed)
    network = Network.create(robots, folder, namespaces?)

    %__MODULE__{
      robots: robots,
      folder: folder,
      network: network,
      world: world,
      starts: starts,
      mark: mark,
      keepers: :ets.new(__MODULE__, [])
    }
  end

  # At 0, 1, -1, 2, -2, … m, and all look at the landmark.
  defp place(n) do
    y = div(n + 1, 2) * if(rem(n, 2) == 1, do: 1.0, else: -1.0)
    Pose.new(-1.7, y, :math.atan2(-y, 1.7))
  end

  @doc "Starts the keepers, and so the nodes; they belong to the calling process."
  @spec start(t()) :: :ok
  def start(fleet) do
    same = %{mark: fleet.mark, owner: self()}
    nodes = [world(fleet) | Enum.map(fleet.robots, &robot(fleet, &1))]

    for node <- nodes do
      {:ok, pid} = Keeper.start_link(Map.merge(same, node))
      :ets.insert(fleet.keepers, {node.name, pid})
    end

    :ok
  end

  defp world(%{world: world, folder: folder}) do
    main = fn vm -> Vm.call(vm, WorldHost, :main, [world, folder], @boot_ms) end
    options = [flags: Vm.fleet_flags() ++ ~w(-kernel logger_level none)]
    %{name: :world, options: options, main: main}
  end

  defp robot(%{network: network, folder: folder} = fleet, robot) do
    hardware? = robot == hd(fleet.robots)

    about = %{
      id: robot,
      hardware?: hardware?,
      folder: folder,
      mesh: Network.mesh(network, robot),
      missions: Application.fetch_env!(:swarm, :missions)
    }

    main = fn vm ->
      start = start(fleet, robot, if(hardware?, do: :zero, else: :on))
      Vm.call(vm, Fleet.Node, :main, [Map.put(about, :start, start)], @boot_ms)
    end

    %{name: robot, options: Network.vm(network, robot), main: main}
  end

  # The wheels of a real base begin to count when it is switched on; those in the world have counted all the time.
  defp start(fleet, robot, wheels) do
    case WorldHost.read(fleet.folder) do
      {:ok, _at_us, snapshot} -> WorldHost.start(snapshot, fleet.world, robot, wheels)
      {:error, _none_yet} -> fleet.starts[robot]
    end
  end

  @doc "Ends the keepers, and so the nodes."
  @spec stop(t()) :: :ok
  def stop(fleet) do
    for {_name, pid} <- :ets.tab2list(fleet.keepers) do
      Process.unlink(pid)
      Process.exit(pid, :kill)
    end

    :ok
  end

  @doc "Takes network and folder away."
  @spec delete(t()) :: :ok
  def delete(fleet) do
    :ok = Network.delete(fleet.network)
    _gone = File.rm_rf(fleet.folder)
    :ok
  end
end
