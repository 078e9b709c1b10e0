defmodule Swarm.Member do
  @moduledoc """
  Runs one robot of a fleet as one pure function: the peers it hears, its mission, its controller and its gate,
  composed. `Sim.Trial` folds it in lockstep; live, the processes of `Robot.Supervisor` and `Swarm.Comms` run the same
  parts in the same order, so both do the same on the same input.

  | input | from |
  |---|---|
  | `{:reading, reading, at_ms}` | the drive, the pan-tilt unit |
  | `{:detections, detections}` | the blob detector (`Vision.Detections`) |
  | `{:message, term, at_ms}` | another robot |
  | `{:command, command, at_ms}` | a person |
  | `{:tick, at_ms}` | the clock, 10 Hz: controller, then mission, then (5 Hz) the heartbeat |
  | `{:reflex, at_ms}` | the clock, 20 Hz: the gate |
  | `{:crash, role, at_ms}` | a fault: this role begins anew, and those behind it, as under their supervisor |
  | `{:hang, {role, until_ms}, at_ms}` | a fault: what arrives at executive or pilot waits; after 2 s it is killed |

  Effects: `{:drive, twist}`, `{:look, pan, tilt}`, `{:send, to, message}`, `{:stage, name, map}`.
  """
  alias Hal.Twist
  alias Robot.Percept
  alias Robot.Control.{Controller, Delivery, Executive, Pilot}
  alias Robot.Mission.{Manual, Runner}
  alias Robot.Safety.Gate
  alias Swarm.Comms.{CommandHandler, OwnHeartbeat}
  alias Swarm.{EStop, Message}
  alias Swarm.Membership.{Heartbeat, Peers}
  alias Swarm.Message.Receiver

  # Orders for one robot alone (`Robot.Command`), which leaves the group's mission for them.
  defguardp is_alone(command)
            when command in [:lead, :wander, :rest] or
                   (is_tuple(command) and
                      elem(command, 0) in [
                        :goto,
                        :move,
                        :follow,
                        :follow_the_leader,
                        :find_blob,
                        :square,
                        :run
                      ])

  # The order in which the robot's supervisor starts them: with one that ends, those behind it end.
  @roles [:gate, :executive, :pilot, :estop]
  # When `Robot.Safety.LivenessMonitor` kills what hangs.
  @killed_ms 2_000

  @enforce_keys [:config, :boot, :pilot, :executive, :gate, :estop, :receiver]
  defstruct @enforce_keys ++
              [entries: %{}, sequence: 0, beat_ms: nil, hung: %{}]

  @typedoc """
  `config` is what it was started with, its mission that which a start begins; `entries` holds the last
  readings by name, with their times; `receiver` holds what was heard: peers, rejected messages.
  """
  @type t :: %__MODULE__{
          config: Robot.Config.t(),
          boot: non_neg_integer(),
          pilot: Pilot.t(),
          executive: Executive.t(),
          gate: Gate.t(),
          estop: EStop.t(),
          receiver: Receiver.t(),
          entries: %{atom() => {term(), integer()}},
          sequence: non_neg_integer(),
          beat_ms: integer() | nil,
          hung: %{
            atom() =>
              {until_ms :: integer(), killed_ms :: integer(), waiting :: [Robot.Role.input()]}
          }
        }

  @type input ::
          {:reading, Hal.Drive.reading() | Hal.Ptz.reading(), integer()}
          | {:detections, Vision.Detections.t()}
          | {:message, term(), integer()}
          | {:command, term(), integer()}
          | {:tick, integer()}
          | {:reflex, integer()}
          | {:crash, :gate | :executive | :pilot | :estop, integer()}
          | {:hang, {:executive | :pilot, until_ms :: integer()}, integer()}

  @type effect ::
          {:drive, Twist.t()}
          | {:look, float(), float()}
          | {:send, atom() | [atom()] | :all, Message.t()}
          | {:stage, atom(), map()}

  @doc """
  A member. Options: `id`, `profile`, `start` (`Hal.Pose`, where the odometry reads zero),
  `mission` (`{module, options}`), `boot` (a number that grows with every start, default 1), `plan` (the walls of a floor
  plan, `Robot.Navigation.Grid`, or a `Robot.Navigation.OccupancyGrid` for those that its sonars will have seen).
  """
  @spec new(keyword()) :: t()
  def new(options) do
    options = Keyword.validate!(options, [:id, :profile, :start, :mission, boot: 1, plan: nil])
    {module, mission_options} = options[:mission]

    # In lockstep nothing is a device: the trial carries out what it is told. The wheels are armed.
    given = Keyword.take(options, [:id, :profile, :start, :plan])
    devices = [drive: {__MODULE__, []}, ptz: {__MODULE__, []}]
    life = [mission: options[:mission], boot: options[:boot]]
    config = struct!(Robot.Config, given ++ devices ++ life)
    entries = %{arming: {%{state: :armed, why: nil}, 0}}
    {gate, _started} = Gate.init(config, entries, 0)
    {executive, _started} = Executive.init(config, entries, 0)
    {pilot, _started} = Pilot.init(config, entries, 0)
    {estop, _started} = EStop.init(config, entries, 0)
    runner = Runner.new(options[:id], Controller.walls(executive.controller))
    {runner, []} = Runner.start(runner, module, mission_options)

    %__MODULE__{
      config: config,
      boot: options[:boot],
      pilot: %{pilot | runner: runner, state: Runner.state(runner), options: mission_options},
      executive: executive,
      gate: gate,
      estop: estop,
      entries: entries,
      receiver: Receiver.new(options[:id])
    }
  end

  @doc "Handles one input, and returns the effects."
  @spec step(t(), input()) :: {t(), [effect()]}
  def step(member, {:crash, role, at_ms}) when role in @roles, do: crash(member, role, at_ms)

  def step(member, {:hang, {role, until_ms}, at_ms}) when role in [:executive, :pilot] do
    {member, effects} = member |> recovered(at_ms)
    {put_in(member.hung[role], {until_ms, at_ms + @killed_ms, []}), effects}
  end

  def step(%{hung: hung} = member, {:tick, at_ms}) when hung != %{} do
    {member, recovered} = recovered(member, at_ms)
    {member, effects} = tick(member, at_ms)
    {member, recovered ++ effects}
  end

  def step(member, {:reading, {key, value} = reading, at_ms}),
    do: member |> put(key, value, at_ms) |> gate({:cast, {:sense, reading}}, at_ms)

  def step(member, {:detections, detections}),
    do: {put(member, :detections, detections, detections.at_ms), []}

  def step(member, {:message, term, at_ms}), do: hear(member, Message.check(term), at_ms)

  def step(member, {:command, command, at_ms}) do
    with false <- EStop.takes?(command),
         {:ok, ways} <- ways(command, member) do
      event = {:command, CommandHandler.command(command)}
      delivery = %Delivery{ways: ways, until_ms: :infinity, reply: nil}
      pilot(member, {:cast, {:deliver, delivery, event}}, at_ms)
    else
      true -> estop(member, {:command, command, nil, {:asked, 1_000 * at_ms}}, at_ms)
      {:error, _line} -> {member, []}
    end
  end

  def step(member, {:tick, at_ms}), do: tick(member, at_ms)

  def step(member, {:reflex, at_ms}), do: gate(member, :tick, at_ms)

  @doc """
  The same as `step/2` for a message that was checked before (`Swarm.Message.check/1`): once for all members that hear it.
  """
  @spec hear(t(), {:ok, Message.t()} | {:error, atom()}, integer()) :: {t(), [effect()]}
  def hear(member, checked, at_ms) do
    {heard, receiver} = Receiver.take(member.receiver, checked, at_ms)
    heard(%{member | receiver: receiver}, heard, at_ms)
  end

  @doc """
  The distance in metres from its estimated pose within which the robot is in 95 of 100 cases
  (`Robot.Percept`), or `nil`.
  """
  @spec uncertainty(t()) :: float() | nil
  def uncertainty(member) do
    with %Percept{uncertainty: %{radius: radius}} <-
           Controller.percept(member.executive.controller),
         do: radius,
         else: (_no_pose -> nil)
  end

  @doc """
  What the robot's mission claims (`t:Robot.Mission.effect/0`).
  """
  @spec claim(t()) :: map()
  def claim(member), do: member.pilot.runner.claim

  @doc "Who called the emergency stop that holds the robot (`Swarm.EStop.State.callers/1`); `nil` if none does."
  @spec held(t()) :: [String.t()] | nil
  def held(member),
    do: if(EStop.State.held?(member.estop.stop), do: EStop.State.callers(member.estop.stop))

  @doc "Whether the mission lets the robot stand and wait, for a round, a leader or a person."
  @spec stands?(t()) :: boolean()
  def stands?(member),
    do: Runner.state(member.pilot.runner) == :idle or member.executive.controller.tag == :stand

  defp tick(member, at_ms) do
    {member, effects} = executive(member, {:tick, percept(member, at_ms)}, at_ms)
    {member, beats} = beat(member, at_ms)
    {member, effects ++ beats}
  end

  # As under `Robot.Supervisor`: comms comes last, and begins a new life; the e-stop's state is on the board.
  defp crash(member, role, at_ms) do
    member = %{
      member
      | boot: member.boot + 1,
        sequence: 0,
        beat_ms: nil,
        receiver: Receiver.new(member.config.id),
        hung: Map.drop(member.hung, behind(role))
    }

    {effects, member} = Enum.flat_map_reduce(behind(role), member, &back(begin(&1, &2, at_ms)))
    {member, effects}
  end

  defp behind(role), do: Enum.drop_while(@roles, &(&1 != role))

  defp begin(role, member, at_ms) do
    {state, effects} =
      module(role).init(%{member.config | boot: member.boot}, member.entries, at_ms)

    carry(effects, Map.put(member, role, state), at_ms)
  end

  defp module(:gate), do: Gate
  defp module(:executive), do: Executive
  defp module(:pilot), do: Pilot
  defp module(:estop), do: EStop

  # What has waited is handed on in its order; what has hung for too long was killed meanwhile.
  defp recovered(member, at_ms) do
    Enum.reduce(@roles, {member, []}, fn role, {member, done} ->
      {member, effects} = recovered(member.hung[role], role, member, at_ms)
      {member, done ++ effects}
    end)
  end

  defp recovered({until_ms, _killed_ms, waiting}, role, member, at_ms) when at_ms >= until_ms do
    member = %{member | hung: Map.delete(member.hung, role)}

    {effects, member} =
      waiting |> Enum.reverse() |> Enum.flat_map_reduce(member, &back(hand(role, &2, &1, at_ms)))

    {member, effects}
  end

  defp recovered({_until_ms, killed_ms, _waiting}, role, member, at_ms) when at_ms >= killed_ms,
    do: crash(member, role, at_ms)

  defp recovered(_well_or_hanging, _role, member, _at_ms), do: {member, []}

  # What people order goes the ways that it goes live; what a mission's own programs order is for the one that runs.
  defp ways(command, member)
       when is_alone(command) or command == :start or
              (is_tuple(command) and elem(command, 0) in [:start, :formation]),
       do: CommandHandler.ways(command, member.config)

  defp ways(_other, _member), do: {:ok, [{:hand, {:except, Manual}}]}

  defp heard(member, {:message, message}, at_ms),
    do: pilot(member, {:cast, {:message, message}}, at_ms)

  defp heard(member, :nothing, _at_ms), do: {member, []}

  defp heard(member, {:heartbeat, _id, beat}, at_ms),
    do:
      if(EStop.news?(member.estop.stop, beat.estop),
        do: estop(member, {:beat, beat.estop}, at_ms),
        else: {member, []}
      )

  defp gate(member, input, at_ms), do: hand(:gate, member, input, at_ms)
  defp executive(member, input, at_ms), do: hand(:executive, member, input, at_ms)
  defp pilot(member, input, at_ms), do: hand(:pilot, member, input, at_ms)

  defp estop(member, message, at_ms) do
    input = EStop.arrive({:cast, message}, 1_000 * at_ms, member.entries)
    hand(:estop, member, input, at_ms)
  end

  defp hand(role, %{hung: hung} = member, input, _at_ms) when is_map_key(hung, role) do
    {until_ms, killed_ms, waiting} = hung[role]
    # A ticker asks for its next tick when the last one was handled, so one waits at most.
    waiting =
      if match?({:tick, _}, input),
        do: Enum.reject(waiting, &match?({:tick, _}, &1)),
        else: waiting

    {put_in(member.hung[role], {until_ms, killed_ms, [input | waiting]}), []}
  end

  defp hand(role, member, input, at_ms) do
    {state, effects} = module(role).handle(input, at_ms, Map.fetch!(member, role), member.entries)

    carry(effects, Map.put(member, role, state), at_ms)
  end

  # Carries out the effects of a role (`Robot.Role`): those that others notice are left.
  defp carry(effects, member, at_ms) do
    {out, member} = Enum.flat_map_reduce(effects, member, &carry_one(&1, &2, at_ms))
    {member, out}
  end

  defp carry_one({:drive, twist, limits}, member, at_ms),
    do: {[{:drive, twist}], put(member, :driving, %{twist: twist, limits: limits}, at_ms)}

  defp carry_one({:look, pan}, member, _at_ms), do: {[{:look, pan, 0.0}], member}

  defp carry_one({:cast, :gate, message}, member, at_ms),
    do: back(gate(member, {:cast, message}, at_ms))

  defp carry_one({:cast, :executive, message}, member, at_ms),
    do: back(executive(member, {:cast, message}, at_ms))

  # As a pilot, which unpacks them.
  defp carry_one({:cast, :pilot, {:walls, _packed}}, member, _at_ms) do
    walls = Controller.walls(member.executive.controller)
    {[], put_in(member.pilot.runner, Runner.walls(member.pilot.runner, walls))}
  end

  defp carry_one({:cast, :pilot, message}, member, at_ms),
    do: back(pilot(member, {:cast, message}, at_ms))

  defp carry_one({:cast, :estop, message}, member, at_ms),
    do: back(estop(member, message, at_ms))

  defp carry_one({:apply, {:cast, _role, _message} = cast}, member, at_ms),
    do: carry_one(cast, member, at_ms)

  defp carry_one({:send, to, body}, member, _at_ms),
    do: {[{:send, to, Message.of(member.config.id, body)}], member}

  defp carry_one({:stage, _name, _facts} = stage, member, _at_ms), do: {[stage], member}
  # What of the board others read, and what roles read of their own when they begin anew.
  defp carry_one({:put, key, value}, member, at_ms)
       when key in [:frame, :presses, :pose, :mission, :estop, :stopped, :followed],
       do: {[], put(member, key, value, at_ms)}

  defp carry_one({:latch, set?}, member, at_ms), do: {[], put(member, :latch, set?, at_ms)}
  defp carry_one(:tick, member, at_ms), do: back(gate(member, :tick, at_ms))
  defp carry_one(_inside, member, _at_ms), do: {[], member}

  defp back({member, effects}), do: {effects, member}

  defp put(member, key, value, at_ms),
    do: %{member | entries: Map.put(member.entries, key, {value, at_ms})}

  @doc """
  What the robot knows for a tick at this time, before it has estimated its pose.
  """
  @spec percept(t(), integer()) :: Percept.t()
  def percept(member, at_ms) do
    Percept.Snapshot.build(
      %Percept{
        robot: member.config.id,
        at_ms: at_ms,
        profile: member.config.profile,
        peers: Peers.percepts(member.receiver.peers, at_ms)
      },
      fn key, limit_ms ->
        case member.entries do
          %{^key => {value, then_ms}} when at_ms - then_ms <= limit_ms -> {:ok, value, then_ms}
          _none_or_old -> :error
        end
      end
    )
  end

  defp beat(member, at_ms) do
    from = {member.boot, member.sequence + 1}

    with true <- Heartbeat.due?(member.beat_ms, at_ms),
         {:ok, message} <-
           OwnHeartbeat.message(member.config, member.entries, member.receiver, from, at_ms) do
      {%{member | sequence: member.sequence + 1, beat_ms: at_ms}, [{:send, :all, message}]}
    else
      _not_due_or_lost -> {member, []}
    end
  end
end
