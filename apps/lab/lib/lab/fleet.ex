defmodule Lab.Fleet do
  @moduledoc """
  Runs a world and n robots in real time, so that `Swarm` commands them like any other, and any part of them may be
  killed: on this node (`Lab.Fleet.Local`), or each in a process of the operating system of its own (`Lab.Fleet.Nodes`).

  This process plays the script, keeps the run log, and answers viewers; its backend decides where
  world and robots run (`Lab.Fleet.Backend`).
  """
  use GenServer
  alias Hal.{Pose, Ticker}
  alias Lab.Fleet.{Local, Mission, Nodes, PendingStages}
  alias Lab.{Messages, Moment}
  alias Sim.{Radio, Scene, World}
  alias Lab.Trial.{Cuts, Evaluation, Event, Faults, Places, RunLog, Script, Setup, Termination}
  alias Swarm.Commands.Client
  alias Swarm.EStop.Broadcaster

  @period_ms 100
  # Of what happens to a fleet that may run for weeks.
  @kept 1_000

  @doc """
  Starts a fleet. All options have defaults: `robots`, `seed`, `map`, `landmark`, `formation`,
  `noise`, `loss` and the others of `Lab.Trial.Setup.new/1` (there is no time limit here); `script` and `cuts` are done to
  real processes, on one node only;
  `mission: false` for robots that wait for commands instead of starting their mission at once, or
  `mission: {module, options}` for another `Robot.Mission` than the search for the landmark;
  `nodes: true` for robots and world in processes of the operating system of their own; `trace` as
  in `Robot.Config`, called with the robot's id first, on one node.

      {:ok, fleet} = Lab.Fleet.start_link()
      {:ok, fleet} = Lab.Fleet.start_link(robots: [:mag1, :mag2, :min1], map: "hospital", mission: false)
      Lab.Fleet.kill(fleet, :leader)
      Lab.Fleet.move_landmark(fleet, {3.0, 2.0})
  """
  @spec start_link(keyword() | map()) :: {:ok, pid()} | {:error, line :: String.t()}
  def start_link(options \\ []) do
    options = Map.new(options)
    {own, options} = Map.split(options, [:mission, :trace, :nodes])
    backend = if own[:nodes], do: Nodes, else: Local

    with {:ok, setup} <- Setup.new(options),
         :ok <- possible(setup.options, backend),
         {:ok, setup, begin?} <-
           Mission.choose(setup, Map.get(own, :mission, true), backend == Nodes),
         :ok <- free(setup.options.robots) do
      {:ok, _apps} = Application.ensure_all_started(:swarm)
      # Else a hundred robots ask for them one by one, each in a callback of its mission.
      :ok = Swarm.MissionRegistry.load(:lab)
      answer = make_ref()
      start = {setup, backend, Map.put(own, :mission, begin?), {self(), answer}}

      # A fleet that could not start ends normally, and has said why.
      with :ignore <- GenServer.start_link(__MODULE__, start) do
        receive do
          {^answer, line} -> {:error, line}
        end
      end
    end
  end

  defp possible(%{casts: :drawn}, _backend),
    do: {:error, "casts: :drawn is for runs in lockstep; processes hear each other as they are"}

  # Processes of their own are frozen, cut off and killed by other means (`bin/soak`).
  defp possible(options, Nodes) when options.script != [] or options.cuts != [] do
    {:error,
     "robots in processes of their own take no script and no cuts: only those on one node do"}
  end

  defp possible(_options, _backend), do: :ok

  @doc "The current scene for viewers."
  @spec scene(GenServer.server()) :: Scene.t()
  def scene(fleet), do: GenServer.call(fleet, :scene, :infinity)

  @doc "The report of the run so far, without its wall time."
  @spec result(GenServer.server()) :: map()
  def result(fleet), do: GenServer.call(fleet, :result, :infinity)

  @doc "The fleet as it was at its last look, a tenth of a second ago at most, for what judges a run."
  @spec moment(GenServer.server()) :: Moment.t()
  def moment(fleet), do: GenServer.call(fleet, :moment, :infinity)

  @doc "Kills a robot, or the leader: all its processes at once, as if its power failed."
  @spec kill(GenServer.server(), atom() | :leader) :: :ok | {:error, line :: String.t()}
  def kill(fleet, who), do: GenServer.call(fleet, {:kill, who})

  @doc "Lets the landmark glide to a place; `nil` removes it."
  @spec move_landmark(GenServer.server(), Pose.point() | nil) ::
          :ok | {:error, line :: String.t()}
  def move_landmark(fleet, place), do: GenServer.call(fleet, {:move, place})

  @doc """
  Puts a robot that lives, or an object by its name, such as `"ball1"`, elsewhere, as a person who lifts it; its wheels do
  not count that. The error says in one line why it cannot be there.
  """
  @spec place(GenServer.server(), atom() | String.t(), Pose.point()) ::
          :ok | {:error, line :: String.t()}
  def place(fleet, who, place), do: GenServer.call(fleet, {:place, {who, place}})

  @doc "What its robots have said to each other of late; the error says in one line why that is not known."
  @spec messages(GenServer.server()) :: {:ok, [Messages.entry()]} | {:error, line :: String.t()}
  def messages(fleet), do: GenServer.call(fleet, :messages, :infinity)

  @doc "Adds to that what a person wrote to robots, and they took."
  @spec written(GenServer.server(), :all | [atom()], String.t()) :: :ok
  def written(fleet, to, text), do: GenServer.cast(fleet, {:written, to, text})

  @doc "The robots that live, in the order of the fleet."
  @spec living(GenServer.server()) :: [atom()]
  def living(fleet), do: GenServer.call(fleet, :living)

  @doc """
  Why the run has ended before its time, in one line, such as a world that ends again and again;
  `nil` as long as it has not. What was known then can still be asked.
  """
  @spec ended(GenServer.server()) :: String.t() | nil
  def ended(fleet), do: GenServer.call(fleet, :ended, :infinity)

  @doc "Whether the run is over, as defined by `Lab.Trial.Termination`, or has ended before."
  @spec done?(GenServer.server()) :: boolean()
  def done?(fleet), do: GenServer.call(fleet, :done?, :infinity)

  @doc "How to reach the fleet's processes of the operating system, one line each."
  @spec lines(GenServer.server()) :: [String.t()]
  def lines(fleet), do: GenServer.call(fleet, :lines, :infinity)

  @doc "Ends the whole fleet."
  @spec stop(GenServer.server()) :: :ok
  def stop(fleet), do: GenServer.stop(fleet)

  @impl GenServer
  def init({setup, module, own, {caller, answer}}) do
    # So that `terminate/2` runs, and a crash of the parts is noticed.
    Process.flag(:trap_exit, true)

    case module.start(setup, Keyword.take(Map.to_list(own), [:trace])) do
      {:ok, backend} ->
        s = begun(setup, {module, backend}, Hal.Clock.now_ms())
        # Before any other order can arrive: this start would take its place.
        if own.mission, do: ask(s, :begin)
        {:ok, s}

      {:error, line} ->
        send(caller, {answer, line})
        :ignore
    end
  end

  defp begun(%Setup{options: options} = setup, backend, epoch_ms) do
    %{
      setup: setup,
      backend: backend,
      epoch_ms: epoch_ms,
      script: Script.new(options.moves, options.kills, options.script),
      severed: [],
      faults: %Faults{},
      ways: [],
      run_log: RunLog.new(elem(setup.mission, 0), @kept),
      messages: %Messages{},
      said: [],
      ended: nil,
      ticker: Ticker.start(:tick, @period_ms, @period_ms)
    }
  end

  @impl GenServer
  def handle_call(:scene, _from, s), do: {:reply, s |> run() |> Evaluation.scene(), s}

  def handle_call(:moment, _from, s) do
    claims = ask(s, :claims)
    parts = parts(s, s.faults |> Faults.awake(claims, now(s)) |> Keyword.keys())
    {:reply, s |> run() |> Map.put(:faults, s.faults) |> Moment.of_processes(claims, parts), s}
  end

  def handle_call(:result, _from, s), do: {:reply, s |> run() |> Evaluation.result(), s}

  def handle_call(:messages, _from, %{backend: {Nodes, _backend}} = s) do
    line = "what robots in processes of their own say to each other does not come by here"
    {:reply, {:error, line}, s}
  end

  def handle_call(:messages, _from, s), do: {:reply, {:ok, Messages.list(s.messages)}, s}
  def handle_call(:living, _from, s), do: {:reply, ask(s, :living), s}
  def handle_call(:lines, _from, s), do: {:reply, ask(s, :lines), s}

  def handle_call(:ended, _from, %{ended: nil} = s), do: {:reply, nil, s}
  def handle_call(:ended, _from, %{ended: {line, _at_ms}} = s), do: {:reply, line, s}
  def handle_call(:done?, _from, %{ended: {_line, _at_ms}} = s), do: {:reply, true, s}

  def handle_call(:done?, _from, s),
    do: {:reply, s |> run() |> Map.put(:script, s.script) |> Termination.reached?(), s}

  def handle_call({what, _which}, _from, %{ended: {line, _at_ms}} = s)
      when what in [:kill, :move, :place],
      do: {:reply, {:error, "the run has ended: #{line}"}, s}

  def handle_call({:kill, :leader}, from, s) do
    case RunLog.leader(s.run_log) do
      nil -> {:reply, {:error, "there is no leader to kill yet"}, s}
      leader -> handle_call({:kill, leader}, from, s)
    end
  end

  def handle_call({:kill, id}, _from, s) do
    living = ask(s, :living)

    with :ok <- lives(id, living) do
      {:reply, :ok, play({:kill, id}, s)}
    else
      error -> {:reply, error, s}
    end
  end

  def handle_call({:move, place}, _from, s) do
    with :ok <- Places.check_landmarks(s.setup.map, [place]) do
      {:reply, :ok, play({:move, place}, s)}
    else
      error -> {:reply, error, s}
    end
  end

  def handle_call({:place, {who, place}}, _from, s) do
    with :ok <- lives(who, ask(s, :living)),
         {:ok, event} <- Places.put(ask(s, :world), who, place) do
      {:reply, :ok, play(event, s)}
    else
      error -> {:reply, error, s}
    end
  end

  @impl GenServer
  def handle_cast({:written, to, text}, s),
    do: {:noreply, %{s | messages: Messages.person(s.messages, now(s), to, text)}}

  @impl GenServer
  def handle_info(:tick, %{ended: {_line, _at_ms}} = s), do: {:noreply, s}

  def handle_info(:tick, s) do
    now = now(s)
    claims = ask(s, :claims)
    heard = Faults.awake(s.faults, claims, now)
    worst = fn leader -> s |> run() |> Evaluation.worst(leader) end
    followers = fn -> s |> run() |> Evaluation.followers() end
    {told, said} = PendingStages.look(s.said, heard, s.run_log.roles)
    parts = parts(s, Keyword.keys(claims))

    run_log =
      s.run_log
      |> RunLog.held(now, claims)
      |> RunLog.note(now, heard, parts)
      |> RunLog.judge(now, heard, worst)
      |> RunLog.watch(now, followers)
      |> tell(now, told)

    {events, script} = Script.due(s.script, now(s), RunLog.leader(run_log))
    s = Enum.reduce(events, %{s | run_log: run_log, said: said, script: script}, &play/2)
    {:noreply, s |> cut(now) |> schedule()}
  end

  def handle_info({:sent, from, to, message}, s),
    do: {:noreply, %{s | messages: Messages.note(s.messages, now(s), [{from, to, message}])}}

  def handle_info({:refused, command, refusals}, s) do
    refused = for {id, why} <- refusals, do: {:order_refused, id, command, why}
    {:noreply, Enum.reduce(refused, s, &told/2)}
  end

  def handle_info(message, %{backend: {module, backend}} = s) do
    case module.hear(backend, message) do
      {:ok, events, backend} ->
        {:noreply, Enum.reduce(events, %{s | backend: {module, backend}}, &note/2)}

      {:ended, line, backend} ->
        {:noreply, %{s | backend: {module, backend}, ended: s.ended || {line, now(s)}}}

      {:stop, reason} ->
        {:stop, reason, s}
    end
  end

  @impl GenServer
  def terminate(_reason, s), do: ask(s, :stop)

  defp free(robots) do
    case Enum.filter(robots, &(Process.whereis(Robot.Names) && Robot.Names.whereis(&1, :robot))) do
      [] -> :ok
      taken -> {:error, "#{list(taken)} on this node already; stop that fleet first"}
    end
  end

  defp list([]), do: "no robot lives"
  defp list([one]), do: "#{one} lives"
  defp list(robots), do: "#{Enum.join(robots, ", ")} live"

  # Nothing more can happen to a robot that was killed.
  defp lives(id, living) do
    if is_binary(id) or id in living,
      do: :ok,
      else: {:error, "no robot #{inspect(id)} lives here; #{list(living)}"}
  end

  defp play(event, s) do
    id = Event.robot(event)
    if id in [nil, :all] or id in ask(s, :living), do: happen(event, s), else: s
  end

  defp happen({:kill, id}, s), do: note({:killed, id}, become(s, :kill, [id]))

  defp happen({:displace, id, {x, y, degrees}} = event, s) do
    pose = Pose.new(x, y, degrees * :math.pi() / 180)

    if World.Bodies.occupied?(ask(s, :world), id, {x, y}),
      do: note({:stage, :not_displaced, id, %{}}, s),
      else: told(event, become(s, :change, [{:displace, id, pose}]))
  end

  defp happen({:place, id, {x, y, degrees}} = event, s) do
    pose = Pose.new(x, y, degrees * :math.pi() / 180)

    case World.Pushing.place(ask(s, :world), id, pose) do
      {:ok, _world} -> told(event, become(s, :change, [{:place, id, pose}]))
      {:error, _line} -> note({:stage, :not_placed, nil, %{object: id}}, s)
    end
  end

  defp happen(event, s), do: told(event, change(event, s))

  defp told(event, s) do
    {stage, robot, facts} = Event.stage(event)
    note({:stage, stage, robot, facts}, s)
  end

  defp change({:move, place}, s), do: become(s, :change, [{:move, place}])
  defp change({:remove_landmark}, s), do: become(s, :change, [{:move, nil}])
  defp change({:loss, share}, s), do: become(s, :radio, [{:lose, share}])
  defp change({:cut, what}, s), do: %{s | severed: s.severed ++ [{0, :end, what}]}
  defp change({:join}, s), do: %{s | severed: []}

  defp change({:tell, to, command}, s) do
    fleet = self()
    refused = &send(fleet, {:refused, command, &1})
    order(s, to, Event.request(command, s.setup.options.robots), refused)
  end

  defp change({:estop, id}, s), do: order(s, id, :estop)
  defp change({:reset}, s), do: order(s, :all, :reset)
  defp change({kind, _id, _role} = event, s) when kind == :crash, do: become(s, :suffer, [event])
  defp change({:hang, _id, _role, _for_s} = event, s), do: become(s, :suffer, [event])

  defp change({kind, id, for_s} = event, s) do
    now = now(s)
    to_ms = now + round(for_s * 1000)
    s = %{s | faults: Faults.add(s.faults, Faults.kind(kind), id, now, to_ms)}
    if kind == :deaf, do: s, else: become(s, :suffer, [event])
  end

  # A person's order: `refused` is called with those that do not accept it, and why.
  defp order(s, to, request, refused \\ fn _refusals -> :ok end) do
    robots = if to == :all, do: ask(s, :living), else: [to]
    if request == :reset, do: Broadcaster.quiet(:all)
    ask = fn -> refused.(Client.refusals(robots, Client.ask(robots, request))) end
    {:ok, _pid} = Task.start(ask)
    s
  end

  # Puts into effect which robots are cut off from now on.
  defp cut(%{setup: %{options: options}} = s, now) do
    ways =
      Cuts.ways(options.cuts ++ s.severed, options.robots, now) ++
        Faults.ways(s.faults, options.robots, now)

    if ways == s.ways, do: s, else: become(%{s | ways: ways}, :radio, [{:cut_ways, ways}])
  end

  defp parts(%{ways: []}, _ids), do: nil
  defp parts(s, ids), do: [seed: 0] |> Radio.new() |> Radio.cut_ways(s.ways) |> Radio.parts(ids)

  defp note({:killed, id}, s), do: note({:stage, :killed, id, %{}}, s)

  defp note({:stage, stage, id, facts}, s) do
    if PendingStages.waits?(stage, s.run_log.roles),
      do: %{s | said: PendingStages.hear(s.said, {stage, id, facts})},
      else: %{s | run_log: RunLog.stage(s.run_log, now(s), stage, id, facts)}
  end

  # At the same time as the claims that show them.
  defp tell(run_log, at_ms, stages) do
    Enum.reduce(stages, run_log, fn {stage, id, facts}, run_log ->
      RunLog.stage(run_log, at_ms, stage, id, facts)
    end)
  end

  defp run(s) do
    %{
      at_ms: now(s),
      options: s.setup.options,
      world: ask(s, :world),
      run_log: s.run_log,
      claims: Map.new(ask(s, :claims)),
      messages: ask(s, :messages)
    }
  end

  # The time of a run stands still when it has ended.
  defp now(%{ended: {_line, at_ms}}), do: at_ms
  defp now(%{epoch_ms: epoch_ms}), do: Hal.Clock.now_ms() - epoch_ms

  defp ask(%{backend: {module, backend}}, what), do: apply(module, what, [backend])

  defp become(%{backend: {module, backend}} = s, what, arguments),
    do: %{s | backend: {module, apply(module, what, [backend | arguments])}}

  defp schedule(s), do: %{s | ticker: Ticker.next(s.ticker)}
end
