defmodule Swarm.Member do
  @moduledoc """
  Runs one robot of a fleet as one pure function: its roles, by `Robot.Lockstep`. `Lab.Trial` folds it in lockstep.

  | input | from |
  |---|---|
  | `{:reading, reading, at_ms}` | the drive, the pan-tilt unit, the lidar |
  | `{:detections, detections}` | the blob detector (`Vision.Detections`) |
  | `{:message, term, at_ms}` | another robot |
  | `{:command, command, at_ms}` | a person, with the effect `{:reply, answer}` once its outcome is known |
  | `{:tick, at_ms}` | the clock, 10 Hz: executive, then pilot, then comms |
  | `{:reflex, at_ms}` | the clock, 20 Hz: the gate |
  | `{:crash, role, at_ms}` | a fault: this role begins anew, and those behind it, as under their supervisor |
  | `{:hang, {role, until_ms}, at_ms}` | a fault: what arrives at executive or pilot waits; after 2 s it is killed |

  Effects are those of `Robot.Lockstep`.
  """
  alias Robot.{Board, Lockstep, Percept}
  alias Robot.Control.{Controller, Executive, Pilot}
  alias Robot.Mission.Runner
  alias Robot.Safety.Gate
  alias Swarm.{Comms, EStop}
  alias Swarm.Membership.Peers

  @roles [Gate, Executive, Pilot, EStop, Comms]

  @enforce_keys [:lockstep]
  defstruct @enforce_keys

  @typedoc "`lockstep` are its roles."
  @type t :: %__MODULE__{lockstep: Lockstep.t()}

  @type input ::
          {:reading, Hal.Drive.reading() | Hal.Ptz.reading() | Hal.Lidar.reading(), integer()}
          | {:detections, Vision.Detections.t()}
          | {:message, term(), integer()}
          | {:command, term(), integer()}
          | {:tick, integer()}
          | {:reflex, integer()}
          | {:crash, :gate | :executive | :pilot | :estop | :comms, integer()}
          | {:hang, {:executive | :pilot, until_ms :: integer()}, integer()}

  @type effect :: Lockstep.effect()

  @doc """
  A member. Options: `id`, `profile`, `start` (`Hal.Pose`, where the odometry reads zero),
  `mission` (`{module, options}`), `boot` (a number that grows with every start, default 1), `colours` (what its camera looks
  for, `Vision.Colours`; `nil` for a robot without), `marks` (`Robot.Config`), `plan` (the walls of a floor
  plan, `Nav.Grid`, or a `Nav.OccupancyGrid` for those that its sonars will have seen), `seed` (`Robot.Config`), `order` (a
  seed from which the order is drawn in which roles hear each other; `nil`: as they tell it).
  """
  @spec new(keyword()) :: t()
  def new(options) do
    options =
      Keyword.validate!(
        options,
        [:id, :profile, :start, :mission, boot: 1, colours: nil, marks: nil, plan: nil, seed: 0] ++
          [order: nil]
      )

    {module, mission_options} = options[:mission]

    # In lockstep nothing is a device: the trial carries out what it is told. The wheels are armed.
    own = [:id, :profile, :start, :plan, :seed, :mission, :boot, :colours, :marks]
    given = Keyword.take(options, own)

    camera = options[:colours] && {__MODULE__, []}
    scan = options[:profile].scan && {__MODULE__, []}

    others = [
      drive: {__MODULE__, []},
      ptz: {__MODULE__, []},
      camera: camera,
      scan: scan,
      pace: :manual
    ]

    config = struct!(Robot.Config, given ++ others)
    board = %{arming: {%{state: :armed, why: nil}, 0}}
    lockstep = Lockstep.new(config, @roles, board, options[:order])

    runner = Runner.new(options[:id], Controller.walls(lockstep.roles.executive.controller))
    {runner, []} = Runner.start(runner, module, mission_options)
    begun = [runner: runner, state: Runner.state(runner), options: mission_options]

    %__MODULE__{lockstep: update_in(lockstep.roles.pilot, &struct!(&1, begun))}
  end

  @doc "Handles one input, and returns the effects."
  @spec step(t(), input()) :: {t(), [effect()]}
  def step(member, {:crash, role, at_ms})
      when role in [:gate, :executive, :pilot, :estop, :comms],
      do: by(member, Lockstep.crash(member.lockstep, role, at_ms))

  def step(member, {:hang, {role, until_ms}, at_ms}) when role in [:executive, :pilot],
    do: by(member, Lockstep.hang(member.lockstep, role, until_ms, at_ms))

  def step(member, {:reading, {key, value} = reading, at_ms}) do
    member = put(member, key, value, at_ms)
    input(member, :gate, {:cast, {:sense, reading}}, at_ms)
  end

  def step(member, {:detections, detections}),
    do: {put(member, :detections, detections, detections.at_ms), []}

  def step(member, {:message, term, at_ms}),
    do: input(member, :comms, {:cast, {:hear, term}}, at_ms)

  def step(member, {:command, command, at_ms}) do
    order = {member.lockstep.config.boot, 1_000 * at_ms}
    {member, effects} = input(member, :comms, {:cast, {:command, command, nil, order}}, at_ms)

    # No base reports that it stands.
    if EStop.takes?(command) and command != :reset and member.lockstep.hung == %{},
      do: {member, effects ++ [{:reply, :ok}]},
      else: {member, effects}
  end

  def step(member, {:tick, at_ms}) do
    {member, woken} = woken(member, at_ms)
    {member, effects} = input(member, :executive, {:tick, percept(member, at_ms)}, at_ms)
    # There is no blackboard, and no other robot has its name.
    {member, beats} = input(member, :comms, {:tick, %{about: nil, taken?: false}}, at_ms)
    {member, woken ++ effects ++ beats}
  end

  def step(member, {:reflex, at_ms}), do: input(member, :gate, :tick, at_ms)

  @doc "Its name."
  @spec id(t()) :: atom()
  def id(member), do: member.lockstep.config.id

  @doc "The state of one of its roles."
  @spec role(t(), :gate | :executive | :pilot | :estop | :comms) :: Robot.Role.state()
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

  @doc "The pose that the robot believes to have, in the frame of its estimate (metres, radians), or `nil`."
  @spec believed(t()) :: Hal.Pose.t() | nil
  def believed(member) do
    with %Percept{pose: pose} <- Controller.percept(role(member, :executive).controller),
         do: pose
  end

  @doc """
  What the robot's mission claims (`t:Robot.Mission.effect/0`).
  """
  @spec claim(t()) :: map()
  def claim(member), do: Runner.claim(runner(member))

  @doc "The callers of the emergency stop that holds the robot (`Swarm.EStop.State.callers/1`); `nil` if none does."
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

  defp input(member, role, input, at_ms),
    do: by(member, Lockstep.input(member.lockstep, role, input, at_ms))

  defp woken(%{lockstep: %{hung: hung}} = member, _at_ms) when hung == %{}, do: {member, []}
  defp woken(member, at_ms), do: by(member, Lockstep.wake(member.lockstep, at_ms))

  defp by(member, {lockstep, effects}), do: {%{member | lockstep: lockstep}, effects}

  defp put(member, key, value, at_ms),
    do: %{member | lockstep: Lockstep.put(member.lockstep, key, value, at_ms)}

  @doc """
  What the robot knows for a tick at this time, before it has estimated its pose.
  """
  @spec percept(t(), integer()) :: Percept.t()
  def percept(%{lockstep: %{config: config, board: board, roles: %{comms: comms}}}, at_ms) do
    Percept.Snapshot.build(
      %Percept{
        robot: config.id,
        at_ms: at_ms,
        profile: config.profile,
        peers: Peers.percepts(comms.receiver.peers, at_ms)
      },
      &Board.fetch(board, &1, &2, at_ms)
    )
  end
end
