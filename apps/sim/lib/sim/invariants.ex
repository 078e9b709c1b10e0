defmodule Sim.Invariants do
  @moduledoc """
  Judges a run in lockstep at every tick, from outside. Pure. `mix chaos` asks for all invariants
  (`Sim.Chaos.Run`), a scenario for those that it names (`{:never, invariant}`, `Sim.Scenario.Check`).

  | invariant | judged by |
  |---|---|
  | `two_leaders`, `same_epoch`, `two_majorities`, `not_together`, `no_leader` | `Sim.Invariants.Leaders` |
  | `same_slot`, `bad_anchor` | `Sim.Invariants.Slots` |
  | `too_fast`, `too_abrupt`, `stop_ignored` | `Sim.Invariants.Limits` |
  | `stop_lost` | `Sim.Invariants.Stops` |
  | `collision` | contacts of `Sim.World`: a robot with a robot, alive or dead, or with a wall |
  | `stuck` | `Sim.Trial.Stuck`: short of its slot for 20 s without a word |
  | `false_claim` | `Sim.Trial.Claims`: `formed`, and the worst robot more than 0.5 m off then or 5 s later |
  | `crash` | a step of the run that raises (`step/2`) |

  `false_claim` is a promise in probability: a follower is in place if that is true in 95 of 100 cases,
  and the published goal is 99 % of all claims. Each false claim is told; whether many runs together
  violate it is decided by `goal/0` (`Sim.Chaos.Runner`). It is judged at the end of the run.

  A frozen robot is not asked anything: what it claimed last is old, and it cannot report that it is
  stuck. A robot that hears nothing, or whose camera is blind, is.

  Only the first violation of each invariant by the same robots is kept.
  """
  alias Sim.Invariants.{Attempt, Leaders, Limits, Slots, Stops, Violation, Withdrawals}
  alias Sim.{Radio, Trial}
  alias Sim.Trial.{Claims, Faults, RunLog, Stuck}
  alias Swarm.Member

  @names [:two_leaders, :same_epoch, :two_majorities, :not_together, :no_leader] ++
           [:same_slot, :bad_anchor, :too_fast, :too_abrupt, :stop_ignored, :stop_lost] ++
           [:collision, :stuck, :false_claim, :crash]
  # What a fleet of processes shows as well.
  @live [:two_leaders, :same_epoch, :two_majorities, :not_together, :no_leader] ++
          [:collision, :stuck, :false_claim]
  @goal 0.99

  @enforce_keys [:leaders, :slots, :stops, :withdrawals]
  defstruct @enforce_keys ++ [limits: Limits.new(), collisions: 0, stuck: 0, told: %{}]

  @type t :: %__MODULE__{
          leaders: Leaders.t(),
          slots: Slots.t(),
          stops: Stops.t(),
          withdrawals: Withdrawals.t(),
          limits: Limits.t(),
          collisions: non_neg_integer(),
          stuck: non_neg_integer(),
          told: %{{atom(), [atom()]} => Violation.t()}
        }

  @doc "All invariants, in the order of the report."
  @spec names() :: [atom(), ...]
  def names, do: @names

  @doc "Those that `watch/2` judges."
  @spec live() :: [atom(), ...]
  def live, do: @live

  @doc "The share of the claims of many runs that must be true."
  @spec goal() :: float()
  def goal, do: @goal

  @doc "The judge at the beginning of a trial, or of a fleet of processes."
  @spec new(%{:options => map(), optional(atom()) => term()}) :: t()
  def new(%{options: options}) do
    %__MODULE__{
      leaders: Leaders.new(options),
      slots: Slots.new(options),
      stops: Stops.new(options),
      withdrawals: Withdrawals.new(options)
    }
  end

  @doc """
  Advances the trial by 100 ms and judges it. One that raises stays as it was before that, and has violated `crash`.
  """
  @spec step(t(), Trial.t()) :: {Trial.t(), t()}
  def step(judge, %Trial{} = trial) do
    attempt = fn ->
      stepped = Trial.step(trial)
      {stepped, note(judge, stepped)}
    end

    case Attempt.call(attempt) do
      {:ok, done} -> done
      {:exit, reason} -> {trial, tell(judge, [Violation.crash(trial.at_ms, reason)])}
    end
  end

  @doc "One tick: the trial after a step."
  @spec note(t(), Trial.t()) :: t()
  def note(judge, %Trial{at_ms: at_ms, world: world, run_log: log} = trial) do
    said = Faults.awake(trial.faults, Trial.claims(trial), at_ms - 1)
    ids = for {id, _claim} <- said, do: id
    parts = Radio.parts(trial.radio, ids)
    stops = for id <- ids, into: %{}, do: {id, Member.role(trial.members[id], :estop).stop}
    held = for {id, %{held: [_ | _]}} <- stops, do: id

    runners = for id <- ids, into: %{}, do: {id, Member.runner(trial.members[id])}

    places =
      for id <- ids,
          %{module: module, mission: mission} when module != nil <- [runners[id]],
          place = Robot.Mission.place(module, mission, at_ms),
          do: {id, place}

    # What a robot with another mission claims is nothing that this one says.
    claims =
      for {id, claim} <- said,
          do: {id, if(runners[id].module == log.mission, do: known(claim, log), else: %{})}

    bodies = for id <- ids, do: world.robots[id]

    {led, leaders} = Leaders.note(judge.leaders, at_ms, claims, parts)
    {placed, slots} = Slots.note(judge.slots, at_ms, places)
    {driven, limits} = Limits.note(judge.limits, at_ms, bodies, held, lifted(trial))
    {stopped, stops} = Stops.note(judge.stops, at_ms, stops, parts)
    withdrawals = Withdrawals.note(judge.withdrawals, at_ms, claims)

    judge = %{
      judge
      | leaders: leaders,
        slots: slots,
        limits: limits,
        stops: stops,
        withdrawals: withdrawals
    }

    {touched, judge} = contacts(judge, world)
    {silent, judge} = silences(judge, trial)
    tell(judge, led ++ placed ++ driven ++ stopped ++ touched ++ silent)
  end

  @doc """
  One look at a fleet of processes, ten times a second (`Sim.Fleet.moment/1`): of the invariants those of `live/0`. Where its robots
  agree on places, and how their wheels turn, is inside processes, or between two looks.
  """
  @spec watch(t(), Sim.Fleet.moment()) :: t()
  def watch(judge, %{at_ms: at_ms, run_log: log} = moment) do
    phases = Robot.Mission.phases(log.mission)

    claims =
      for {id, claim} <- moment.claims,
          do: {id, if(claim[:phase] in phases, do: known(claim, log), else: %{})}

    {led, leaders} = Leaders.note(judge.leaders, at_ms, claims, moment.parts)
    withdrawals = Withdrawals.note(judge.withdrawals, at_ms, claims)
    {touched, judge} = contacts(judge, moment.world)
    {silent, judge} = silences(judge, moment)
    tell(%{judge | leaders: leaders, withdrawals: withdrawals}, led ++ touched ++ silent)
  end

  @doc "The end of the run, with its report (`Sim.Trial.result/1`): its claims can be judged now."
  @spec finish(t(), map()) :: t()
  def finish(judge, %{claims: claims}) do
    wrong =
      for %{robot: leader, at_s: at_s} = claim <- claims, right?(judge, claim) == false do
        Violation.new(:false_claim, round(at_s * 1000), [leader], metres(claim))
      end

    tell(judge, wrong)
  end

  @doc """
  Whether a claim was true (`Sim.Trial.Claims.right?/1`), `nil` if there is nothing to judge. One that
  was being withdrawn when it was judged again is judged by its beginning alone
  (`Sim.Invariants.Withdrawals`).
  """
  @spec right?(t(), Claims.claim()) :: boolean() | nil
  def right?(judge, claim) do
    if Withdrawals.withdrawn?(judge.withdrawals, claim),
      do: Claims.right?(%{claim | worst_5s_m: nil}),
      else: Claims.right?(claim)
  end

  @doc "The violations up to now, by time."
  @spec violations(t()) :: [Violation.t()]
  def violations(judge),
    do: judge.told |> Map.values() |> Enum.sort_by(&{&1.at_ms, &1.invariant, &1.robots})

  @doc "The first violation of this invariant up to now, `nil` if there is none."
  @spec first(t(), atom()) :: Violation.t() | nil
  def first(judge, invariant),
    do: judge |> violations() |> Enum.find(&(&1.invariant == invariant))

  @doc "Whether this invariant was violated up to now."
  @spec violated?(t(), atom()) :: boolean()
  def violated?(judge, invariant),
    do: Enum.any?(judge.told, fn {{name, _robots}, _violation} -> name == invariant end)

  defp known(claim, log) do
    more = %{role: RunLog.role(log, claim), sight: RunLog.account(log, claim).sight}
    Map.merge(claim, more)
  end

  # Those that a person has put somewhere else in this step.
  defp lifted(%{at_ms: at_ms, run_log: %{stages: newest_first}}) do
    now = Enum.take_while(newest_first, &(round(&1.at_s * 1000) >= at_ms - 100))
    for %{stage: :displaced, robot: id} <- now, do: id
  end

  # The world keeps the newest contacts.
  defp contacts(%{collisions: known} = judge, %{collisions: known}), do: {[], judge}

  defp contacts(judge, world) do
    wrong =
      for {at_ms, parties, with} <- Enum.take(world.contacts, world.collisions - judge.collisions) do
        ids = for {id, _place, _speed} <- parties, do: id

        speeds =
          Enum.map_join(parties, ", ", fn {id, {x, y}, speed} ->
            "#{id} at #{figure(x)},#{figure(y)} with #{figure(speed)} m/s"
          end)

        Violation.new(
          :collision,
          at_ms,
          ids,
          if(with == :wall, do: "wall, " <> speeds, else: speeds)
        )
      end

    {Enum.reverse(wrong), %{judge | collisions: world.collisions}}
  end

  # A robot that was frozen meanwhile could not report it.
  defp silences(%{stuck: known} = judge, %{at_ms: at_ms} = trial) do
    told = Stuck.report(trial.run_log.stuck)

    wrong =
      for %{robot: id, at_s: at_s, error_m: error_m} <- Enum.drop(told, known),
          not frozen_since?(trial.faults, id, round(at_s * 1000)) do
        figures =
          "#{figure(error_m)} m off since #{Violation.decimals(at_s, 1)} s, and says nothing"

        Violation.new(:stuck, at_ms, [id], figures)
      end

    {wrong, %{judge | stuck: length(told)}}
  end

  defp frozen_since?(faults, id, since_ms) do
    Enum.any?(faults.all, fn {kind, robot, _from_ms, to_ms} ->
      {kind, robot} == {:frozen, id} and to_ms > since_ms
    end)
  end

  defp metres(%{worst_m: then, worst_5s_m: later}) do
    "worst robot " <>
      Enum.map_join([{"then", then}, {"5 s later", later}], ", ", fn {when?, metres} ->
        "#{if metres, do: figure(metres), else: "?"} m #{when?}"
      end)
  end

  defp tell(judge, violations) do
    told =
      Enum.reduce(violations, judge.told, fn violation, told ->
        Map.put_new(told, {violation.invariant, violation.robots}, violation)
      end)

    %{judge | told: told}
  end

  defp figure(number), do: Violation.decimals(number, 2)
end
