defmodule Robot.Control.Executive do
  @moduledoc """
  Takes a percept from the board ten times a second, runs a tick of `Robot.Control.Controller`, and sends its wish to
  the gate and the percept to the pilot. It only casts to other parts of the robot, so none of them can block it; what
  takes long, such as vision, is a process of its own that writes to the board.

  A behaviour that hangs blocks the executive. `Robot.Safety.LivenessMonitor` detects that and
  kills it.

  A goal is for now: while the wheels may not turn it is refused (`Robot.Safety.Readiness`), and when
  they are disarmed, by whatever, it is dropped, so that arming starts nothing. An executive that is held (`hold/1`) refuses
  goals while a mission is being ended; a robot that is held is one that an e-stop holds (`docs/glossary.md`).

  It starts idle: its state contains the goal, which a crash loses. At its start it makes the gate
  drop the wish of its predecessor.
  """
  use Hal.HardenedServer
  alias Hal.{Device, Event, HardenedServer, Odometry, Ticker}
  alias Robot.{Board, Departure, Mission, Names, Percept}
  alias Robot.Control.{Controller, Crash, Inbox}
  alias Robot.Trace
  alias Robot.Safety.{DryRun, Gate, Readiness}

  @period_ms 100
  @slow_us 50_000
  @call_ms 400

  @doc """
  Starts the executive of a robot. It passes each percept, as `{:tick, percept}`, the walls that it knows when they
  change, as `{:walls, packed}`, and each outcome of a goal, as `{:outcome, tag, integer}`, to the sink:
  `apply(m, f, a ++ [event])`.
  """
  @spec start_link({Robot.Config.t(), sink :: Robot.Config.call()}) :: GenServer.on_start()
  def start_link({%Robot.Config{} = config, {_m, _f, _a} = sink}) do
    name = Names.via(config.id, :executive)
    HardenedServer.start_link(__MODULE__, {config, sink}, name: name)
  end

  @doc """
  Sets, changes or (`nil`) drops the goal, as in `Robot.Control.Controller.goal/3`. The error is a
  line: no such robot runs on this node, the goal is not a behaviour, or it does not accept these
  options, the wheels may not turn now, a mission is being ended (`hold/1`), or the executive has not
  answered within 400 ms.
  """
  @spec goal(robot :: atom(), tag :: term(), {module(), keyword()} | nil) ::
          :ok | {:error, line :: String.t()}
  def goal(robot, tag, goal) do
    with :ok <- Robot.Behaviour.check(goal) do
      if Names.whereis(robot, :executive),
        do: ask(robot, {:goal, tag, goal}),
        else: {:error, "no robot #{inspect(robot)} runs on this node"}
    end
  end

  defp ask(robot, order) do
    GenServer.call(Names.via(robot, :executive), order, @call_ms)
  catch
    :exit, {_timeout_or_gone, {GenServer, :call, _call}} -> {:error, "#{robot} does not answer"}
  end

  @doc "Sends an order of the mission; its goals have been checked (`Robot.Mission.Runner`)."
  @spec obey(robot :: atom(), Mission.order()) :: :ok
  def obey(robot, order), do: cast(robot, {:obey, order})

  @doc """
  Applies `then` in the executive, once it has handled all that this process sent before. An
  executive that hangs never does.
  """
  @spec confirm(robot :: atom(), then :: Robot.Config.call()) :: :ok
  def confirm(robot, {_m, _f, _a} = then), do: cast(robot, {:confirm, then})

  @doc """
  Drops the goal at once, and every goal that comes until the pilot, which is told to end the
  mission at the same time, says `stand/2`. A mission that runs late, or hangs, could otherwise
  set a goal after the stop. Until then nothing is confirmed.
  """
  @spec hold(robot :: atom()) :: :ok
  def hold(robot), do: cast(robot, :hold)

  @doc """
  Drops the goal and all other orders of the mission, and makes the gate drop the wish, after all
  earlier wishes of the executive; then the gate applies `then`. Ends `hold/1`.
  """
  @spec stand(robot :: atom(), then :: Robot.Config.call() | nil) :: :ok
  def stand(robot, then \\ nil), do: cast(robot, {:stand, then})

  @doc "A sink for the drive: holds the executive (`hold/1`) when the wheels are disarmed."
  @spec sense(robot :: atom(), reading :: tuple()) :: :ok
  def sense(robot, {:arming, %{state: state}}) when state != :armed, do: cast(robot, :disarmed)
  def sense(_robot, _reading), do: :ok

  defp cast(robot, message), do: GenServer.cast(Names.via(robot, :executive), message)

  @impl GenServer
  def init({%Robot.Config{id: id} = config, sink}) do
    Gate.forget(id)
    board = Board.find!(id)
    at_ms = Robot.Config.now(config)
    doing = %{by: :idle, weights: [], way: [], limits: [], outcome: nil, fault: nil, tick: 0}
    Board.put(board, :executive, :doing, doing, at_ms)
    Board.put(board, :executive, :goal, nil, at_ms)
    Event.execute([:robot, :executive, :start], %{at_ms: at_ms}, %{robot: id})
    departed = Board.departed(board)

    s = %{
      config: config,
      board: board,
      sink: sink,
      controller:
        Controller.new(
          profile: config.profile,
          start: config.start,
          departed: departed,
          plan: config.plan
        ),
      departure: if(departed, do: {:was, departed}, else: {:near, nil}),
      told: nil,
      held?: false,
      tick: 0,
      ticker: Robot.Config.ticker(config, :tick, @period_ms)
    }

    Trace.begin(config, :executive, state(s), at_ms)
    {:ok, s}
  end

  @impl GenServer
  def handle_call({:goal, _tag, _goal} = order, _from, s) do
    cond do
      not Inbox.order?(order) -> HardenedServer.drop(s)
      refusal = refusal(order, s) -> {:reply, refusal, s}
      true -> {:reply, :ok, obeyed(s, order)}
    end
  end

  @impl GenServer
  def handle_cast({:confirm, _then}, %{held?: true} = s), do: {:noreply, s}

  def handle_cast({:obey, order}, s) do
    cond do
      not Inbox.order?(order) -> HardenedServer.drop(s)
      refusal(order, s) -> {:noreply, s}
      true -> {:noreply, obeyed(s, order)}
    end
  end

  def handle_cast({:confirm, {m, f, a} = then}, s) do
    if HardenedServer.callable?(then) do
      apply(m, f, a)
      {:noreply, s}
    else
      HardenedServer.drop(s)
    end
  end

  def handle_cast(:hold, s), do: {:noreply, hold_on(s)}
  def handle_cast(:disarmed, %{config: %{dry_run: true}} = s), do: {:noreply, s}
  # The pilot, which is told too, ends the mission; one that hangs may still set a goal meanwhile.
  def handle_cast(:disarmed, s), do: {:noreply, hold_on(s)}

  def handle_cast({:stand, then}, s) do
    if HardenedServer.then?(then),
      do: {:noreply, %{drop(s, then) | held?: false}},
      else: HardenedServer.drop(s)
  end

  defp hold_on(s), do: %{drop(s, nil) | held?: true}

  defp refusal({:goal, _tag, {_module, _options}}, %{held?: true}),
    do: {:error, "its mission is being ended"}

  defp refusal({:goal, _tag, {_module, _options}}, s) do
    with :ok <- Readiness.armed(s.config, s.board), do: nil
  end

  defp refusal(_order, _s), do: nil

  defp obeyed(s, order) do
    at_ms = Robot.Config.now(s.config)
    Trace.input(s.config, :executive, order, at_ms)
    {controller, pan} = Controller.obey(s.controller, order)
    s |> pursue(controller) |> look(pan, at_ms)
  end

  @impl GenServer
  def handle_info(:tick, s) do
    begun = System.monotonic_time(:microsecond)
    s = Crash.told(s.config, s.board, :executive, fn -> tick(s, Robot.Config.now(s.config)) end)
    took = System.monotonic_time(:microsecond) - begun

    if took > @slow_us do
      measured = %{at_ms: Robot.Config.now(s.config), duration_ms: div(took, 1_000)}
      Event.execute([:robot, :executive, :slow], measured, %{robot: s.config.id})
    end

    {:noreply, schedule(s)}
  end

  defp state(%{config: config} = s),
    do: {s.controller, %{looks: config.ptz != nil and not config.dry_run}}

  defp drop(s, then) do
    Trace.input(s.config, :executive, :stand, Robot.Config.now(s.config))
    Gate.forget(s.config.id, then)
    pursue(s, Controller.stand(s.controller))
  end

  # The goal is on the board before its first tick, so that a hang in that tick can be attributed.
  defp pursue(%{controller: %{module: module}} = s, %{module: module} = controller),
    do: %{s | controller: controller}

  defp pursue(s, controller) do
    if controller.module, do: Crash.over(s.board, :executive)
    Board.put(s.board, :executive, :goal, controller.module, Robot.Config.now(s.config))
    %{s | controller: controller}
  end

  defp tick(%{config: config, board: board} = s, at_ms) do
    raw = Percept.Snapshot.take(board, config.profile, at_ms)
    Trace.checkpoint(config, :executive, fn -> state(s) end, at_ms)
    Trace.input(config, :executive, {:tick, raw}, at_ms)
    {wish, outcome, controller} = Controller.tick(s.controller, raw)
    percept = Controller.percept(controller)

    Gate.wish(config.id, wish.twist)
    Trace.effect(config, :executive, {:wish, wish}, at_ms)
    s = look(s, wish.look, at_ms)

    fault = fault(s, Controller.fault(controller), at_ms)

    doing = %{
      by: wish.by,
      weights: Controller.weights(controller),
      way: Controller.way(controller),
      limits: Controller.limits(controller),
      outcome: outcome,
      fault: fault,
      tick: s.tick + 1
    }

    Board.put(board, :executive, :doing, doing, at_ms)
    if percept.pose, do: place(board, percept, at_ms)

    # The outcome comes first, so that the mission knows it when it handles the percept.
    with {tag, outcome} <- outcome, do: tell(s, {:outcome, tag, outcome}, at_ms)
    for event <- Controller.report(s.controller, controller), do: tell(s, event, at_ms)
    s = depart(s, percept.odometry)
    %{s | controller: controller, tick: doing.tick}
  end

  # By the first reading of the odometry the localiser knows whether the start pose is its zero.
  defp depart(s, nil), do: s
  defp depart(%{config: %{departure_file: nil}} = s, _odometry), do: s
  defp depart(%{departure: :noted} = s, _odometry), do: s

  defp depart(%{departure: {:was, noted}} = s, %Odometry{frame: frame}) do
    if not Departure.start?(noted, frame) do
      measured = %{at_ms: Robot.Config.now(s.config)}
      Event.execute([:robot, :executive, :away], measured, %{robot: s.config.id})
    end

    %{s | departure: :noted}
  end

  # After a counter jump the place is unknown, so the frame of the last reading near zero is noted.
  defp depart(%{departure: {:near, frame}} = s, %Odometry{pose: pose} = odometry) do
    if Departure.left?(pose) do
      Board.depart(s.board, frame || Departure.frame(nil))
      %{s | departure: :noted}
    else
      %{s | departure: {:near, Departure.frame(odometry.frame)}}
    end
  end

  defp place(board, %{pose: pose, uncertainty: uncertainty}, at_ms) do
    Board.put(board, :executive, :pose, pose, at_ms)
    Board.put(board, :executive, :uncertainty, uncertainty, at_ms)
  end

  # Reports a fault when it changes.
  defp fault(s, line, at_ms) do
    if line != Controller.fault(s.controller),
      do: Event.execute([:robot, :fault], %{at_ms: at_ms}, %{robot: s.config.id, line: line})

    line
  end

  defp look(%{config: %{ptz: ptz}} = s, pan, _at_ms) when pan == nil or ptz == nil, do: s

  defp look(%{config: %{dry_run: true}} = s, pan, at_ms),
    do: told(s, DryRun.tell(s.config.id, {:look, pan}, s.told), at_ms)

  defp look(%{config: config} = s, pan, at_ms) do
    Device.look(Names.via(config.id, :ptz), pan * 1.0, 0.0)
    Trace.effect(config, :executive, {:look, pan}, at_ms)
    s
  end

  defp told(s, {effects, line}, at_ms) do
    for {:event, name, about} <- effects,
        do: Event.execute(name, %{at_ms: at_ms}, Map.put(about, :robot, s.config.id))

    %{s | told: line}
  end

  defp tell(%{sink: {m, f, a}} = s, event, at_ms) do
    apply(m, f, a ++ [event])
    Trace.effect(s.config, :executive, event, at_ms)
  end

  defp schedule(s), do: %{s | ticker: Ticker.next(s.ticker)}
end
