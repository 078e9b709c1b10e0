defmodule Lab.Check.Invariants do
  @moduledoc """
  Lists what `mix chaos` judges of every run, from outside. Pure. A scenario asks for one of them (`{:never, invariant}`).

  | invariant | judged by |
  |---|---|
  | `two_leaders`, `same_epoch`, `two_majorities`, `not_together`, `no_leader` | `Lab.Check.Leaders` |
  | `same_slot`, `bad_anchor` | `Lab.Check.Slots` |
  | `too_fast`, `too_abrupt`, `stop_ignored` | `Lab.Check.Limits` |
  | `stop_lost` | `Lab.Check.Stops` |
  | `collision` | contacts of `Sim.World`: a robot with a robot, alive or dead, or with a wall |
  | `stuck` | `Lab.Trial.Progress`: short of its slot for 20 s without a word |
  | `false_claim` | `Lab.Check.Claims`: `formed`, and the worst robot more than 0.5 m off then or 5 s later |
  | `crash` | a step of the run that raises (`Lab.Run`) |

  `false_claim` is a promise in probability: a follower is in place if that is true in 95 of 100 cases,
  and the published goal is 99 % of all claims. Each false claim is told; whether many runs together
  violate it is decided by `goal/0` (`Lab.Chaos.Runner`). It is judged at the end of the run.

  A frozen robot is not asked anything: what it claimed last is old, and it cannot report that it is
  stuck. A robot that hears nothing, or whose camera is blind, is.

  Only the first violation of each invariant by the same robots is kept.
  """
  alias Lab.Check.{Claims, Contacts, Crash, Leaders, Limits, Silences, Slots, Stops, Violation}
  alias Lab.Moment

  # In the order of the report.
  @table [
    {Leaders, [:two_leaders, :same_epoch, :two_majorities, :not_together, :no_leader]},
    {Slots, [:same_slot, :bad_anchor]},
    {Limits, [:too_fast, :too_abrupt, :stop_ignored]},
    {Stops, [:stop_lost]},
    {Contacts, [:collision]},
    {Silences, [:stuck]},
    {Claims, [:false_claim]},
    {Crash, [:crash]}
  ]
  @goal 0.99

  @enforce_keys [:kinds]
  defstruct @enforce_keys ++ [told: %{}]

  @type t :: %__MODULE__{
          kinds: [{module(), memory :: term()}],
          told: %{{atom(), [atom()]} => Violation.t()}
        }

  @doc "All invariants, in the order of the report."
  @spec names() :: [atom(), ...]
  def names, do: Enum.flat_map(@table, &elem(&1, 1))

  @doc "The module that judges an invariant (`Lab.Check.Kind`)."
  @spec kind(atom()) :: module()
  def kind(invariant) do
    {kind, _its} = Enum.find(@table, fn {_kind, its} -> invariant in its end)
    kind
  end

  @doc "The share of the claims of many runs that must be true."
  @spec goal() :: float()
  def goal, do: @goal

  @doc "The judge at the beginning of a run with these options."
  @spec new(map()) :: t()
  def new(options),
    do: %__MODULE__{kinds: for({kind, _its} <- @table, do: {kind, kind.new(options)})}

  @doc "One moment. One that a step did not survive was judged before."
  @spec tick(t(), Moment.t()) :: t()
  def tick(judge, %{crash: {_at_ms, _reason}} = moment) do
    {:never, wrong, _memory} = Crash.note({:never, :crash}, moment, nil)
    tell(judge, wrong)
  end

  def tick(judge, moment) do
    {kinds, wrong} =
      Enum.map_reduce(judge.kinds, [], fn {kind, memory}, wrong ->
        {:never, more, memory} = kind.note({:never, :any}, moment, memory)
        {{kind, memory}, wrong ++ more}
      end)

    tell(%{judge | kinds: kinds}, wrong)
  end

  @doc "The end of the run, with its report (`Lab.Trial.result/1`): its claims can be judged now."
  @spec finish(t(), map()) :: t()
  def finish(judge, result), do: tell(judge, Claims.finish(memory(judge, Claims), result))

  @doc "Whether a claim was true (`Lab.Check.Claims.right?/2`), `nil` if there is nothing to judge."
  @spec right?(t(), Lab.Trial.Claims.claim()) :: boolean() | nil
  def right?(judge, claim), do: Claims.right?(memory(judge, Claims), claim)

  defp memory(judge, kind), do: judge.kinds |> List.keyfind!(kind, 0) |> elem(1)

  @doc "The violations up to now, by time."
  @spec violations(t()) :: [Violation.t()]
  def violations(judge),
    do: judge.told |> Map.values() |> Enum.sort_by(&{&1.at_ms, &1.invariant, &1.robots})

  @doc "The first violation of this invariant up to now, `nil` if there is none."
  @spec first(t(), atom()) :: Violation.t() | nil
  def first(judge, invariant),
    do: judge |> violations() |> Enum.find(&(&1.invariant == invariant))

  defp tell(judge, violations) do
    told =
      Enum.reduce(violations, judge.told, fn violation, told ->
        Map.put_new(told, {violation.invariant, violation.robots}, violation)
      end)

    %{judge | told: told}
  end
end
