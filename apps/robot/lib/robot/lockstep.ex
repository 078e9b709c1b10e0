defmodule Robot.Lockstep do
  @moduledoc """
  Runs the roles of one robot (`Robot.Role`) as one pure function, for simulation: hands each what arrives and what they
  tell each other, until nothing waits, and plays their supervisor.

  | live, by `Robot.Host` and OTP | here |
  |---|---|
  | each role has a mailbox | what they tell each other is handed on in the order sent, or in one that is drawn: never two messages of one role to another the other way round |
  | the board is a table | a map |
  | a role that ends begins anew with those behind it | `crash/3` |
  | what a role that hangs is told waits; after 2 s it is killed | `hang/4`, `wake/2` |

  What devices, other robots and people notice is returned. What is for a role that is not among them is lost, as is what
  comes later by a timer (`:after`): by it roles answer people in the place of a drive or a disk that does not answer, and here is neither.
  """
  alias Hal.Twist
  alias Robot.{Board, Role}

  # When `Robot.Safety.LivenessMonitor` kills what hangs.
  @killed_ms 2_000
  @enforce_keys [:config, :modules, :roles, :board]
  defstruct @enforce_keys ++ [hung: %{}, random: nil]

  @typedoc """
  `modules` are the roles in the order in which their supervisor starts them, `roles` their states; of a role that is `hung`,
  until when, when it is killed, and what waits for it, the last first. `random` draws the order of what they tell each other.
  """
  @type t :: %__MODULE__{
          config: Robot.Config.t(),
          modules: [{role :: atom(), module()}],
          roles: %{(role :: atom()) => Role.state()},
          board: Board.entries(),
          hung: %{
            (role :: atom()) =>
              {until_ms :: integer(), killed_ms :: integer(), waiting :: [Role.input()]}
          },
          random: :rand.state() | nil
        }

  @type effect ::
          {:drive, Twist.t()}
          | {:look, pan :: float(), tilt :: float()}
          | {:send, to :: atom() | [atom()] | :all, struct()}
          | {:stage, atom(), map()}
          | {:reply, answer :: term()}

  @doc """
  A robot of this config, in the life that its `boot` numbers, with what is on its board. Roles hear each other in an order
  that is drawn from `seed`; `nil`: as they tell it.
  """
  @spec new(
          Robot.Config.t(),
          [module(), ...],
          Board.entries(),
          seed :: {integer(), integer(), integer()} | nil
        ) :: t()
  def new(%Robot.Config{} = config, modules, board, seed \\ nil) do
    begun = for module <- modules, do: {module.name(), module, module.init(config, board, 0)}

    %__MODULE__{
      config: config,
      modules: for({role, module, _begun} <- begun, do: {role, module}),
      roles: for({role, _module, {state, _effects}} <- begun, into: %{}, do: {role, state}),
      board: board,
      random: seed && :rand.seed_s(:exsss, seed)
    }
  end

  @doc "Writes an entry of the board that no role writes: a reading."
  @spec put(t(), key :: term(), value :: term(), at_ms :: integer()) :: t()
  def put(%__MODULE__{} = robot, key, value, at_ms),
    do: %{robot | board: Map.put(robot.board, key, {value, at_ms})}

  @doc "Hands a role an input, and all others what follows from it."
  @spec input(t(), role :: atom(), Role.input(), at_ms :: integer()) :: {t(), [effect()]}
  def input(%__MODULE__{} = robot, role, input, at_ms),
    do: run([{:world, role, input}], robot, at_ms, [])

  @doc "A role crashes: it begins anew with those behind it, in the robot's next life."
  @spec crash(t(), role :: atom(), at_ms :: integer()) :: {t(), [effect()]}
  def crash(%__MODULE__{config: config} = robot, role, at_ms) do
    behind = Enum.drop_while(robot.modules, fn {name, _module} -> name != role end)

    robot = %{
      robot
      | config: %{config | boot: config.boot + 1},
        hung: Map.drop(robot.hung, Keyword.keys(behind))
    }

    Enum.reduce(behind, {robot, []}, fn {name, module}, {robot, out} ->
      begun = module.init(robot.config, robot.board, at_ms)
      {robot, told, effects} = carry(begun, name, robot, at_ms)
      {robot, more} = run(told, robot, at_ms, [])
      {robot, out ++ effects ++ more}
    end)
  end

  @doc "A role handles nothing until then; one that hangs is killed after 2 s."
  @spec hang(t(), role :: atom(), until_ms :: integer(), at_ms :: integer()) :: {t(), [effect()]}
  def hang(%__MODULE__{} = robot, role, until_ms, at_ms) do
    {robot, effects} = wake(robot, at_ms)
    {put_in(robot.hung[role], {until_ms, at_ms + @killed_ms, []}), effects}
  end

  @doc "Hands on what has waited for roles that hang no longer, in its order, and kills what has hung for too long."
  @spec wake(t(), at_ms :: integer()) :: {t(), [effect()]}
  def wake(%__MODULE__{hung: hung} = robot, _at_ms) when hung == %{}, do: {robot, []}

  def wake(%__MODULE__{} = robot, at_ms) do
    Enum.reduce(robot.modules, {robot, []}, fn {role, _module}, {robot, out} ->
      {robot, effects} = woken(robot.hung[role], role, robot, at_ms)
      {robot, out ++ effects}
    end)
  end

  defp woken({until_ms, _killed_ms, waiting}, role, robot, at_ms) when at_ms >= until_ms do
    robot = %{robot | hung: Map.delete(robot.hung, role)}
    run(for(input <- Enum.reverse(waiting), do: {:world, role, input}), robot, at_ms, [])
  end

  defp woken({_until_ms, killed_ms, _waiting}, role, robot, at_ms) when at_ms >= killed_ms,
    do: crash(robot, role, at_ms)

  defp woken(_well_or_hanging, _role, robot, _at_ms), do: {robot, []}

  # `waiting` holds `{from, to, input}` in the order sent.
  defp run([], robot, _at_ms, out), do: {robot, out}

  defp run(waiting, robot, at_ms, out) do
    {{_from, role, input}, waiting, robot} = next(waiting, robot)

    case hand(role, robot, input, at_ms) do
      {robot, [], []} -> run(waiting, robot, at_ms, out)
      {robot, told, effects} -> run(waiting ++ told, robot, at_ms, out ++ effects)
    end
  end

  defp next([first | rest], %{random: nil} = robot), do: {first, rest, robot}
  defp next([only], robot), do: {only, [], robot}

  defp next(waiting, robot) do
    first = Enum.uniq_by(waiting, fn {from, to, _input} -> {from, to} end)
    {k, random} = :rand.uniform_s(length(first), robot.random)
    drawn = Enum.at(first, k - 1)
    {drawn, List.delete(waiting, drawn), %{robot | random: random}}
  end

  defp hand(role, %{hung: hung} = robot, input, _at_ms) when is_map_key(hung, role) do
    {until_ms, killed_ms, waiting} = hung[role]

    # A ticker asks for its next tick when the last one was handled, so one waits at most.
    waiting =
      if match?({:tick, _}, input),
        do: Enum.reject(waiting, &match?({:tick, _}, &1)),
        else: waiting

    {put_in(robot.hung[role], {until_ms, killed_ms, [input | waiting]}), [], []}
  end

  defp hand(role, %{roles: roles} = robot, input, at_ms) when is_map_key(roles, role) do
    module = Keyword.fetch!(robot.modules, role)

    with input when input != :unknown <- arrived(module, input, robot, at_ms),
         {_state, _effects} = handled <-
           module.handle(input, at_ms, Map.fetch!(roles, role), robot.board) do
      carry(handled, role, robot, at_ms)
    else
      :unknown -> {robot, [], []}
    end
  end

  defp hand(_not_here, robot, _input, _at_ms), do: {robot, [], []}

  defp arrived(module, {:cast, _message} = input, robot, at_ms) do
    if function_exported?(module, :arrive, 3),
      do: module.arrive(input, 1_000 * at_ms, robot.board),
      else: input
  end

  defp arrived(_module, input, _robot, _at_ms), do: input

  # Carries out the effects of a role: what it tells others, and what is noticed outside.
  defp carry({state, []}, role, robot, _at_ms),
    do: {%{robot | roles: Map.put(robot.roles, role, state)}, [], []}

  defp carry({state, effects}, role, robot, at_ms) do
    robot = %{robot | roles: Map.put(robot.roles, role, state)}

    {robot, told, out} =
      Enum.reduce(effects, {robot, [], []}, fn effect, {robot, told, out} ->
        case act(effect, role, robot, at_ms) do
          :ok ->
            {robot, told, out}

          {:board, board} ->
            {%{robot | board: board}, told, out}

          {:tell, message} ->
            {robot, [message | told], out}

          {:out, effect} ->
            {robot, told, [effect | out]}

          {:now, {robot, more, effects}} ->
            {robot, Enum.reverse(more, told), Enum.reverse(effects, out)}

          {:drive, twist, board} ->
            {%{robot | board: board}, told, [{:drive, twist} | out]}
        end
      end)

    {robot, Enum.reverse(told), Enum.reverse(out)}
  end

  defp act({:drive, twist, limits}, _role, robot, at_ms),
    do: {:drive, twist, Map.put(robot.board, :driving, {%{twist: twist, limits: limits}, at_ms})}

  defp act({:cast, to, message}, role, _robot, _at_ms), do: {:tell, {role, to, {:cast, message}}}

  defp act({:apply, {:cast, to, message}}, role, _robot, _at_ms),
    do: {:tell, {role, to, {:cast, message}}}

  defp act({:apply, {:cast, to, message}, [result]}, role, _robot, _at_ms),
    do: {:tell, {role, to, {:cast, {:result, message, result}}}}

  defp act({:put, key, value}, _role, robot, at_ms),
    do: {:board, Map.put(robot.board, key, {value, at_ms})}

  defp act({:delete, key}, _role, robot, _at_ms), do: {:board, Map.delete(robot.board, key)}

  defp act({:latch, set?}, _role, robot, at_ms),
    do: {:board, Map.put(robot.board, :latch, {set?, at_ms})}

  defp act({:look, pan}, _role, _robot, _at_ms), do: {:out, {:look, pan, 0.0}}

  defp act({:send, to, message}, role, _robot, _at_ms),
    do: {:tell, {role, :comms, {:cast, {:say, to, message}}}}

  defp act({:transmit, to, message}, _role, _robot, _at_ms), do: {:out, {:send, to, message}}
  defp act({:stage, _name, _about} = effect, _role, _robot, _at_ms), do: {:out, effect}
  defp act({:reply, _ref, answer}, _role, _robot, _at_ms), do: {:out, {:reply, answer}}
  defp act(:tick, role, robot, at_ms), do: {:now, hand(role, robot, :tick, at_ms)}
  defp act(_inside, _role, _robot, _at_ms), do: :ok
end
