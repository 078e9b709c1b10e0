# What runs on the robots' nodes; the test ships it there.

defmodule Netns.Log do
  @moduledoc """
  A node's own log: a file of lines `{microseconds, robot, kind, value}`, written as things happen, so that
  it is whole up to the moment in which somebody kills the node. The time is the machine's
  (CLOCK_MONOTONIC), which all namespaces share.
  """
  use GenServer
  alias Hal.Event
  alias Robot.Board

  @look_ms 100

  # What explains that a robot does not do as it should: processes that hang, crash or start again.
  @troubles for(
              part <- [:gate, :executive, :pilot],
              what <- [:silent, :hung, :again],
              do: [:robot, part, what]
            ) ++
              [[:robot, :gate, :start], [:robot, :executive, :start], [:swarm, :part, :fell]] ++
              [[:swarm, :comms, :duplicate_id], [:swarm, :comms, :unique_id]]

  @doc "Starts the log of a node."
  def start_link({path, robot}),
    do: GenServer.start_link(__MODULE__, {path, robot}, name: __MODULE__)

  @doc "The machine's time, in microseconds."
  def now, do: :os.perf_counter(:microsecond)

  @doc "Writes a line."
  def note(kind, value), do: GenServer.cast(__MODULE__, {:note, now(), kind, value})

  @doc "Writes a line, if the value is another than the last one of its kind."
  def change(kind, value), do: GenServer.cast(__MODULE__, {:change, now(), kind, value})

  @impl GenServer
  def init({path, robot}) do
    Process.flag(:priority, :high)
    {:ok, file} = :file.open(path, [:append, :raw])

    for event <- [[:robot, :gate, :estop], [:robot, :gate, :reset], [:robot, :pilot, :phase]],
        do: :ok = Event.attach({__MODULE__, event}, event, &__MODULE__.event/4, nil)

    for event <- @troubles,
        do: :ok = Event.attach({__MODULE__, event}, event, &__MODULE__.trouble/4, nil)

    # Nothing is printed; what crashes is in the log.
    _ = :logger.remove_handler(:default)
    :ok = :logger.set_primary_config(:level, :error)
    :ok = :logger.add_handler(__MODULE__, __MODULE__, %{level: :error})

    {:ok, _timer} = :timer.send_interval(@look_ms, :look)
    {:ok, write(%{file: file, robot: robot, last: %{}}, now(), :boot, :os.getpid())}
  end

  @doc false
  def event([:robot, :gate, what], _measurements, _about, nil), do: note(what, nil)

  # A robot that is taken off the group's mission claims nothing any more.
  def event([:robot, :pilot, :phase], _measurements, %{state: state}, nil) do
    unless match?({Netns.Watched, _phase}, state), do: change(:claim, nil)
    change(:doing, if(is_tuple(state), do: elem(state, 0), else: state))
  end

  @doc false
  def log(%{msg: message}, _config),
    do: note(:trouble, {:error, inspect(message, limit: 15, printable_limit: 1_000)})

  @doc false
  def trouble([_app, part, what], _measurements, about, nil),
    do: note(:trouble, {part, what, inspect(about, limit: 20, printable_limit: 200)})

  @impl GenServer
  def handle_cast({:note, us, kind, value}, s), do: {:noreply, write(s, us, kind, value)}
  def handle_cast({:change, us, kind, value}, s), do: {:noreply, changed(s, us, kind, value)}

  @impl GenServer
  def handle_info(:look, s) do
    mesh = Mesh.view()
    alive = for {node, %{status: :alive}} <- mesh.nodes, do: node
    s = changed(s, now(), :mesh, {mesh.number, Enum.sort(alive)})

    with {:ok, board} <- Board.find(s.robot),
         {:ok, %{rejected: rejected}, _at_ms} <- Board.fetch(board, :radio, :infinity) do
      {:noreply, changed(s, now(), :rejected, rejected)}
    else
      :error -> {:noreply, s}
    end
  end

  defp changed(s, us, kind, value) do
    case s.last do
      %{^kind => ^value} -> s
      last -> write(%{s | last: Map.put(last, kind, value)}, us, kind, value)
    end
  end

  defp write(s, us, kind, value) do
    line = :io_lib.format("~0tp.~n", [{us, s.robot, kind, value}])
    :ok = :file.write(s.file, :unicode.characters_to_binary(line))
    s
  end
end

defmodule Netns.Watched do
  @moduledoc "The landmark mission as it is, with a line in the log for what it decides."
  @behaviour Robot.Mission
  alias Netns.Log
  alias Missions.Landmark
  alias Missions.Landmark.{Rounds, SlotPoses}

  @impl Robot.Mission
  def init(robot, options), do: Landmark.init(robot, options)

  @impl Robot.Mission
  defdelegate options(options, robots), to: Landmark

  @impl Robot.Mission
  defdelegate claims, to: Landmark

  @impl Robot.Mission
  defdelegate stale(claim), to: Landmark

  @impl Robot.Mission
  def handle(event, mission) do
    {phase, next, effects} = Landmark.handle(event, mission)
    with {:command, command} <- event, do: Log.note(:command, command)
    with {:tick, _percept} <- event, do: Log.change(:view, Rounds.view(next))
    for {:claim, claim} <- effects, do: claim(claim)
    commit(mission.round, next.round)
    {phase, next, effects}
  end

  defp commit(%{phase: :committed, id: id}, %{id: id}), do: :ok

  defp commit(_before, %{phase: :committed, id: id, digest: digest}),
    do: Log.note(:commit, {id, Base.encode16(digest)})

  defp commit(_before, _open), do: :ok

  # Before it that a shape is formed, where in the world's metres its followers should stand.
  defp claim(%{anchor: anchor} = claim) do
    if claim.formed, do: Log.change(:slots, Enum.map(anchor.order, &slot(anchor, &1)))
    brief = Map.take(claim, [:phase, :leader, :epoch, :formed, :in_place])
    Log.change(:claim, Map.put(brief, :order, anchor && anchor.order))
  end

  defp slot(anchor, id) do
    {pose, _velocity} = SlotPoses.slot(anchor, id, 0)
    {id, Float.round(pose.x, 2), Float.round(pose.y, 2)}
  end
end

defmodule Netns.Bodies do
  @moduledoc """
  Keeps the worlds of several nodes one: each node's world moves its own robot's body, and tells
  where it is to the worlds of the others, ten times a second. That goes over sockets of the file
  system, which no cut of the network touches: bodies are there for each other whatever the radios do.
  """
  use GenServer
  alias Netns.Log
  alias Sim.World

  @every_ms 100

  def start_link(options), do: GenServer.start_link(__MODULE__, options)

  @impl GenServer
  def init({server, folder, robot, robots}) do
    path = Path.join(folder, "#{robot}.sock")
    _ = File.rm(path)
    {:ok, socket} = :gen_udp.open(0, [:local, :binary, active: true, ifaddr: {:local, path}])
    {:ok, _timer} = :timer.send_interval(@every_ms, :tell)
    others = for id <- robots, id != robot, do: {:local, Path.join(folder, "#{id}.sock")}
    {:ok, %{server: server, robot: robot, socket: socket, others: others}}
  end

  @impl GenServer
  def handle_info(:tell, s) do
    pose = World.Server.world(s.server).robots[s.robot].pose
    term = :erlang.term_to_binary({s.robot, pose})
    # Who is switched off does not hear it.
    for other <- s.others, do: _ = :gen_udp.send(s.socket, other, 0, term)

    Log.change(
      :body,
      {Float.round(pose.x, 2), Float.round(pose.y, 2), Float.round(pose.heading, 2)}
    )

    {:noreply, s}
  end

  def handle_info({:udp, _socket, _path, _port, term}, s) do
    {robot, pose} = :erlang.binary_to_term(term)
    :ok = World.Server.change(s.server, {:displace, robot, pose})
    {:noreply, s}
  end
end

defmodule Netns.Robot do
  @moduledoc "A whole robot on a node of its own, in a world of bodies."
  alias Lab.Trial.Setup
  alias Sim.World

  @landmark {0.0, 0.0}

  @doc "Starts it; `poses` is where everybody's body stands, `folder` where log and sockets are."
  def start(id, poses, folder) do
    {:ok, map} = Sim.Floorplan.open("hall", length(poses))

    bodies =
      for {robot, pose} <- poses, do: %{id: robot, profile: Setup.profile(robot), pose: pose}

    world = World.new!(map: map, robots: bodies, landmark: @landmark, noise: :off)
    {:ok, parts} = Supervisor.start_link([], strategy: :one_for_one)
    Process.unlink(parts)
    {:ok, _} = Supervisor.start_child(parts, {Netns.Log, {Path.join(folder, "#{id}.log"), id}})
    {:ok, _} = Supervisor.start_child(parts, Sim.World.Directory)

    {:ok, server} =
      Supervisor.start_child(parts, {Sim.World.Server, name: {:world, id}, world: world})

    names = Keyword.keys(poses)
    {:ok, _} = Supervisor.start_child(parts, {Netns.Bodies, {server, folder, id, names}})
    {:ok, _} = Robot.Fleet.start_robot(Robot.Fleet, config(id, poses[id]))
    :ok
  end

  defp config(id, pose) do
    # By a name of its own: on connected nodes there are several.
    device = [world: {:world, id}, robot: id]

    Robot.Config.new!(
      id: id,
      profile: Setup.profile(id),
      start: pose,
      drive: {Sim.Device.Drive, device},
      ptz: {Sim.Device.Ptz, device},
      camera: {Sim.Device.Camera, device ++ [blobs: :direct]},
      colours: World.colours(),
      mission: {Netns.Watched, []}
    )
    |> Swarm.Comms.join()
  end
end

defmodule Netns.Connection do
  @moduledoc "What Erlang says of a connection between nodes."

  @doc "The address that a robot's node is connected from, or at; `nil` if it is not."
  def address(robot) do
    node = :"#{robot}@convoy"

    with true <- node in Node.list(),
         {:ok, info} <- :net_kernel.node_info(node),
         {:net_address, {ip, _port}, _host, _protocol, _family} <- info[:address] do
      ip
    else
      _not_connected -> nil
    end
  end
end

defmodule Netns.Order do
  @moduledoc "An order in two steps, as `Swarm.Commands.Client` gives it, so that the network may be cut between them."
  alias Mesh.Nonblocking
  alias Swarm.Order.Freshness
  alias Swarm.Directory

  @answer_ms 5_000

  @doc "Asks a robot for its time."
  def prepare(robot) do
    comms = Directory.whereis(robot)
    ref = :erlang.alias([:reply])
    Nonblocking.cast(comms, {:stamp, ref})

    receive do
      {^ref, stamp} -> {comms, stamp}
    after
      @answer_ms -> exit({:no_stamp, robot})
    end
  end

  @doc "Gives the order; nobody waits for its answer."
  def give({comms, stamp}, request) do
    {:ok, order} = Freshness.given(stamp, 0)
    Nonblocking.cast(comms, {:command, request, :erlang.alias([:reply]), order})
  end
end
