defmodule Lab.Node.Fleet do
  @moduledoc """
  Keeps robots on nodes of their own in the world of one more node, which is joined to them by `Sim.World.Line`: links
  between robots can be cut, nodes be killed, frozen and started again (`Vm.Fleet`), and the bodies stay where they are.
  The world is started again from its last snapshot, a robot with the place where it stands.

  All robots stand before the landmark, in a hall. They are whole, with the applications as in a release, whose end ends
  the node.
  """
  alias Lab.Node.Network
  alias Sim.World
  alias Lab.Trial.Options
  alias Sim.World.Snapshot
  alias Hal.Pose

  @boot_ms 60_000

  @enforce_keys [:nodes, :network, :folder, :world, :robots, :options]
  defstruct @enforce_keys

  @typedoc """
  `starts` is where the robots stand first, `place` that of their network, `mission` what they do when they are told to
  start. `bodies` are those of `Lab.Trial.Options.bodies/2`, `world` more options of `Sim.World.new!/1`, `nodes` those of `Vm.Fleet.new/1`, `hardware` the robots with real
  drivers. `beside` gives the children beside a robot, or `:world`, by its name; `prepare` is called with each new
  VM; `carrier` are the arguments of a robot's distribution.
  """
  @type options :: %{
          required(:starts) => [{atom(), Pose.t()}],
          required(:place) => Network.place(),
          required(:folder) => Path.t(),
          required(:mission) => Robot.Config.module_options(),
          optional(:bodies) => keyword(atom() | Hal.Profile.t()),
          optional(:world) => keyword(),
          optional(:nodes) => keyword(),
          optional(:hardware) => [atom()],
          optional(:beside) => (atom() -> [term()]),
          optional(:prepare) => (Vm.t() -> term()),
          optional(:carrier) => (atom() -> [String.t()])
        }
  @type t :: %__MODULE__{}

  @doc "A fleet of which nothing runs yet."
  @spec new(options()) :: t()
  def new(options) do
    robots = Keyword.keys(options.starts)
    {:ok, network} = Network.create(options.place, robots)
    {:ok, map} = Sim.Floorplan.open("hall", length(robots))

    {:ok, profiles} = Options.bodies(robots, Map.get(options, :bodies, []))

    bodies = for {id, pose} <- options.starts, do: %{id: id, profile: profiles[id], pose: pose}

    more = Map.get(options, :world, [])

    %__MODULE__{
      nodes: Vm.Fleet.new(Map.get(options, :nodes, [])),
      network: network,
      folder: options.folder,
      world: World.new!([map: map, robots: bodies, landmark: {0.0, 0.0}] ++ more),
      robots: robots,
      options: options
    }
  end

  @doc "A row abreast before the landmark, at which all look: at 0, 1, -1, 2, -2, … m."
  @spec abreast([atom()]) :: [{atom(), Pose.t()}]
  def abreast(robots) do
    for {robot, n} <- Enum.with_index(robots) do
      y = div(n + 1, 2) * if(rem(n, 2) == 1, do: 1.0, else: -1.0)
      {robot, Pose.new(-1.7, y, :math.atan2(-y, 1.7))}
    end
  end

  @doc "Starts the nodes beside each other, and waits for none of them."
  @spec start(t()) :: t()
  def start(fleet) do
    Vm.Fleet.start(fleet.nodes, [world(fleet) | Enum.map(fleet.robots, &robot(fleet, &1))])
    fleet
  end

  @doc "The last snapshot of the world, and when it was taken, in microseconds of the machine's time."
  @spec snapshot(t()) :: {:ok, at_us :: integer(), Snapshot.t()} | {:error, File.posix()}
  def snapshot(fleet) do
    with {:ok, bytes} <- File.read(file(fleet, "world.snapshot")) do
      {at_us, snapshot} = :erlang.binary_to_term(bytes)
      {:ok, at_us, snapshot}
    end
  end

  @doc "The world in its last snapshot, and as it began before there is one."
  @spec last_world(t()) :: World.t()
  def last_world(fleet) do
    case snapshot(fleet) do
      {:ok, _at_us, last} -> Snapshot.onto(fleet.world, last)
      {:error, _none_yet} -> fleet.world
    end
  end

  defp world(fleet) do
    %{
      name: :world,
      vm: [flags: Vm.fleet_flags() ++ ~w(-kernel logger_level none)],
      main: fn vm ->
        options = %{name: __MODULE__, world: last_world(fleet), line: file(fleet, "world.line")}
        main(fleet, vm, {Lab.Node.World, options}, :world, [], to: file(fleet, "world.snapshot"))
      end
    }
  end

  defp robot(%{network: network, options: options} = fleet, id) do
    carrier = if of = options[:carrier], do: [of.(id)], else: []
    hardware? = id in Map.get(options, :hardware, [])
    build = Application.get_all_env(:swarm) |> Keyword.take([:missions, :companions])

    part = %{
      # By a name of its own: connected nodes share their directories.
      world: {__MODULE__, id},
      line: file(fleet, "world.line"),
      blobs: :direct,
      mission: options.mission,
      folder: fleet.folder,
      restart: :permanent
    }

    %{
      name: id,
      vm: apply(Network, :vm, [network, id | carrier]),
      main: fn vm ->
        start = start(fleet, id, if(hardware?, do: :zero, else: :on))
        profile = fleet.world.robots[id].profile
        robot = %{id: id, profile: profile, hardware?: hardware?, start: start}
        swarm = [mesh: Network.mesh(network, id)] ++ build
        part = {Lab.Node.Robot, Map.put(part, :robot, robot)}
        main(fleet, vm, part, id, [swarm: swarm], apps: :permanent)
      end
    }
  end

  # The wheels of a real base begin to count when it is switched on; those in the world have counted all the time.
  defp start(fleet, robot, wheels) do
    case snapshot(fleet) do
      {:ok, _at_us, snapshot} -> Snapshot.start(snapshot, fleet.world, robot, wheels)
      {:error, _none_yet} -> fleet.options.starts[robot]
    end
  end

  defp main(%{options: options}, vm, {module, part}, name, config, more) do
    if prepare = options[:prepare], do: prepare.(vm)
    beside = if beside = options[:beside], do: beside.(name), else: []
    config = [logger: [level: :none]] ++ config
    arguments = [{module, Map.put(part, :beside, beside)}, config, more]
    Vm.call(vm, Lab.Node, :main, arguments, @boot_ms)
  end

  defp file(fleet, name), do: Path.join(fleet.folder, name)
end
