defmodule Robot.Control.Pilot do
  @moduledoc """
  Runs one robot's mission (`Robot.Mission.Runner`): hands it what happens, and carries its effects on: orders to the
  executive, messages to others, stages to people. What it does is on the board under `:mission`.

  It starts idle, and resets the executive: after a crash of the mission the robot stands until
  a person starts a mission again.

  A mission does not handle stops. The pilot ends the mission, whatever its phase, and passes the
  stop to the executive, which drops its goal, and from there to the gate, after every older wish.
  Only the gate confirms the stop.

  The mission's callbacks may be foreign code. While one runs, the board has an entry `:asking` (`c:Robot.Role.foreign/2`),
  so that `Robot.Safety.LivenessMonitor` detects one that does not return, and kills the pilot.

  Wheels that are disarmed end the mission, whatever disarms them and whatever arms them again
  (`arm: :manual` or `:auto`); a stage `:disarmed` tells people. While they may not turn, none starts
  (`Robot.Safety.Readiness`). So arming starts no motion.

  A role (`Robot.Role`): the functions above the callbacks are for those that reach its process.
  """
  @behaviour Robot.Role
  alias Robot.{Board, Mission, Names, Percept, Role}
  alias Robot.Control.{Delivery, Executive}
  alias Robot.Localiser.Anchors
  alias Robot.Mission.Runner
  alias Robot.Safety.{Gate, Readiness}
  alias Nav.Grid
  import Robot.Mission, only: [is_order: 1]

  # Generous, because a pilot may be slow on a busy machine.
  @call_ms 5_000
  # A percept that has waited longer than this is dropped; the next one is on its way.
  @old_ms 1_000
  @dropped [{:goal, :idle, nil}, {:anchors, %Anchors{}}, {:look, nil}]

  @enforce_keys [:robot, :mission, :drive, :dry_run, :runner, :since_ms]
  defstruct @enforce_keys ++ [state: :idle, options: []]

  @typedoc """
  `mission` is that of the config, `state` the last one told, since `since_ms`, `options` those of the mission that runs;
  `drive` and `dry_run` say with `Robot.Safety.Readiness` whether an order may move the robot.
  """
  @type t :: %__MODULE__{
          robot: atom(),
          mission: Robot.Config.module_options() | nil,
          drive: Robot.Config.module_options(),
          dry_run: boolean(),
          runner: Runner.t(),
          since_ms: integer(),
          state: Runner.state(),
          options: keyword()
        }

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
    do: GenServer.cast(Names.via(robot, :pilot), {:halt, nil, then})

  @doc """
  Tells gate, executive and pilot at once to end what the robot does, so that one that hangs does not
  delay the others; `then` as in `halt/2`. The goal is dropped even if the pilot is stuck in its mission,
  and again when the mission has ended, because it may have set another one meanwhile.
  """
  @spec halt_at_once(robot :: atom(), then :: Robot.Config.call() | nil) :: :ok
  def halt_at_once(robot, then) do
    token = System.unique_integer()
    :ok = Gate.forget(robot)
    :ok = Executive.hold(robot, token)
    GenServer.cast(Names.via(robot, :pilot), {:halt, token, then})
  end

  @doc """
  Resumes the mission that the last stop ended, from its beginning, with the commands that it had
  kept (`c:Robot.Mission.halted/1`). `{:error, :idle}` if there is none, or if a mission runs; a line
  as of `start/1`.
  """
  @spec resume(robot :: atom()) :: :ok | {:error, :idle | (line :: String.t())}
  def resume(robot), do: call(robot, :resume)

  @doc "The map that the mission has made, also one that was stopped; `nil` of one that makes none."
  @spec map(robot :: atom()) :: Nav.MapFile.Writer.raster() | nil
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
    GenServer.cast(Names.via(robot, :pilot), {:deliver, delivery, {:command, command}})
  end

  @doc """
  Passes an event of `Robot.Mission` to the mission: a tick, new walls or an outcome from the executive, or a
  message from another robot, which the sender of this event has checked. A tick that a
  newer one follows is dropped.
  """
  @spec hear(robot :: atom(), Robot.Mission.event() | {:walls, Grid.Packed.t() | nil}) :: :ok
  def hear(robot, event), do: GenServer.cast(Names.via(robot, :pilot), event)

  @doc "A sink for the drive: holds the executive and ends the mission when the wheels are disarmed."
  @spec sense(robot :: atom(), reading :: tuple()) :: :ok
  def sense(robot, {:arming, %{state: state}}) when state != :armed do
    token = System.unique_integer()
    :ok = Executive.disarmed(robot, token)
    GenServer.cast(Names.via(robot, :pilot), {:disarmed, token})
  end

  def sense(_robot, _reading), do: :ok

  defp call(robot, request), do: GenServer.call(Names.via(robot, :pilot), request, @call_ms)

  @impl Role
  def name, do: :pilot

  @impl Role
  def period_ms, do: nil

  @impl Role
  def priority, do: :normal

  # The former pilot may have crashed within a callback, and the executive may still have its
  # goal, or wait for the end of a mission that has ended so.
  @impl Role
  def init(%Robot.Config{} = config, _board, at_ms) do
    s = %__MODULE__{
      robot: config.id,
      mission: config.mission,
      drive: config.drive,
      dry_run: config.dry_run,
      runner: Runner.new(config.id, plan(config)),
      since_ms: at_ms
    }

    {s, [{:delete, :asking} | dropped()] ++ [{:cast, :executive, {:stand, :all, nil}}] ++ told(s)}
  end

  # Walls that the sonars see come from the executive.
  defp plan(%{plan: %Grid{} = plan}), do: plan
  defp plan(_sonar_or_none), do: nil

  @doc "The state of its mission."
  @impl Role
  def phase(s), do: Runner.state(s.runner)

  @doc "The mission whose code runs on this input."
  @impl Role
  def foreign({:ask, _from, {:start, module, _options}}, _s) when is_atom(module), do: module

  def foreign({:cast, {:deliver, %{ways: [{:start, module, _options}]}, _command}}, _s)
      when is_atom(module),
      do: module

  def foreign(_input, %{runner: %{module: module}}), do: module

  @impl Role
  def handle({:ask, from, :start}, _at_ms, %{mission: nil} = s, _board),
    do: {s, [{:answer, from, {:error, :no_mission}}]}

  def handle({:ask, from, :start}, at_ms, %{mission: {module, options}} = s, board),
    do: answered(begin(module, options, at_ms, s, board), from, s)

  def handle({:ask, from, {:start, module, options}}, at_ms, s, board)
      when is_atom(module) and is_list(options),
      do: answered(begin(module, options, at_ms, s, board), from, s)

  def handle({:ask, from, :stop}, at_ms, s, _board),
    do: idle(s, nil, from && {GenServer, :reply, [from, :ok]}, at_ms)

  def handle({:ask, from, :resume}, at_ms, s, board),
    do: answered(go(:resume, {:command, :start}, at_ms, s, board), from, s)

  def handle({:ask, from, :map}, _at_ms, s, _board),
    do: {s, [{:answer, from, Runner.map(s.runner)}]}

  def handle({:ask, from, {:command, _command}}, _at_ms, %{runner: %{module: nil}} = s, _board),
    do: {s, [{:answer, from, {:error, :idle}}]}

  def handle({:ask, from, {:command, _command} = event}, at_ms, s, board),
    do: answered(go({:hand, s.runner.module}, event, at_ms, s, board), from, s)

  def handle({:cast, {:halt, token, then}}, at_ms, s, _board), do: idle(s, token, then, at_ms)

  def handle({:cast, {:disarmed, _token}}, _at_ms, %{dry_run: true} = s, _board), do: {s, []}

  def handle({:cast, {:disarmed, token}}, at_ms, s, _board) do
    told = if s.runner.module, do: [{:stage, :disarmed, %{}}], else: []
    {s, effects} = idle(s, token, nil, at_ms)
    {s, told ++ effects}
  end

  def handle({:cast, {:tick, %Percept{at_ms: then_ms}}} = input, at_ms, s, board)
      when is_integer(then_ms) do
    if at_ms - then_ms > @old_ms or replaced?(then_ms, board),
      do: {s, []},
      else: hand(input, at_ms, s)
  end

  def handle({:cast, {:message, message}} = input, at_ms, s, _board) when is_map(message),
    do: hand(input, at_ms, s)

  def handle({:cast, {:outcome, _tag, outcome}} = input, at_ms, s, _board)
      when is_integer(outcome),
      do: hand(input, at_ms, s)

  def handle({:cast, {:command, _command}} = input, at_ms, s, _board), do: hand(input, at_ms, s)

  def handle({:cast, {:walls, packed}}, _at_ms, s, _board) do
    case Grid.Packed.unpack(packed) do
      {:ok, walls} -> {%{s | runner: Runner.walls(s.runner, walls)}, []}
      :error -> :unknown
    end
  end

  def handle(
        {:cast, {:deliver, %Delivery{} = delivery, {:command, _c} = event}},
        at_ms,
        s,
        board
      ),
      do: delivered(delivery, event, at_ms, s, board)

  def handle(_unknown, _at_ms, _s, _board), do: :unknown

  # A robot that was frozen decides by what it perceives now: by its old percept a leader would
  # believe that its lease lasts. And of several percepts that wait only the newest counts.
  defp replaced?(then_ms, board) do
    case Board.fetch(board, :doing, :infinity, 0) do
      {:ok, _doing, ticked_ms} -> ticked_ms > then_ms
      :error -> false
    end
  end

  defp answered({:ok, s, effects}, from, _s), do: {s, effects ++ [{:answer, from, :ok}]}
  defp answered(error, from, s), do: {s, [{:answer, from, error}]}

  defp hand(_input, _at_ms, %{runner: %{module: nil}} = s), do: {s, []}

  defp hand({:cast, event}, at_ms, s) do
    {:ok, s, effects} = follow(Runner.handle(s.runner, event), at_ms, s)
    {s, effects}
  end

  # Only the executive can confirm that it has received the orders.
  defp delivered(%Delivery{reply: reply} = delivery, event, at_ms, s, board) do
    with :ok <- timely(delivery, at_ms, board),
         {:ok, way} <- Delivery.way(delivery, Runner.state(s.runner), s.runner.halted),
         {:ok, s, effects} <- go(way, event, at_ms, s, board) do
      {s, effects ++ [{:cast, :executive, {:confirm, reply, :ok}}]}
    else
      refusal -> {s, [{:apply, reply, [refusal]}]}
    end
  end

  # A command is refused if its requester no longer waits, or if the robot is stopped or was
  # stopped after the request.
  defp timely(delivery, at_ms, board) do
    cond do
      at_ms >= delivery.until_ms -> {:error, :late}
      Board.latched?(board) -> {:error, :held}
      stopped?(delivery.asked, board) -> {:error, :stopped}
      true -> :ok
    end
  end

  defp stopped?(nil, _board), do: false

  defp stopped?(asked, board) do
    case Board.fetch(board, :stopped, :infinity, 0) do
      {:ok, stopped, _at_ms} -> asked < stopped
      :error -> false
    end
  end

  # Passes an event to a mission by the way that was chosen.
  defp go({:hand, _module}, event, at_ms, s, _board),
    do: follow(Runner.handle(s.runner, event), at_ms, s)

  defp go(:resume, event, at_ms, s, board) do
    with {:ok, runner} <- Runner.resume(s.runner),
         :ok <- Readiness.of(s, board),
         {:ok, s, effects} <- follow(Runner.handle(runner, event), at_ms, s),
         do: {:ok, s, [{:delete, {:crashed, :pilot}} | effects]}
  end

  defp go({:start, module, options}, event, at_ms, s, board) do
    with {:ok, s, begun} <- begin(module, options, at_ms, s, board),
         {:ok, s, effects} <- follow(Runner.handle(s.runner, event), at_ms, s),
         do: {:ok, s, begun ++ effects}
  end

  defp begin(module, options, at_ms, s, board) do
    with {:ok, options} <- mission(module, options),
         :ok <- Readiness.of(s, board) do
      begun = Runner.start(s.runner, module, options)
      {:ok, s, effects} = follow(begun, at_ms, %{s | options: options})
      {:ok, s, [{:delete, {:crashed, :pilot}} | dropped()] ++ effects}
    end
  end

  defp mission(module, options) do
    cond do
      not (Code.ensure_loaded?(module) and function_exported?(module, :init, 2) and
               function_exported?(module, :handle, 2)) ->
        {:error, :no_mission}

      not Keyword.keyword?(options) ->
        {:error, "expected options [key: value], got #{inspect(options, limit: 5)}"}

      # Programs start one that checks nothing, such as a calibration; people are refused earlier.
      Mission.checks?(module) ->
        Mission.check_options(module, options, nil)

      true ->
        {:ok, options}
    end
  end

  # The board says idle before the answer.
  defp idle(s, token, then, at_ms) do
    {s, effects} = changed(%{s | runner: Runner.halt(s.runner)}, at_ms)
    {s, effects ++ [{:cast, :executive, {:stand, token, then}}]}
  end

  defp follow({runner, effects}, at_ms, s) do
    {s, told} = changed(%{s | runner: runner}, at_ms)
    {:ok, s, Enum.map(effects, &act/1) ++ told}
  end

  defp act(order) when is_order(order), do: {:cast, :executive, {:obey, order}}
  defp act({:send, _to, _message} = send), do: send
  defp act({:claim, claim} = told) when is_map(claim), do: told
  defp act({:stage, name, about} = stage) when is_atom(name) and is_map(about), do: stage

  # Makes the executive drop the orders of a mission that has ended.
  defp dropped, do: for(order <- @dropped, do: act(order))

  defp changed(%{state: state} = s, at_ms) do
    case Runner.state(s.runner) do
      ^state ->
        {s, [written(s)]}

      now ->
        s = %{s | state: now, since_ms: at_ms}
        {s, told(s)}
    end
  end

  defp told(s), do: [written(s), {:phase, s.state}]

  defp written(s) do
    {:put, :mission,
     %{
       state: s.state,
       claim: Runner.claim(s.runner),
       layer: Runner.layer(s.runner),
       since_ms: s.since_ms,
       ticked_ms: s.runner.ticked_ms,
       options: s.options
     }}
  end
end
