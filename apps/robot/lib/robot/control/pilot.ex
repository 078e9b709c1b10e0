defmodule Robot.Control.Pilot do
  @moduledoc """
  Runs one robot's mission. Its state is `{:idle or {mission, phase}, data}`, so that
  `:sys.get_state/1` shows what the robot is doing. It carries out the mission's effects
  (`Robot.Control.Pilot.Effects`).

  It starts idle, and resets the executive: after a crash of the mission the robot stands until
  somebody starts a mission again.

  A mission does not handle stops. The pilot ends the mission, whatever its phase, and passes the
  stop to the executive, which drops its goal, and from there to the gate, after every older wish.
  Only the gate confirms the stop.

  The mission's callbacks may be foreign code. While one runs, the board has an entry `:asking`,
  so that `Robot.Safety.LivenessMonitor` detects one that does not return, and kills the pilot.

  Wheels that are disarmed end the mission, whoever disarms them and whoever arms them again
  (`arm: :manual` or `:auto`), and while they may not turn none starts (`Robot.Safety.Readiness`).
  So arming starts no motion.
  """
  use Hal.HardenedServer
  alias Hal.HardenedServer
  alias Robot.{Board, Mission, Names, Percept}
  alias Robot.Control.{Crash, Delivery, Executive, Inbox}
  alias Robot.Control.Pilot.{Effects, Journal}
  alias Robot.Mission.Runner
  alias Robot.Safety.{Gate, Readiness}
  alias Robot.Navigation.Grid

  # Generous, because a pilot may be slow on a busy machine.
  @call_ms 5_000
  # A percept that has waited longer than this is dropped; the next one is on its way.
  @old_ms 1_000

  @doc "Starts the pilot of a robot."
  @spec start_link(Robot.Config.t()) :: GenServer.on_start()
  def start_link(%Robot.Config{} = config),
    do:
      HardenedServer.start_link(__MODULE__, config,
        name: Names.via(config.id, :pilot),
        spawn_opt: [message_queue_data: :off_heap]
      )

  @doc """
  Starts the mission of the robot's config; it replaces a running one. If the wheels may not turn now,
  the error says why, in a line that does not name the robot.
  """
  @spec start(robot :: atom()) :: :ok | {:error, :no_mission | (line :: String.t())}
  def start(robot), do: call(robot, :start)

  @doc "Starts this mission, as `start/1` does."
  @spec start(robot :: atom(), module(), keyword()) ::
          :ok | {:error, :no_mission | (line :: String.t())}
  def start(robot, module, options), do: call(robot, {:start, module, options})

  @doc "Ends the mission. When this returns, the gate has dropped the wish; no older one follows."
  @spec stop(robot :: atom()) :: :ok
  def stop(robot), do: call(robot, :stop)

  @doc """
  The same for callers that must not wait. `then` is applied once it is done, and not at all if
  the pilot, the executive or the gate hangs or crashes meanwhile.
  """
  @spec halt(robot :: atom(), then :: Robot.Config.call() | nil) :: :ok
  def halt(robot, then \\ nil),
    do: GenServer.cast(Names.via(robot, :pilot), {:halt, then})

  @doc """
  Tells gate, executive and pilot at once to end what the robot does, so that one that hangs does not
  delay the others; `then` as in `halt/2`. The goal is dropped even if the pilot is stuck in its mission,
  and again when the mission has ended, because it may have set another one meanwhile.
  """
  @spec halt_at_once(robot :: atom(), then :: Robot.Config.call() | nil) :: :ok
  def halt_at_once(robot, then) do
    :ok = Gate.forget(robot)
    :ok = Executive.hold(robot)
    halt(robot, then)
  end

  @doc """
  Resumes the mission that the last stop ended, from its beginning, with the commands that it had
  kept (`c:Robot.Mission.halted/1`). `{:error, :idle}` if there is none, or if a mission runs; a line
  as of `start/1`.
  """
  @spec resume(robot :: atom()) :: :ok | {:error, :idle | (line :: String.t())}
  def resume(robot), do: call(robot, :resume)

  @doc "The map that the mission has made, also one that was stopped; `nil` of one that makes none."
  @spec map(robot :: atom()) :: Robot.Navigation.MapFile.Writer.raster() | nil
  def map(robot), do: call(robot, :map)

  @doc "Hands a command to the mission. `:ok` means that the mission got it, not that it is done."
  @spec command(robot :: atom(), command :: term()) :: :ok | {:error, :idle}
  def command(robot, command), do: call(robot, {:command, command})

  @doc """
  Hands a command to the mission; the caller does not wait, and the reply goes where the delivery
  says. The executive replies `:ok` once it has the mission's orders for the command, or the pilot
  replies with a refusal. There is no reply if one of them hangs or crashes meanwhile, or if the
  robot has no pilot on this node.
  """
  @spec deliver(robot :: atom(), command :: term(), Delivery.t()) :: :ok
  def deliver(robot, command, %Delivery{} = delivery) do
    with pid when is_pid(pid) <- Names.whereis(robot, :pilot),
         do: send(pid, {:deliver, delivery, {:command, command}})

    :ok
  end

  @doc """
  Passes an event of `Robot.Mission` to the mission: a tick, new walls or an outcome from the executive, or a
  message from another robot, which the sender of this event has checked. Of several waiting ticks
  only the newest is handled.
  """
  @spec hear(robot :: atom(), Robot.Mission.event() | {:walls, Grid.Packed.t() | nil}) :: :ok
  def hear(robot, event), do: GenServer.cast(Names.via(robot, :pilot), event)

  @doc "A sink for the drive: ends the mission when the wheels are disarmed."
  @spec sense(robot :: atom(), reading :: tuple()) :: :ok
  def sense(robot, {:arming, %{state: state}}) when state != :armed,
    do: GenServer.cast(Names.via(robot, :pilot), :disarmed)

  def sense(_robot, _reading), do: :ok

  defp call(robot, request), do: GenServer.call(Names.via(robot, :pilot), request, @call_ms)

  @impl GenServer
  def init(%Robot.Config{} = config) do
    data = %{
      config: config,
      board: Board.find!(config.id),
      runner: Runner.new(config.id, plan(config)),
      options: [],
      since_ms: Robot.Config.now(config)
    }

    # The former pilot may have crashed within a callback, and the executive may still have its
    # goal, or wait for the end of a mission that has ended so.
    Journal.answered(data.board)
    Journal.begun(data)
    Effects.drop_orders(config)
    Executive.stand(config.id)
    {:ok, {:idle, Journal.told(:idle, %{}, data)}}
  end

  # Walls that the sonars see come from the executive.
  defp plan(%{plan: %Grid{} = plan}), do: plan
  defp plan(_sonar_or_none), do: nil

  @impl GenServer
  def handle_call(:start, _from, {_state, %{config: %{mission: nil}}} = s),
    do: {:reply, {:error, :no_mission}, s}

  def handle_call(:start, from, {_state, %{config: %{mission: {module, options}}}} = s),
    do: handle_call({:start, module, options}, from, s)

  def handle_call({:start, module, options}, _from, {state, data} = s)
      when is_atom(module) and is_list(options),
      do: answer(begin(module, options, state, data), s)

  def handle_call(:stop, from, s), do: {:noreply, idle(s, {GenServer, :reply, [from, :ok]})}

  def handle_call(:resume, _from, {state, data} = s),
    do: answer(go(:resume, {:command, :start}, state, data), s)

  def handle_call(:map, _from, {_state, data} = s) do
    map = Journal.asking(data.runner.module, data, fn -> Runner.map(data.runner) end)
    {:reply, map, s}
  end

  def handle_call({:command, _command}, _from, {:idle, _data} = s),
    do: {:reply, {:error, :idle}, s}

  def handle_call({:command, _command} = event, _from, {{module, _phase} = state, data} = s),
    do: answer(go({:hand, module}, event, state, data), s)

  defp answer({:ok, state, data}, _s), do: {:reply, :ok, {state, data}}
  defp answer(error, s), do: {:reply, error, s}

  @impl GenServer
  def handle_cast({:halt, then}, s) do
    if HardenedServer.then?(then), do: {:noreply, idle(s, then)}, else: HardenedServer.drop(s)
  end

  def handle_cast(:disarmed, {_, %{config: %{dry_run: true}}} = s), do: {:noreply, s}
  def handle_cast(:disarmed, s), do: {:noreply, idle(s, nil)}

  # A mission is told only what `Robot.Mission` promises it.
  def handle_cast({:tick, %Percept{at_ms: at_ms}} = event, {state, data} = s)
      when is_integer(at_ms) do
    Journal.checkpoint(state, data)
    {:tick, percept} = event = newest(event)

    cond do
      old?(event, data.config) -> {:noreply, s}
      Inbox.percept?(percept) -> {:noreply, hand(event, s)}
      true -> HardenedServer.drop(s)
    end
  end

  def handle_cast({:message, message} = event, s) when is_map(message),
    do: {:noreply, hand(event, s)}

  def handle_cast({:outcome, _tag, outcome} = event, s) when is_integer(outcome),
    do: {:noreply, hand(event, s)}

  def handle_cast({:walls, packed} = event, {state, data} = s) do
    case Grid.Packed.unpack(packed) do
      {:ok, walls} ->
        Journal.heard(event, data)
        {:noreply, {state, %{data | runner: Runner.walls(data.runner, walls)}}}

      :error ->
        HardenedServer.drop(s)
    end
  end

  def handle_cast({:command, _command} = event, s), do: {:noreply, hand(event, s)}

  defp hand(_event, {:idle, _data} = s), do: s

  defp hand(event, {{module, _phase} = state, data}) do
    {:ok, state, data} = go({:hand, module}, event, state, data)
    {state, data}
  end

  @impl GenServer
  def handle_info({:deliver, delivery, {:command, _command} = event}, s) do
    if Inbox.delivery?(delivery), do: delivered(delivery, event, s), else: HardenedServer.drop(s)
  end

  defp delivered(%Delivery{reply: {m, f, a}} = delivery, event, {state, data} = s) do
    with :ok <- timely(delivery, data),
         {:ok, way} <- Delivery.way(delivery, state, data.runner.halted),
         {:ok, state, data} <- go(way, event, state, data) do
      # Only the executive can confirm that it has received the orders.
      Executive.confirm(data.config.id, {m, f, a ++ [:ok]})
      {:noreply, {state, data}}
    else
      refusal ->
        apply(m, f, a ++ [refusal])
        {:noreply, s}
    end
  end

  # A command is refused if its requester no longer waits, or if the robot is stopped or was
  # stopped after the request.
  defp timely(delivery, data) do
    cond do
      Hal.Clock.now_ms() >= delivery.until_ms -> {:error, :late}
      Board.latched?(data.board) -> {:error, :held}
      stopped?(delivery.asked, data.board) -> {:error, :stopped}
      true -> :ok
    end
  end

  defp stopped?(nil, _board), do: false

  defp stopped?(asked, board) do
    case Board.fetch(board, :stopped, :infinity) do
      {:ok, stopped, _at_ms} -> asked < stopped
      :error -> false
    end
  end

  # Passes an event to a mission by the way that was chosen.
  defp go({:hand, _module}, event, state, data),
    do: event |> handle(data) |> follow(state, data)

  defp go(:resume, event, state, data) do
    with {:ok, runner} <- Runner.resume(data.runner),
         :ok <- Readiness.of(data.config, data.board) do
      Journal.heard(:resume, data)
      Crash.over(data.board, :pilot)
      go({:hand, runner.module}, event, state, %{data | runner: runner})
    end
  end

  defp go({:start, module, options}, event, state, data) do
    with {:ok, state, data} <- begin(module, options, state, data),
         do: go({:hand, module}, event, state, data)
  end

  defp begin(module, options, state, data) do
    with {:ok, options} <- mission(module, options, data),
         :ok <- Readiness.of(data.config, data.board) do
      Journal.heard({:start, module, options}, data)
      Crash.over(data.board, :pilot)
      Effects.drop_orders(data.config)
      result = Journal.asking(module, data, fn -> Runner.start(data.runner, module, options) end)
      follow(result, state, %{data | options: options})
    end
  end

  defp mission(module, options, data) do
    cond do
      not (HardenedServer.callable?({module, :init, []}, 2) and
               function_exported?(module, :handle, 2)) ->
        {:error, :no_mission}

      not Keyword.keyword?(options) ->
        {:error, "expected options [key: value], got #{inspect(options, limit: 5)}"}

      Mission.checks?(module) ->
        Journal.asking(module, data, fn -> Mission.check_options(module, options, nil) end)

      # Programs start it, such as a calibration; people are refused earlier.
      true ->
        {:ok, options}
    end
  end

  # The board says idle before the answer. The mission is called last, because it cannot prevent
  # this.
  defp idle({state, data}, then) do
    Journal.heard(:stop, data)
    data = Journal.changed(state, :idle, %{}, data)
    Executive.stand(data.config.id, then)
    halted = Journal.asking(data.runner.module, data, fn -> Runner.halt(data.runner) end)
    {:idle, %{data | runner: halted}}
  end

  # Newer percepts may wait in this process's mailbox.
  defp newest({:tick, _percept} = tick) do
    receive do
      {:"$gen_cast", {:tick, %Percept{at_ms: at_ms}} = newer} when is_integer(at_ms) ->
        newest(newer)
    after
      0 -> tick
    end
  end

  # A robot that was frozen decides by what it perceives now: by its old percept a leader would
  # believe that its lease lasts.
  defp old?({:tick, %{at_ms: at_ms}}, config), do: Robot.Config.now(config) - at_ms > @old_ms

  defp handle(event, data) do
    Journal.heard(event, data)
    Journal.asking(data.runner.module, data, fn -> Runner.handle(data.runner, event) end)
  end

  defp follow({runner, effects}, before, data) do
    data = %{data | runner: runner}
    carry_out = fn -> Enum.each(effects, &Effects.carry_out(&1, data.config)) end
    Crash.told(data.config, data.board, :pilot, carry_out)
    state = Runner.state(runner)
    {:ok, state, Journal.changed(before, state, runner.claim, data)}
  end
end
