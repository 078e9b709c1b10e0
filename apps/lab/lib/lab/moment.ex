defmodule Lab.Moment do
  @moduledoc """
  Shows a run at one moment as checks look at it: the true state of the world, and what robots claim. The same of a run in
  lockstep and of a fleet of processes (`Lab.Fleet.moment/1`). Pure.
  """
  alias Robot.Mission.Runner
  alias Lab.Trial
  alias Sim.{Radio, World}
  alias Lab.Trial.{Faults, RunLog}
  alias Swarm.{EStop, Member}

  @known [:at_ms, :options, :world, :run_log, :faults]
  @enforce_keys @known
  defstruct @known ++
              [claims: [], doing: %{}, parts: [], places: nil, stops: nil, crash: nil]

  @typedoc """
  `claims` are those of the living robots that are not frozen, `doing` (the mission and its phase) is that of the living ones
  (`:frozen` is one, too), `parts` are the robots that are not frozen and can reach each other by radio. `places`
  (`c:Robot.Mission.place/2`) and `stops` are `nil` where they are inside processes. `crash` is when and why the step after
  this moment raised.
  """
  @type t :: %__MODULE__{
          at_ms: non_neg_integer(),
          options: map(),
          world: World.t(),
          run_log: RunLog.t(),
          faults: Faults.t(),
          claims: [{atom(), map()}],
          doing: %{atom() => Runner.state() | :frozen},
          parts: [[atom()]],
          places: [{atom(), {:slot, term()} | {:fault, String.t()}}] | nil,
          stops: %{atom() => EStop.State.t()} | nil,
          crash: {at_ms :: non_neg_integer(), reason :: term()} | nil
        }

  @doc "A run before its first step, when nobody has claimed anything."
  @spec start(%{:at_ms => integer(), optional(atom()) => term()}) :: t()
  def start(run), do: struct!(__MODULE__, Map.take(run, @known))

  @doc "A run in lockstep after a step."
  @spec of(Trial.t()) :: t()
  def of(%Trial{members: members, at_ms: at_ms} = trial) do
    moment = start(trial)
    living = Trial.claims(trial)
    claims = Faults.awake(trial.faults, living, at_ms - 1)
    runners = for {id, _claim} <- claims, into: %{}, do: {id, Member.runner(members[id])}
    states = for {id, runner} <- runners, into: %{}, do: {id, Runner.state(runner)}

    places =
      for {id, _claim} <- claims,
          %{module: module, mission: mission} when module != nil <- [runners[id]],
          place = Robot.Mission.place(module, mission, at_ms),
          do: {id, place}

    %{
      moment
      | claims: claims,
        doing: doing(living, states),
        parts: Radio.parts(trial.radio, Keyword.keys(claims)),
        places: places,
        stops:
          for({id, _claim} <- claims, into: %{}, do: {id, Member.role(members[id], :estop).stop})
    }
  end

  @doc """
  A fleet of processes, with what its living robots claim, which says what they do, and the parts of its radio (`nil`: it is whole).
  """
  @spec of_processes(map(), [{atom(), map()}], [[atom()]] | nil) :: t()
  def of_processes(run, living, parts) do
    mission = run.run_log.mission
    claims = Faults.awake(run.faults, living, run.at_ms)
    phases = Robot.Mission.phases(mission)

    states =
      for {id, claim} <- claims, into: %{} do
        phase = claim[:phase] || :idle
        {id, {if(phase in phases, do: mission), phase}}
      end

    parts = parts || [for({id, _claim} <- claims, do: id)]
    %{start(run) | claims: claims, doing: doing(living, states), parts: parts}
  end

  defp doing(living, states),
    do: for({id, _claim} <- living, into: %{}, do: {id, Map.get(states, id, :frozen)})

  @doc """
  What robots claim of the run's mission, each with its `role` (`t:Robot.Mission.role/0`); what a
  robot with another mission claims is nothing that this one says.
  """
  @spec said(t()) :: [{atom(), map()}]
  def said(%{run_log: log} = moment) do
    for {id, claim} <- moment.claims do
      ours? = match?({mission, _phase} when mission == log.mission, moment.doing[id])
      {id, if(ours?, do: Map.put(claim, :role, RunLog.role(log, claim)), else: %{})}
    end
  end

  @doc "Simulated seconds since the start."
  @spec at_s(t()) :: float()
  def at_s(moment), do: moment.at_ms / 1000

  @doc "The robots named by `who`: one, or of `:all` those that live and are not frozen, in the order of the fleet."
  @spec who(t(), atom()) :: [atom()]
  def who(moment, :all), do: for({id, _claim} <- moment.claims, do: id)
  def who(_moment, robot), do: [robot]

  @doc "The phase of a robot's mission; `:idle` without one, `:frozen` without a processor, `:dead` of one that was killed."
  @spec phase(t(), atom()) :: atom()
  def phase(moment, robot) do
    case moment.doing do
      %{^robot => {_mission, phase}} -> phase
      %{^robot => state} when state in [:idle, :frozen] -> state
      _killed -> :dead
    end
  end

  @doc "What the robot does for its group in the phase it is in (`Robot.Mission.roles/1`); `nil` for nothing."
  @spec role(t(), atom()) :: Robot.Mission.role() | nil
  def role(moment, robot), do: moment.run_log.roles[phase(moment, robot)]

  @doc "Each part of the radio's network, with those who lead in it (`Lab.Trial.RunLog.leaders/2`)."
  @spec leaders(t()) :: [{part :: [atom()], leaders :: [atom()]}]
  def leaders(moment) do
    claims = for id <- who(moment, :all), do: {id, %{role: role(moment, id)}}
    RunLog.leaders(claims, moment.parts)
  end
end
