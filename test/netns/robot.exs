# What runs on the robots' nodes; the test ships it there.

defmodule Netns.Events do
  @moduledoc "What a node writes into its log (`Lab.Node.Log`): events as they happen, and what changes, ten times a second."
  alias Hal.Event
  alias Robot.Board
  alias Lab.Node.Log
  alias Sim.World

  # What explains that a robot does not do as it should: processes that hang, crash or start again.
  @troubles for(
              part <- [:gate, :executive, :pilot],
              what <- [:silent, :hung, :again],
              do: [:robot, part, what]
            ) ++
              [[:robot, :gate, :start], [:robot, :executive, :start], [:swarm, :part, :fell]] ++
              [[:swarm, :comms, :duplicate_id], [:swarm, :comms, :unique_id]]

  @doc "The lines of a robot's node, or of the world's."
  def looks(:world, robots),
    do: for(id <- robots, do: {{:body, id}, 1, :change, {__MODULE__, :body, [id]}})

  def looks(robot, _robots),
    do: [
      {:mesh, 1, :change, {__MODULE__, :mesh, []}},
      {:rejected, 1, :change, {__MODULE__, :rejected, [robot]}}
    ]

  @doc "What the log of a node begins with."
  def begin(:world), do: nil
  def begin(_robot), do: &__MODULE__.listen/0

  @doc false
  def listen do
    for event <- [[:robot, :gate, :estop], [:robot, :gate, :reset], [:robot, :pilot, :phase]],
        do: :ok = Event.attach({__MODULE__, event}, event, &__MODULE__.event/4, nil)

    for event <- @troubles,
        do: :ok = Event.attach({__MODULE__, event}, event, &__MODULE__.trouble/4, nil)

    # Nothing is printed; what crashes is in the log.
    _ = :logger.remove_handler(:default)
    :ok = :logger.set_primary_config(:level, :error)
    :ok = :logger.add_handler(__MODULE__, __MODULE__, %{level: :error})
  end

  @doc false
  def event([:robot, :gate, what], _measurements, _about, nil), do: Log.note(what, nil)

  # A robot that is taken off the group's mission claims nothing any more.
  def event([:robot, :pilot, :phase], _measurements, %{state: state}, nil) do
    unless match?({Netns.Watched, _phase}, state), do: Log.change(:claim, nil)
    Log.change(:doing, if(is_tuple(state), do: elem(state, 0), else: state))
  end

  @doc false
  def log(%{msg: message}, _config),
    do: Log.note(:trouble, {:error, inspect(message, limit: 15, printable_limit: 1_000)})

  @doc false
  def trouble([_app, part, what], _measurements, about, nil),
    do: Log.note(:trouble, {part, what, inspect(about, limit: 20, printable_limit: 200)})

  @doc false
  def mesh do
    mesh = Mesh.view()
    alive = for {node, %{status: :alive}} <- mesh.nodes, do: node
    {mesh.number, Enum.sort(alive)}
  end

  @doc false
  def rejected(robot) do
    with {:ok, board} <- Board.find(robot),
         {:ok, %{rejected: rejected}, _at_ms} <- Board.fetch(board, :radio, :infinity),
         do: rejected,
         else: (:error -> nil)
  end

  @doc false
  def body(robot) do
    %{pose: pose} = World.Server.world(World.Directory.find(Lab.Node.Fleet)).robots[robot]
    {Float.round(pose.x, 2), Float.round(pose.y, 2), Float.round(pose.heading, 2)}
  end
end

defmodule Netns.Watched do
  @moduledoc "The landmark mission as it is, with a line in the log for what it decides."
  @behaviour Robot.Mission
  alias Missions.Landmark
  alias Missions.Landmark.{Rounds, SlotPoses}
  alias Lab.Node.Log

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
