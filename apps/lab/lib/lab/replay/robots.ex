defmodule Lab.Replay.Robots do
  @moduledoc """
  Replays a recording of robots of processes, tick by tick: whether their roles decide the same again (`Record.Replay`), and
  how the fleet stands by what its robots say. Pure if the missions are.

  No robot knows the truth: poses are those that each believes, and there is no map and no error of a formation.
  Leader, epoch, `formed` and stages are judged from the missions' claims, as for a live fleet (`Lab.Fleet`).
  """
  @behaviour Lab.Replay.Kind
  alias Robot.Mission.{Claim, Letter, Runner}
  alias Robot.Percept
  alias Record.Recording
  alias Record.Recording.Topics
  alias Record.Replay.Moment
  alias Sim.Scene
  alias Lab.Trial.{Evaluation, RunLog}
  alias Swarm.EStop.State

  # A robot of which nothing was recorded for so long is not counted among the living.
  @silent_ms 1_000
  # What is ahead of a leader changes the places in a shape, and not the shape.
  @ahead_m 1.0
  @new %{pose: nil, radius: nil, uncertainty: nil, driving: nil, claim: %{}, mission: nil}

  @enforce_keys [:shifts, :only]
  defstruct @enforce_keys ++
              [replay: Record.Replay.new(), run_log: %RunLog{}, robots: %{}, at_ms: 0]

  @typedoc "`shifts` are added to a robot's time for that since the start; `only` is the one robot that is compared."
  @type t :: %__MODULE__{
          shifts: %{atom() => integer()},
          only: String.t() | nil,
          replay: Record.Replay.t(),
          run_log: RunLog.t(),
          robots: %{atom() => map()},
          at_ms: non_neg_integer()
        }

  @doc "The start of a replay; with the name of a robot, only that one decides again."
  @spec new(Recording.File.t(), only :: String.t() | nil) :: t()
  def new(%Recording.File{} = file, only \\ nil) do
    shifts =
      for id <- Recording.File.ids(file),
          into: %{},
          do: {id, Recording.File.since_start_ms(file, id, 0)}

    %__MODULE__{shifts: shifts, only: only}
  end

  @impl Lab.Replay.Kind
  def step(%__MODULE__{} = replay, {at_ms, entries}) do
    {replay, found} = Enum.reduce(entries, {%{replay | at_ms: at_ms}, []}, &entry/2)
    living = for {id, robot} <- replay.robots, living?(replay, robot), do: {id, claim(replay, id)}
    run_log = RunLog.note(replay.run_log, at_ms, Enum.sort(living))
    {%{replay | run_log: run_log}, Enum.reverse(found)}
  end

  defp entry({id, entry}, {replay, found}) do
    {compared, difference} =
      if replay.only in [nil, Atom.to_string(id)],
        do: Record.Replay.step(replay.replay, {id, entry}),
        else: {replay.replay, nil}

    found = for(difference <- List.wrap(difference), do: decision(replay, difference)) ++ found
    {learn(%{replay | replay: compared}, id, entry), found}
  end

  defp decision(replay, difference),
    do: {:decision, %{difference | at_ms: since(replay, difference.robot, difference.at_ms)}}

  defp since(replay, id, at_ms), do: at_ms + Map.get(replay.shifts, id, 0)

  defp learn(replay, id, {_role, kind, _what, at_ms} = entry) do
    robot = Map.get(replay.robots, id, @new)
    known_ms = if kind == :lost, do: robot[:known_ms], else: since(replay, id, at_ms)
    robot = robot |> Map.put(:known_ms, known_ms) |> know(entry)
    tell(%{replay | robots: Map.put(replay.robots, id, robot)}, id, entry, robot.mission)
  end

  defp know(robot, {:executive, :effect, {:cast, :pilot, {:tick, %Percept{} = percept}}, _at_ms}) do
    within = with %{radius: radius} <- percept.uncertainty, do: radius
    %{robot | pose: percept.pose, radius: percept.profile.radius, uncertainty: within}
  end

  defp know(robot, {:gate, :effect, {:drive, twist, limits}, _at_ms}),
    do: %{robot | driving: %{twist: twist, limits: limits}}

  defp know(robot, {:pilot, :effect, {:claim, %{} = claim}, _at_ms}), do: %{robot | claim: claim}

  defp know(robot, {:pilot, :effect, {:phase, state}, _at_ms}), do: mission(robot, state)

  defp know(robot, {:pilot, kind, %{state: state}, _at_ms}) when kind in [:begin, :checkpoint],
    do: mission(robot, state)

  defp know(robot, _entry), do: robot

  defp mission(robot, {mission, phase}),
    do: %{robot | mission: mission, claim: Map.put_new(robot.claim, :phase, phase)}

  defp mission(robot, _idle), do: %{robot | mission: nil, claim: %{}}

  defp tell(replay, id, {:pilot, :effect, {:stage, name, facts}, at_ms}, mission) do
    run_log = know_roles(replay.run_log, mission)
    %{replay | run_log: RunLog.stage(run_log, since(replay, id, at_ms), name, id, facts)}
  end

  defp tell(replay, _id, {:pilot, _kind, _what, _at_ms}, mission),
    do: %{replay | run_log: know_roles(replay.run_log, mission)}

  defp tell(replay, _id, _entry, _mission), do: replay

  defp know_roles(run_log, nil), do: run_log

  defp know_roles(run_log, mission),
    do: %{run_log | roles: Map.merge(run_log.roles, Robot.Mission.roles(mission))}

  defp living?(replay, robot),
    do: robot.known_ms != nil and replay.at_ms - robot.known_ms <= @silent_ms

  # As the board of a live robot has it.
  defp claim(replay, id) do
    robot = replay.robots[id]

    case Record.Replay.state(replay.replay, id, :estop) do
      %{stop: %State{held: [_ | _]} = stop} -> Map.put(robot.claim, :estop, State.callers(stop))
      _free -> robot.claim
    end
  end

  @impl Lab.Replay.Kind
  def finish(%__MODULE__{} = replay) do
    {compared, found} = Record.Replay.finish(replay.replay)
    {%{replay | replay: compared}, Enum.map(found, &decision(replay, &1))}
  end

  @impl Lab.Replay.Kind
  def at_ms(%__MODULE__{at_ms: at_ms}), do: at_ms

  @impl Lab.Replay.Kind
  def stages(%__MODULE__{run_log: run_log}), do: RunLog.stages(run_log)

  @impl Lab.Replay.Kind
  def scene(%__MODULE__{run_log: run_log} = replay) do
    robots = for {id, %{pose: %Hal.Pose{}} = robot} <- replay.robots, do: seen(replay, id, robot)
    robots = Enum.sort_by(robots, & &1.id)
    leader = RunLog.leader(run_log)

    %Scene{
      at_ms: replay.at_ms,
      map: nil,
      robots: robots,
      layer: Evaluation.layer([leader | Enum.map(robots, & &1.id)], &layer(replay, &1)),
      leader: leader,
      formation: formation(replay, leader),
      epoch: run_log.epoch,
      formed?: RunLog.formed?(run_log),
      estop: run_log.estop,
      stages: RunLog.stages(run_log)
    }
  end

  @doc "What the mission of a robot draws now (`c:Robot.Mission.layer/1`), as far as it decides again here."
  @spec layer(t(), robot :: atom() | nil) :: Robot.Mission.layer()
  def layer(%__MODULE__{replay: replay}, id) do
    case Record.Replay.state(replay, id, :pilot) do
      %{runner: runner} -> Runner.layer(runner)
      nil -> []
    end
  end

  # As its leader means it.
  defp formation(replay, leader) do
    with %{mission: mission, pose: %Hal.Pose{} = pose, claim: claim} when mission != nil <-
           replay.robots[leader],
         %{formation: formation} <- Robot.Mission.shape(mission, claim, pose, @ahead_m),
         do: formation,
         else: (_leads_none -> nil)
  end

  defp seen(replay, id, robot) do
    claim = claim(replay, id)
    account = Evaluation.account_of(robot.mission, claim)

    %{
      id: id,
      pose: robot.pose,
      radius: robot.radius,
      alive: living?(replay, robot),
      state: account.state,
      slot: nil,
      leader?: id == RunLog.leader(replay.run_log),
      uncertainty: robot.uncertainty,
      says: claim[:says],
      size_ppm: account.sight && account.sight.size_ppm
    }
  end

  @impl Lab.Replay.Kind
  def reasons(%__MODULE__{replay: replay} = all, _before, _tick, id) do
    with %Moment{} = moment <- Record.Replay.moment(replay, id),
         %{order: order} = reasons <- Moment.reasons(moment) do
      order = order && %{order | at_ms: since(all, id, order.at_ms)}
      {since(all, id, moment.at_ms), %{reasons | order: order}}
    end
  end

  @impl Lab.Replay.Kind
  def doing(%__MODULE__{robots: robots}, id) do
    robot = Map.get(robots, id, @new)
    %{mission: robot.mission, driving: robot.driving, known_ms: robot[:known_ms]}
  end

  @impl Lab.Replay.Kind
  def compared(%__MODULE__{replay: replay}) do
    parts = Record.Replay.counts(replay)
    sum = fn what -> parts |> Enum.map(fn {_part, counts} -> counts[what] end) |> Enum.sum() end

    for what <- [:inputs, :decisions, :lost, :skipped],
        into: %{parts: parts, world?: false},
        do: {what, sum.(what)}
  end

  @impl Lab.Replay.Kind
  def facts(%__MODULE__{}, {_at_ms, entries}) do
    speeds =
      for {id, {:gate, :effect, {:drive, twist, _limits}, _at_ms}} <- entries,
          into: %{},
          do: {id, twist}

    sent =
      for {id, {:pilot, :effect, {:send, to, message}, _at_ms}} <- entries,
          do: {id, to, Topics.kind(message), nil}

    %{sent: sent, speeds: speeds, seen: []}
  end

  @impl Lab.Replay.Kind
  def messages(%__MODULE__{}, {_at_ms, entries}) do
    for {id, {:pilot, :effect, {:send, to, %type{} = message}, _at_ms}} <- entries,
        type in [Swarm.Message, Letter, Claim],
        do: {id, to, Swarm.Message.of(id, message)}
  end
end
