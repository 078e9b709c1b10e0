defmodule Sim.Fleet do
  @moduledoc """
  A world and n robots on this node, in real time: each robot is the whole tree of
  `Robot.Supervisor` with simulated drivers, so that `Swarm` commands it like any other, and any of
  its processes may be killed.

      Sim.Fleet
      `-- supervisor (one_for_all, no restarts: without its world a fleet is none)
          |-- Sim.Worlds     unless another fleet of this node has it already
          |-- Sim.Server     the world
          |-- Sim.Fleet.Air  a radio that loses, if any is lost
          `-- Robot.Fleet    the robots, each :temporary: one that ends for good is a wreck

  This process plays the script, keeps the ledger, and answers what viewers ask.
  """
  use GenServer
  alias Hal.{Event, Pose}
  alias Robot.{Board, Config, Pilot}
  alias Sim.Fleet.Air
  alias Sim.{Scene, Server, World, Worlds}
  alias Sim.Trial.{Ledger, Score, Script, Setup}
  alias Swarm.Missions.Manual

  @period_ms 100

  @doc """
  Starts a fleet. All options have defaults: `robots`, `seed`, `map`, `landmark`, `formation`, `noise`,
  `loss` and the others of `Sim.Trial.Setup.new/1` (there is no time limit here); `mission: false` for
  robots that wait for commands instead of starting their mission at once; `trace` as of
  `Robot.Config`, called with the robot's id first.

      {:ok, fleet} = Sim.Fleet.start_link()
      {:ok, fleet} = Sim.Fleet.start_link(robots: [:mag1, :mag2, :min1], map: "hospital", mission: false)
      Sim.Fleet.kill(fleet, :leader)
      Sim.Fleet.move_landmark(fleet, {3.0, 2.0})
  """
  @spec start_link(keyword() | map()) :: {:ok, pid()} | {:error, line :: String.t()}
  def start_link(options \\ []) do
    options = Map.new(options)
    {mission?, options} = Map.pop(options, :mission, true)
    {trace, options} = Map.pop(options, :trace)

    with {:ok, setup} <- Setup.new(options),
         :ok <- free(setup.options.robots) do
      {:ok, _apps} = Application.ensure_all_started(:swarm)
      GenServer.start_link(__MODULE__, {setup, mission?, trace})
    end
  end

  @doc "What a viewer sees now."
  @spec scene(GenServer.server()) :: Scene.t()
  def scene(fleet), do: GenServer.call(fleet, :scene, :infinity)

  @doc "What the report says of the run so far, but for its wall time."
  @spec result(GenServer.server()) :: map()
  def result(fleet), do: GenServer.call(fleet, :result, :infinity)

  @doc "Kills a robot, or whoever leads: all its processes at once, as a broken wire would."
  @spec kill(GenServer.server(), atom() | :leader) :: :ok | {:error, line :: String.t()}
  def kill(fleet, who), do: GenServer.call(fleet, {:kill, who})

  @doc "Lets the landmark glide to a place; `nil` takes it away."
  @spec move_landmark(GenServer.server(), Pose.point() | nil) ::
          :ok | {:error, line :: String.t()}
  def move_landmark(fleet, place), do: GenServer.call(fleet, {:move, place})

  @doc "The robots that live, in the order of the fleet."
  @spec living(GenServer.server()) :: [atom()]
  def living(fleet), do: GenServer.call(fleet, :living)

  @doc "The server of its world."
  @spec server(GenServer.server()) :: pid()
  def server(fleet), do: GenServer.call(fleet, :server)

  @doc "Ends all of it."
  @spec stop(GenServer.server()) :: :ok
  def stop(fleet), do: GenServer.stop(fleet)

  @doc "The clock of a fleet's robots: milliseconds since its start."
  @spec now(integer()) :: non_neg_integer()
  def now(epoch_ms), do: System.monotonic_time(:millisecond) - epoch_ms

  @impl GenServer
  def init({%Setup{options: options} = setup, mission?, trace}) do
    # So that `terminate/2` runs, and a fall of the parts is seen.
    Process.flag(:trap_exit, true)
    epoch_ms = System.monotonic_time(:millisecond)
    name = make_ref()
    {:ok, supervisor} = Supervisor.start_link(parts(setup, name), parts_options())
    part = fn id -> supervisor |> Supervisor.which_children() |> List.keyfind(id, 0) |> pid() end
    {transport, air} = radio(part.(Air))

    s = %{
      setup: setup,
      epoch_ms: epoch_ms,
      supervisor: supervisor,
      server: part.(Server),
      air: air,
      robots: %{},
      script: Script.new(options.moves, options.kills),
      ledger: Ledger.new(),
      next: epoch_ms
    }

    :ok = Event.attach({__MODULE__, self()}, [:robot, :stage], &__MODULE__.stage/4, self())
    clock = {__MODULE__, :now, [epoch_ms]}
    body = %{world: name, clock: clock, transport: transport, trace: trace}
    robots = for robot <- setup.robots, do: start_robot(part.(Robot.Fleet), robot, body, setup)
    {:ok, schedule(%{s | robots: Map.new(robots)}), {:continue, {:begin, mission?}}}
  end

  @impl GenServer
  def handle_continue({:begin, mission?}, s) do
    # All at once: on a busy machine a hundred pilots one after the other take long to answer.
    options = [max_concurrency: 100, ordered: false, timeout: :infinity]
    if mission?, do: alive(s) |> Task.async_stream(&begin/1, options) |> Stream.run()
    {:noreply, s}
  end

  @doc false
  @spec stage(Event.name(), map(), map(), pid()) :: term()
  def stage(_event, _measurements, about, fleet), do: send(fleet, {:stage, about})

  @impl GenServer
  def handle_call(:scene, _from, s), do: {:reply, s |> run() |> Score.scene(), s}
  def handle_call(:result, _from, s), do: {:reply, s |> run() |> Score.result(), s}
  def handle_call(:living, _from, s), do: {:reply, alive(s), s}
  def handle_call(:server, _from, s), do: {:reply, s.server, s}

  def handle_call({:kill, :leader}, from, s) do
    case Ledger.leader(s.ledger) do
      nil -> {:reply, {:error, "there is no leader to kill yet"}, s}
      leader -> handle_call({:kill, leader}, from, s)
    end
  end

  def handle_call({:kill, id}, _from, s) do
    if id in alive(s),
      do: {:reply, :ok, end_robot(s, id)},
      else: {:reply, {:error, "no robot #{inspect(id)} lives here; #{list(alive(s))}"}, s}
  end

  def handle_call({:move, place}, _from, s) do
    with :ok <- Setup.check_landmarks(s.setup.map, [place]) do
      {:reply, :ok, move(s, place)}
    else
      error -> {:reply, error, s}
    end
  end

  @impl GenServer
  def handle_info(:tick, s) do
    ledger = Ledger.note(s.ledger, now(s.epoch_ms), claims(s))
    {events, script} = Script.due(s.script, now(s.epoch_ms), Ledger.leader(ledger))
    s = Enum.reduce(events, %{s | ledger: ledger, script: script}, &play/2)
    {:noreply, schedule(s)}
  end

  def handle_info({:stage, %{robot: id, stage: stage} = about}, s) do
    facts = Map.drop(about, [:robot, :stage])
    {:noreply, if(id in alive(s), do: written(s, stage, id, facts), else: s)}
  end

  # However it ended: killed, or with its restarts used up.
  def handle_info({:DOWN, _monitor, :process, pid, _reason}, s) when is_map_key(s.robots, pid),
    do: {:noreply, wreck(s, pid)}

  def handle_info({:EXIT, supervisor, reason}, %{supervisor: supervisor} = s),
    do: {:stop, reason, s}

  def handle_info(_other, s), do: {:noreply, s}

  @impl GenServer
  def terminate(_reason, s) do
    Event.detach({__MODULE__, self()})
    if Process.alive?(s.supervisor), do: Supervisor.stop(s.supervisor, :shutdown)
  end

  defp free(robots) do
    case Enum.filter(robots, &(Process.whereis(Robot.Names) && Robot.Names.whereis(&1, :robot))) do
      [] -> :ok
      taken -> {:error, "#{list(taken)} on this node already; stop that fleet first"}
    end
  end

  defp list([]), do: "nobody lives"
  defp list([one]), do: "#{one} lives"
  defp list(robots), do: "#{Enum.join(robots, ", ")} live"

  defp parts(%{options: options, world: world}, name) do
    worlds = if Worlds.running?(), do: [], else: [Worlds]
    server = [%{id: Server, start: {Server, :start_link, [[name: name, world: world]]}}]
    radio = [seed: options.seed, loss: options.loss]

    air = if options.loss > 0, do: [%{id: Air, start: {Air, :start_link, [radio]}}], else: []

    worlds ++ server ++ air ++ [Robot.Fleet]
  end

  defp parts_options, do: [strategy: :one_for_all, max_restarts: 0]

  defp pid(nil), do: nil
  defp pid({_id, pid, _type, _modules}), do: pid

  defp radio(nil), do: Air.clear()
  defp radio(air), do: {Air.transport(air), air}

  defp start_robot(fleet, %{id: id} = robot, body, setup) do
    device = [world: body.world, robot: id]
    camera = device ++ [blobs: setup.options.blobs, clock: body.clock]

    config =
      Config.new!(
        id: id,
        profile: robot.profile,
        start: robot.start,
        clock: body.clock,
        drive: {Sim.Drive, device},
        ptz: {Sim.Ptz, device},
        camera: {Sim.Camera, camera},
        colours: World.colours(),
        mission: setup.mission,
        trace: trace(body.trace, id)
      )

    {:ok, pid} =
      Robot.Fleet.start_robot(fleet, Swarm.Link.join(config, transport: body.transport))

    Process.monitor(pid)
    {pid, id}
  end

  defp trace(nil, _id), do: nil
  defp trace({m, f, a}, id), do: {m, f, a ++ [id]}

  defp begin(id) do
    :ok = Pilot.start(id)
    :ok = Pilot.command(id, :start)
  end

  defp play({:kill, id}, s), do: if(id in alive(s), do: end_robot(s, id), else: s)
  defp play({:move, place}, s), do: move(s, place)

  defp move(s, place) do
    Server.move_landmark(s.server, place)
    written(s, :landmark_moved, nil, %{})
  end

  defp end_robot(s, id) do
    {pid, ^id} = Enum.find(s.robots, fn {_pid, robot} -> robot == id end)
    Process.exit(pid, :kill)
    wreck(s, pid)
  end

  defp wreck(s, pid) do
    {id, robots} = Map.pop!(s.robots, pid)
    Server.kill(s.server, id)
    written(%{s | robots: robots}, :killed, id, %{})
  end

  defp written(s, stage, id, facts),
    do: %{s | ledger: Ledger.stage(s.ledger, now(s.epoch_ms), stage, id, facts)}

  defp alive(s) do
    living = Map.values(s.robots)
    Enum.filter(s.setup.options.robots, &(&1 in living))
  end

  defp run(s) do
    %{
      at_ms: now(s.epoch_ms),
      options: s.setup.options,
      world: Server.world(s.server),
      ledger: s.ledger,
      claims: Map.new(claims(s)),
      messages: Air.counts(s.air)
    }
  end

  # As in lockstep, but read off the boards.
  defp claims(s), do: for(id <- alive(s), do: {id, claim(id)})

  defp claim(id) do
    with {:ok, board} <- Board.find(id),
         {:ok, %{state: state, claim: claim}, _at_ms} <- Board.fetch(board, :mission, :infinity) do
      case state do
        {Manual, phase} when phase not in [:ready, :done] -> Map.put(claim, :phase, :manual)
        _group_or_idle -> claim
      end
    else
      # Between the fall of a board and the next one.
      :error -> %{}
    end
  end

  defp schedule(s) do
    next = max(s.next + @period_ms, System.monotonic_time(:millisecond))
    Process.send_after(self(), :tick, next, abs: true)
    %{s | next: next}
  end
end
