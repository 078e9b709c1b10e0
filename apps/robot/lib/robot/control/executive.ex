defmodule Robot.Control.Executive do
  @moduledoc """
  Takes a percept from the board ten times a second, runs a tick of `Robot.Control.Controller`, and sends its wish to
  the gate and the percept to the pilot: each percept as `{:tick, percept}`, the walls that it knows when they change, as
  `{:walls, packed}`, and each outcome of a goal, as `{:outcome, tag, integer}`. What takes long, such as vision, is a
  process of its own that writes to the board.

  A behaviour that hangs blocks the executive. `Robot.Safety.LivenessMonitor` detects that and
  kills it.

  A goal is for now: while the wheels may not turn it is refused (`Robot.Safety.Readiness`), and when
  they are disarmed, by whatever, it is dropped, so that arming starts nothing. An executive that is held (`hold/2`) refuses
  goals while a mission is being ended; a robot that is held is one that an e-stop holds (`docs/glossary.md`).

  Each halt has a token. Its sender tells executive and pilot, and the pilot tells the executive when it has ended the
  mission. Erlang promises no order between the two senders, so a `{:stand, token, then}` may arrive before its
  `{:hold, token}`: the executive remembers such tokens, and ignores their holds.

  It starts idle: its state contains the goal, which a crash loses. At its start it makes the gate
  drop the wish of its predecessor.

  A role (`Robot.Role`): the functions above the callbacks are for those that reach its process.
  """
  @behaviour Robot.Role
  alias Hal.Odometry
  alias Robot.{Board, Departure, Mission, Names, Percept, Role}
  alias Robot.Control.Controller
  alias Robot.Safety.{DryRun, Readiness}

  @call_ms 400
  # Tokens remembered of halts that are over, but whose hold has not arrived.
  @remembered 16

  @enforce_keys [:robot, :profile, :dry_run, :head?, :notes?, :controller, :departure]
  defstruct @enforce_keys ++ [told: nil, holds: [], stood: [], tick: 0]

  @typedoc """
  `head?` says whether there is a head to turn, `notes?` whether a file notes that the robot has left its start pose;
  `departure` is what is noted of that, `told` the last line of a dry run. `holds` are the tokens of the halts that hold
  the executive, `stood` those of halts that ended before their hold arrived, newest first.
  """
  @type t :: %__MODULE__{
          robot: atom(),
          profile: Hal.Profile.t(),
          dry_run: boolean(),
          head?: boolean(),
          notes?: boolean(),
          controller: Controller.t(),
          departure: {:was | :near, Departure.frame() | nil} | :noted,
          told: String.t() | nil,
          holds: [token()],
          stood: [token()],
          tick: non_neg_integer()
        }

  @typedoc "Identifies a halt: any term that no other halt of the robot has."
  @type token :: term()

  @doc """
  Sets, changes or (`nil`) drops the goal, as in `Robot.Control.Controller.goal/3`. The error is a
  line: no such robot runs on this node, the goal is not a behaviour, or it does not accept these
  options, the wheels may not turn now, a mission is being ended (`hold/2`), or the executive has not
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
  Drops the goal at once, and every goal that comes until the pilot, which is told to end the
  mission at the same time, casts `{:stand, token, then}`. A mission that runs late, or hangs, could
  otherwise set a goal after the stop. Until then nothing is confirmed.

  `{:stand, token, then}` drops the goal and all other orders of the mission, and makes the gate drop the wish, after all
  earlier wishes of the executive; then the gate applies `then`. The token `:all` is that of a pilot that starts: it ends
  every hold.
  """
  @spec hold(robot :: atom(), token()) :: :ok
  def hold(robot, token), do: cast(robot, {:hold, token})

  @doc "Holds the executive as `hold/2` does, because the wheels are disarmed; a dry run goes on."
  @spec disarmed(robot :: atom(), token()) :: :ok
  def disarmed(robot, token), do: cast(robot, {:disarmed, token})

  defp cast(robot, message), do: GenServer.cast(Names.via(robot, :executive), message)

  @impl Role
  def name, do: :executive

  @impl Role
  def period_ms, do: 100

  @impl Role
  def priority, do: :normal

  @impl Role
  def init(%Robot.Config{} = config, board, _at_ms) do
    departed = Board.departed(board)
    doing = %{by: :idle, weights: [], way: [], limits: [], outcome: nil, fault: nil, tick: 0}

    state = %__MODULE__{
      robot: config.id,
      profile: config.profile,
      dry_run: config.dry_run,
      head?: config.ptz != nil,
      notes?: config.departure_file != nil,
      controller:
        Controller.new(
          profile: config.profile,
          start: config.start,
          departed: departed,
          plan: config.plan,
          marks: config.marks || [],
          seed: config.seed
        ),
      departure: if(departed, do: {:was, departed}, else: {:near, nil})
    }

    {state,
     [{:cast, :gate, {:forget, nil}}, {:put, :doing, doing}, {:put, :goal, nil}] ++
       [{:event, [:robot, :executive, :start], %{}}]}
  end

  @doc "The percept of a tick, before the pose is estimated: what a recording holds of the board."
  @impl Role
  def perceive(at_ms, s, board), do: {:tick, Percept.Snapshot.take(board, s.profile, at_ms)}

  @impl Role
  def handle({:tick, %Percept{} = raw}, _at_ms, s, _board), do: tick(s, raw)

  def handle({:ask, from, {:goal, _tag, _goal} = order}, _at_ms, s, board) do
    if refusal = refusal(order, s, board),
      do: {s, [{:answer, from, refusal}]},
      else: answered(obeyed(s, order), from)
  end

  def handle({:cast, {:obey, order}}, _at_ms, s, board),
    do: if(refusal(order, s, board), do: {s, []}, else: obeyed(s, order))

  def handle({:cast, {:confirm, _then, _result}}, _at_ms, %{holds: [_ | _]} = s, _board),
    do: {s, []}

  def handle({:cast, {:confirm, then, result}}, _at_ms, s, _board),
    do: {s, [{:apply, then, [result]}]}

  def handle({:cast, {:hold, token}}, _at_ms, s, _board), do: held(s, token)
  def handle({:cast, {:disarmed, _token}}, _at_ms, %{dry_run: true} = s, _board), do: {s, []}
  # The pilot, which is told too, ends the mission; one that hangs may still set a goal meanwhile.
  def handle({:cast, {:disarmed, token}}, _at_ms, s, _board), do: held(s, token)

  def handle({:cast, {:stand, token, then}}, _at_ms, s, _board), do: drop(stood(s, token), then)

  def handle(_unknown, _at_ms, _s, _board), do: :unknown

  # A halt that is over: a mission that has begun since keeps its goal.
  defp held(s, token) do
    if token in s.stood,
      do: {%{s | stood: List.delete(s.stood, token)}, []},
      else: drop(%{s | holds: [token | s.holds]}, nil)
  end

  defp stood(s, :all), do: %{s | holds: [], stood: []}
  # A halt without a hold.
  defp stood(s, nil), do: s

  defp stood(s, token) do
    if token in s.holds,
      do: %{s | holds: List.delete(s.holds, token)},
      else: %{s | stood: Enum.take([token | s.stood], @remembered)}
  end

  defp answered({s, effects}, from), do: {s, effects ++ [{:answer, from, :ok}]}

  defp refusal({:goal, _tag, {_module, _options}}, %{holds: [_ | _]}, _board),
    do: {:error, "its mission is being ended"}

  defp refusal({:goal, _tag, {_module, _options}}, s, board) do
    with :ok <- Readiness.armed(s, board), do: nil
  end

  defp refusal(_order, _s, _board), do: nil

  defp obeyed(s, order) do
    {controller, pan} = Controller.obey(s.controller, order)
    {s, pursued} = pursue(s, controller)
    {s, looks} = look(s, pan)
    {s, pursued ++ looks}
  end

  defp drop(s, then) do
    {s, pursued} = pursue(s, Controller.stand(s.controller))
    {s, [{:cast, :gate, {:forget, then}} | pursued]}
  end

  # The goal is on the board before its first tick, so that a hang in that tick can be attributed.
  defp pursue(%{controller: %{module: module}} = s, %{module: module} = controller),
    do: {%{s | controller: controller}, []}

  defp pursue(s, controller) do
    over = if controller.module, do: [{:delete, {:crashed, :executive}}], else: []
    {%{s | controller: controller}, over ++ [{:put, :goal, controller.module}]}
  end

  defp tick(s, raw) do
    {wish, outcome, controller} = Controller.tick(s.controller, raw)
    percept = Controller.percept(controller)
    fault = Controller.fault(controller)

    doing = %{
      by: wish.by,
      weights: Controller.weights(controller),
      way: Controller.way(controller),
      limits: Controller.limits(controller),
      outcome: outcome,
      fault: fault,
      tick: s.tick + 1
    }

    # The outcome comes first, so that the mission knows it when it handles the percept.
    ended = with {tag, outcome} <- outcome, do: {:outcome, tag, outcome}
    told = List.wrap(ended) ++ Controller.report(s.controller, controller)

    faults =
      if fault == Controller.fault(s.controller),
        do: [],
        else: [{:event, [:robot, :fault], %{line: fault}}]

    {s, looks} = look(s, wish.look)
    {s, left} = depart(s, percept.odometry)

    {%{s | controller: controller, tick: doing.tick},
     [{:cast, :gate, {:wish, wish.twist}}] ++
       looks ++
       faults ++
       [{:put, :doing, doing}] ++
       place(percept) ++ for(event <- told, do: {:cast, :pilot, event}) ++ left}
  end

  # By the first reading of the odometry the localiser knows whether the start pose is its zero.
  defp depart(s, nil), do: {s, []}
  defp depart(%{notes?: false} = s, _odometry), do: {s, []}
  defp depart(%{departure: :noted} = s, _odometry), do: {s, []}

  defp depart(%{departure: {:was, noted}} = s, %Odometry{frame: frame}) do
    away =
      if Departure.start?(noted, frame),
        do: [],
        else: [{:event, [:robot, :executive, :away], %{}}]

    {%{s | departure: :noted}, away}
  end

  # After a counter jump the place is unknown, so the frame of the last reading near zero is noted.
  defp depart(%{departure: {:near, frame}} = s, %Odometry{pose: pose} = odometry) do
    if Departure.left?(pose),
      do: {%{s | departure: :noted}, [{:depart, frame || Departure.frame(nil)}]},
      else: {%{s | departure: {:near, Departure.frame(odometry.frame)}}, []}
  end

  defp place(%{pose: nil}), do: []

  defp place(%{pose: pose, uncertainty: uncertainty}),
    do: [{:put, :pose, pose}, {:put, :uncertainty, uncertainty}]

  defp look(s, pan) when pan == nil or not s.head?, do: {s, []}

  defp look(%{dry_run: true} = s, pan) do
    {effects, told} = DryRun.tell(s.robot, {:look, pan}, s.told)
    {%{s | told: told}, effects}
  end

  defp look(s, pan), do: {s, [{:look, pan}]}
end
