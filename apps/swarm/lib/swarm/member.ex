defmodule Swarm.Member do
  @moduledoc """
  Runs one robot of a fleet as one pure function: its roles (`Robot.Lockstep`), and what `Swarm.Comms` does live: it hears
  its peers, and tells them how it is. `Sim.Trial` folds it in lockstep.

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

  Effects are those of `Robot.Lockstep`.
  """
  alias Robot.{Board, Lockstep, Percept}
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

  @roles [Gate, Executive, Pilot, EStop]

  @enforce_keys [:lockstep, :receiver]
  defstruct @enforce_keys ++ [sequence: 0, beat_ms: nil]

  @typedoc """
  `lockstep` are its roles; `receiver` holds what was heard: peers, rejected messages; `sequence` is the number of the last
  heartbeat of this life, at `beat_ms`.
  """
  @type t :: %__MODULE__{
          lockstep: Lockstep.t(),
          receiver: Receiver.t(),
          sequence: non_neg_integer(),
          beat_ms: integer() | nil
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

  @type effect :: Lockstep.effect()

  @doc """
  A member. Options: `id`, `profile`, `start` (`Hal.Pose`, where the odometry reads zero),
  `mission` (`{module, options}`), `boot` (a number that grows with every start, default 1), `plan` (the walls of a floor
  plan, `Robot.Navigation.Grid`, or a `Robot.Navigation.OccupancyGrid` for those that its sonars will have seen), `order` (a
  seed from which the order is drawn in which roles hear each other; `nil`: as they tell it).
  """
  @spec new(keyword()) :: t()
  def new(options) do
    options =
      Keyword.validate!(
        options,
        [:id, :profile, :start, :mission, boot: 1, plan: nil, order: nil]
      )

    {module, mission_options} = options[:mission]

    # In lockstep nothing is a device: the trial carries out what it is told. The wheels are armed.
    given = Keyword.take(options, [:id, :profile, :start, :plan, :mission, :boot])
    config = struct!(Robot.Config, given ++ [drive: {__MODULE__, []}, ptz: {__MODULE__, []}])
    board = %{arming: {%{state: :armed, why: nil}, 0}}
    lockstep = Lockstep.new(config, @roles, board, options[:order])

    runner = Runner.new(options[:id], Controller.walls(lockstep.roles.executive.controller))
    {runner, []} = Runner.start(runner, module, mission_options)
    begun = [runner: runner, state: Runner.state(runner), options: mission_options]

    %__MODULE__{
      lockstep: update_in(lockstep.roles.pilot, &struct!(&1, begun)),
      receiver: Receiver.new(options[:id])
    }
  end

  @doc "Handles one input, and returns the effects."
  @spec step(t(), input()) :: {t(), [effect()]}
  def step(member, {:crash, role, at_ms}) when role in [:gate, :executive, :pilot, :estop],
    do: by(member, Lockstep.crash(member.lockstep, role, at_ms))

  def step(member, {:hang, {role, until_ms}, at_ms}) when role in [:executive, :pilot],
    do: by(member, Lockstep.hang(member.lockstep, role, until_ms, at_ms))

  def step(member, {:reading, {key, value} = reading, at_ms}) do
    member = put(member, key, value, at_ms)
    input(member, :gate, {:cast, {:sense, reading}}, at_ms)
  end

  def step(member, {:detections, detections}),
    do: {put(member, :detections, detections, detections.at_ms), []}

  def step(member, {:message, term, at_ms}), do: hear(member, Message.check(term), at_ms)

  def step(member, {:command, command, at_ms}) do
    with false <- EStop.takes?(command),
         {:ok, ways} <- ways(command, member) do
      event = {:command, CommandHandler.command(command)}
      delivery = %Delivery{ways: ways, until_ms: :infinity, reply: nil}
      input(member, :pilot, {:cast, {:deliver, delivery, event}}, at_ms)
    else
      true ->
        stamp = {member.lockstep.config.boot, 1_000 * at_ms}
        input(member, :estop, {:cast, {:command, command, nil, stamp}}, at_ms)

      {:error, _line} ->
        {member, []}
    end
  end

  def step(member, {:tick, at_ms}) do
    {member, woken} = woken(member, at_ms)
    {member, effects} = input(member, :executive, {:tick, percept(member, at_ms)}, at_ms)
    {member, beats} = beat(member, at_ms)
    {member, woken ++ effects ++ beats}
  end

  def step(member, {:reflex, at_ms}), do: input(member, :gate, :tick, at_ms)

  @doc """
  The same as `step/2` for a message that was checked before (`Swarm.Message.check/1`): once for all members that hear it.
  """
  @spec hear(t(), {:ok, Message.t()} | {:error, atom()}, integer()) :: {t(), [effect()]}
  def hear(member, checked, at_ms) do
    {heard, receiver} = Receiver.take(member.receiver, checked, at_ms)
    heard(%{member | receiver: receiver}, heard, at_ms)
  end

  @doc "Its name."
  @spec id(t()) :: atom()
  def id(member), do: member.lockstep.config.id

  @doc "The state of one of its roles."
  @spec role(t(), :gate | :executive | :pilot | :estop) :: Robot.Role.state()
  def role(member, role), do: Map.fetch!(member.lockstep.roles, role)

  @doc "Its mission (`Robot.Mission.Runner`)."
  @spec runner(t()) :: Runner.t()
  def runner(member), do: member.lockstep.roles.pilot.runner

  @doc """
  The distance in metres from its estimated pose within which the robot is in 95 of 100 cases
  (`Robot.Percept`), or `nil`.
  """
  @spec uncertainty(t()) :: float() | nil
  def uncertainty(member) do
    with %Percept{uncertainty: %{radius: radius}} <-
           Controller.percept(role(member, :executive).controller),
         do: radius,
         else: (_no_pose -> nil)
  end

  @doc """
  What the robot's mission claims (`t:Robot.Mission.effect/0`).
  """
  @spec claim(t()) :: map()
  def claim(member), do: runner(member).claim

  @doc "Who called the emergency stop that holds the robot (`Swarm.EStop.State.callers/1`); `nil` if none does."
  @spec held(t()) :: [String.t()] | nil
  def held(member) do
    stop = role(member, :estop).stop
    if EStop.State.held?(stop), do: EStop.State.callers(stop)
  end

  @doc "Whether the mission lets the robot stand and wait, for a round, a leader or a person."
  @spec stands?(t()) :: boolean()
  def stands?(member) do
    Runner.state(runner(member)) == :idle or role(member, :executive).controller.tag == :stand
  end

  # What people order goes the ways that it goes live; what a mission's own programs order is for the one that runs.
  defp ways(command, member)
       when is_alone(command) or command == :start or
              (is_tuple(command) and elem(command, 0) in [:start, :formation]),
       do: CommandHandler.ways(command, member.lockstep.config)

  defp ways(_other, _member), do: {:ok, [{:hand, {:except, Manual}}]}

  defp heard(member, {:message, message}, at_ms),
    do: input(member, :pilot, {:cast, {:message, message}}, at_ms)

  defp heard(member, :nothing, _at_ms), do: {member, []}

  defp heard(member, {:heartbeat, _id, beat}, at_ms) do
    if EStop.news?(role(member, :estop).stop, beat.estop),
      do: input(member, :estop, {:cast, {:beat, beat.estop}}, at_ms),
      else: {member, []}
  end

  defp input(member, role, input, at_ms),
    do: by(member, Lockstep.input(member.lockstep, role, input, at_ms))

  defp woken(%{lockstep: %{hung: hung}} = member, _at_ms) when hung == %{}, do: {member, []}
  defp woken(member, at_ms), do: by(member, Lockstep.wake(member.lockstep, at_ms))

  defp by(member, {lockstep, effects}) do
    %{id: id, boot: boot} = lockstep.config

    # Its comms comes behind all that can crash, and begins a new life, too.
    member =
      if boot == member.lockstep.config.boot,
        do: member,
        else: %{member | sequence: 0, beat_ms: nil, receiver: Receiver.new(id)}

    {%{member | lockstep: lockstep},
     Enum.map(effects, fn
       {:send, to, body} -> {:send, to, Message.of(id, body)}
       other -> other
     end)}
  end

  defp put(member, key, value, at_ms),
    do: %{member | lockstep: Lockstep.put(member.lockstep, key, value, at_ms)}

  @doc """
  What the robot knows for a tick at this time, before it has estimated its pose.
  """
  @spec percept(t(), integer()) :: Percept.t()
  def percept(%{lockstep: %{config: config, board: board}} = member, at_ms) do
    Percept.Snapshot.build(
      %Percept{
        robot: config.id,
        at_ms: at_ms,
        profile: config.profile,
        peers: Peers.percepts(member.receiver.peers, at_ms)
      },
      &Board.fetch(board, &1, &2, at_ms)
    )
  end

  defp beat(%{lockstep: %{config: config, board: board}} = member, at_ms) do
    from = {config.boot, member.sequence + 1}

    with true <- Heartbeat.due?(member.beat_ms, at_ms),
         {:ok, message} <- OwnHeartbeat.message(config, board, member.receiver, from, at_ms) do
      {%{member | sequence: member.sequence + 1, beat_ms: at_ms}, [{:send, :all, message}]}
    else
      _not_due_or_lost -> {member, []}
    end
  end
end
