defmodule Robot.Control.Pilot do
  @moduledoc """
  Runs one robot's mission. A `gen_statem` whose state is `:idle` or `{mission, phase}`, so that
  `:sys.get_state/1` shows what the robot is up to. It carries the mission's effects out
  (`Robot.Control.Pilot.Effects`) and decides nothing.

  It starts idle, and tells the executive so: after a failure in the mission the robot stands
  until a person starts it again.

  A stop is not the mission's to interpret. The pilot takes the mission out of command, whatever it is
  at, and the stop goes on to the executive, which drops its goal, and from there to the gate, after
  every older wish. Only the gate says that it is done.

  The mission's callbacks are somebody else's code. While one is called, the board says so under `:asking`, so that
  `Robot.Safety.LivenessMonitor` sees one that never returns, and ends the pilot.

  Where a person arms the wheels (`arm: :manual`), every change of that ends what the robot is at: when they
  are disarmed or lost, and when they are armed again, which is never the start of a motion.
  """
  @behaviour :gen_statem
  alias Robot.{Board, Config, Names}
  alias Robot.Control.{Delivery, Executive}
  alias Robot.Control.Pilot.{Effects, Journal}
  alias Robot.Mission.Runner

  # On a busy machine a pilot is slow, not gone.
  @call_ms 5_000

  @doc "A child of the robot's supervisor."
  @spec child_spec(Config.t()) :: Supervisor.child_spec()
  def child_spec(config), do: %{id: __MODULE__, start: {__MODULE__, :start_link, [config]}}

  @doc "Starts the pilot of a robot."
  @spec start_link(Config.t()) :: :gen_statem.start_ret()
  def start_link(%Config{} = config),
    do: :gen_statem.start_link(Names.via(config.id, :pilot), __MODULE__, config, [])

  @doc "Starts the mission of the robot's config, in place of a running one."
  @spec start(robot :: atom()) :: :ok | {:error, :no_mission}
  def start(robot), do: call(robot, :start)

  @doc "Starts a mission, in place of a running one."
  @spec start(robot :: atom(), module(), keyword()) :: :ok | {:error, :no_mission}
  def start(robot, module, options), do: call(robot, {:start, module, options})

  @doc "Ends the mission. When this returns, the gate has been told to stand, and no older wish follows."
  @spec stop(robot :: atom()) :: :ok
  def stop(robot), do: call(robot, :stop)

  @doc """
  The same for those who must not wait. Once it is done, `then` is applied; never, where the pilot, the
  executive or the gate hangs or falls meanwhile.
  """
  @spec halt(robot :: atom(), then :: Config.call() | nil) :: :ok
  def halt(robot, then \\ nil),
    do: :gen_statem.cast(Names.via(robot, :pilot), {:halt, then})

  @doc """
  Takes up the mission that the last stop has ended, from its beginning, with what people had asked of it
  (`c:Robot.Mission.halted/1`). `{:error, :idle}` where there is nothing to take up.
  """
  @spec resume(robot :: atom()) :: :ok | {:error, :idle}
  def resume(robot), do: call(robot, :resume)

  @doc "Hands a command to the mission. `:ok` means that it has it, not that it is done."
  @spec command(robot :: atom(), command :: term()) :: :ok | {:error, :idle}
  def command(robot, command), do: call(robot, {:command, command})

  @doc """
  Hands a command to the mission for somebody else, who is told what became of it; the caller does not wait. The
  executive replies `:ok`, once it has what the mission made of the command, and the pilot a refusal; nobody, where one of them
  hangs or falls meanwhile.
  """
  @spec deliver(robot :: atom(), command :: term(), Delivery.t()) :: :ok
  def deliver(robot, command, %Delivery{} = delivery) do
    with pid when is_pid(pid) <- Names.whereis(robot, :pilot),
         do: send(pid, {:deliver, delivery, {:command, command}})

    :ok
  end

  @doc """
  An event of `Robot.Mission`: a tick or an outcome from the executive, a message from another robot,
  checked by whoever heard it. Of several ticks that wait, only the newest is handled.
  """
  @spec hear(robot :: atom(), Robot.Mission.event()) :: :ok
  def hear(robot, event), do: :gen_statem.cast(Names.via(robot, :pilot), event)

  @doc "A sink for the drive: that the wheels may turn, or may no longer, is the pilot's affair, too."
  @spec sense(robot :: atom(), reading :: tuple()) :: :ok
  def sense(robot, {:arming, %{state: state}}),
    do: :gen_statem.cast(Names.via(robot, :pilot), {:arming, state})

  def sense(_robot, _reading), do: :ok

  defp call(robot, request), do: :gen_statem.call(Names.via(robot, :pilot), request, @call_ms)

  @impl :gen_statem
  def callback_mode, do: :handle_event_function

  @impl :gen_statem
  def init(%Config{} = config) do
    data = %{
      config: config,
      board: Board.find!(config.id),
      runner: Runner.new(config.id),
      since_ms: Config.now(config)
    }

    # The pilot before this one may have ended within its mission, and the executive may still follow a goal of it.
    Journal.answered(data.board)
    Effects.rest(config)
    {:ok, :idle, Journal.told(:idle, %{}, data)}
  end

  @impl :gen_statem
  def handle_event({:call, from}, :start, _state, %{config: %{mission: nil}}),
    do: {:keep_state_and_data, [{:reply, from, {:error, :no_mission}}]}

  def handle_event({:call, from}, :start, state, %{config: %{mission: {module, options}}} = data),
    do: handle_event({:call, from}, {:start, module, options}, state, data)

  def handle_event({:call, from}, {:start, module, options}, state, data) do
    case begin(module, options, state, data) do
      {:ok, state, data} -> {:next_state, state, data, [{:reply, from, :ok}]}
      error -> {:keep_state_and_data, [{:reply, from, error}]}
    end
  end

  def handle_event({:call, from}, :stop, state, data),
    do: halt(state, {:gen_statem, :reply, [from, :ok]}, data)

  def handle_event(:cast, {:halt, then}, state, data), do: halt(state, then, data)

  def handle_event(:cast, {:arming, _state}, state, %{config: config} = data) do
    if config.arm == :manual and not config.dry_run,
      do: halt(state, nil, data),
      else: :keep_state_and_data
  end

  def handle_event({:call, from}, :resume, state, data) do
    case go(:resume, {:command, :start}, state, data) do
      {:ok, state, data} -> {:next_state, state, data, [{:reply, from, :ok}]}
      error -> {:keep_state_and_data, [{:reply, from, error}]}
    end
  end

  def handle_event({:call, from}, {:command, _command}, :idle, _data),
    do: {:keep_state_and_data, [{:reply, from, {:error, :idle}}]}

  def handle_event({:call, from}, {:command, _command} = event, {module, _} = state, data) do
    {:ok, state, data} = go({:hand, module}, event, state, data)
    {:next_state, state, data, [{:reply, from, :ok}]}
  end

  def handle_event(:cast, _event, :idle, _data), do: :keep_state_and_data

  def handle_event(:cast, event, {module, _phase} = state, data) do
    {:ok, state, data} = go({:hand, module}, newest(event), state, data)
    {:next_state, state, data}
  end

  def handle_event(:info, {:deliver, %Delivery{} = delivery, {:command, _} = event}, state, data) do
    {m, f, a} = delivery.reply

    with :ok <- timely(delivery, data),
         {:ok, way} <- Delivery.way(delivery, state, data.runner.halted),
         {:ok, state, data} <- go(way, event, state, data) do
      # The pilot has it; that the executive has it, too, only that one can say.
      Executive.confirm(data.config.id, {m, f, a ++ [:ok]})
      {:next_state, state, data}
    else
      refusal ->
        apply(m, f, a ++ [refusal])
        :keep_state_and_data
    end
  end

  def handle_event(:info, _unknown, _state, _data), do: :keep_state_and_data

  # Whoever asked has been told by now that nothing came of it, or somebody has stopped the robot meanwhile.
  defp timely(delivery, data) do
    cond do
      System.monotonic_time(:millisecond) >= delivery.until_ms -> {:error, :late}
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

  # An event on its way to a mission.
  defp go({:hand, _module}, event, state, data),
    do: event |> handle(data) |> follow(state, data)

  defp go(:resume, event, state, data) do
    with {:ok, runner} <- Runner.resume(data.runner),
         do: go({:hand, runner.module}, event, state, %{data | runner: runner})
  end

  defp go({:start, module, options}, event, state, data) do
    with {:ok, state, data} <- begin(module, options, state, data),
         do: go({:hand, module}, event, state, data)
  end

  defp begin(module, options, state, data) do
    if Code.ensure_loaded?(module) and function_exported?(module, :init, 2) do
      Journal.heard({:start, module, options}, data)
      Effects.rest(data.config)
      result = Journal.asking(module, data, fn -> Runner.start(data.runner, module, options) end)
      follow(result, state, data)
    else
      {:error, :no_mission}
    end
  end

  # Whoever is answered finds the robot idle. The mission is asked last: it has no say in this.
  defp halt(state, then, data) do
    Journal.heard(:stop, data)
    data = Journal.changed(state, :idle, %{}, data)
    Executive.stand(data.config.id, then)
    halted = Journal.asking(data.runner.module, data, fn -> Runner.halt(data.runner) end)
    {:next_state, :idle, %{data | runner: halted}}
  end

  # Percepts that came in meanwhile are further down in our own mailbox.
  defp newest({:tick, _percept} = tick) do
    receive do
      {:"$gen_cast", {:tick, _newer} = newer} -> newest(newer)
    after
      0 -> tick
    end
  end

  defp newest(event), do: event

  defp handle(event, data) do
    Journal.heard(event, data)
    Journal.asking(data.runner.module, data, fn -> Runner.handle(data.runner, event) end)
  end

  defp follow({runner, effects}, before, data) do
    data = %{data | runner: runner}
    Enum.each(effects, &Effects.carry_out(&1, data.config))
    state = Runner.state(runner)
    {:ok, state, Journal.changed(before, state, runner.claim, data)}
  end
end
