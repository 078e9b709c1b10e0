defmodule Lab.Chaos.Runner do
  @moduledoc """
  Plays many runs side by side, judges each, and shrinks each violation. The result does not depend on how many
  are played at once.
  """
  alias Lab.Chaos.{Draw, Shrink}
  alias Lab.Check.{Invariants, Violation}
  alias Lab.{Run, Trial}

  # A run that violates many invariants mostly has one cause.
  @most_shrunk 2

  @typedoc """
  What became of a run: its violations, and figures for the table. `claims` counts those that can be
  judged, `true_claims` the true ones among them.
  """
  @type outcome :: %{
          violations: [Violation.t()],
          simulated_s: float(),
          robots: pos_integer(),
          elections: non_neg_integer(),
          partitions: non_neg_integer(),
          kills: non_neg_integer(),
          formed?: boolean(),
          ended_formed?: boolean(),
          claims: non_neg_integer(),
          true_claims: non_neg_integer(),
          rivals_s: float()
        }

  @typedoc """
  A violation of a run, and the smallest run that still violates this invariant, by which violation,
  after so many attempts.
  """
  @type failure :: %{
          number: pos_integer(),
          violation: Violation.t(),
          smallest: keyword(),
          again: Violation.t(),
          attempts: non_neg_integer()
        }

  @type played :: %{number: pos_integer(), outcome: outcome() | nil, failures: [failure()]}

  @typedoc "The runs by number, and whether they are clean together."
  @type report :: %{seed: integer(), runs: [played()], clean?: boolean()}

  @doc """
  Plays these runs of a seed. Options: `jobs` (how many at once, default one a scheduler), `attempts`
  (to shrink a violation, default 40), `done` (called with each `t:played/0` in the order in which
  they end), `draw` (default `Lab.Chaos.Draw.options/2`).
  """
  @spec run(integer(), Enumerable.t(), keyword()) :: report()
  def run(seed, numbers, options \\ []) do
    options =
      Keyword.validate!(options,
        jobs: System.schedulers_online(),
        attempts: 40,
        done: fn _played -> :ok end,
        draw: &Draw.options/2
      )

    runs =
      numbers
      |> Task.async_stream(&play(seed, &1, options),
        max_concurrency: options[:jobs],
        timeout: :infinity,
        ordered: false
      )
      |> Enum.map(fn {:ok, played} ->
        options[:done].(played)
        played
      end)
      |> Enum.sort_by(& &1.number)

    %{seed: seed, runs: runs, clean?: clean?(runs)}
  end

  @doc """
  Whether runs are clean together: no violation, but for false claims, of which the goal of
  `Lab.Check.Invariants.goal/0` allows some among many.
  """
  @spec clean?([played()]) :: boolean()
  def clean?(runs) do
    {claims, true_claims} = claims(runs)

    true_claims >= Invariants.goal() * claims and
      Enum.all?(runs, fn run -> Enum.all?(found(run), &(&1.invariant == :false_claim)) end)
  end

  @doc "How many claims of `formed` could be judged in these runs, and how many of them were true."
  @spec claims([played()]) :: {non_neg_integer(), non_neg_integer()}
  def claims(runs) do
    outcomes = for %{outcome: outcome} when outcome != nil <- runs, do: outcome
    {Enum.sum(Enum.map(outcomes, & &1.claims)), Enum.sum(Enum.map(outcomes, & &1.true_claims))}
  end

  @doc "The violations of a run."
  @spec found(played()) :: [Violation.t()]
  def found(%{outcome: nil, failures: failures}), do: Enum.map(failures, & &1.violation)
  def found(%{outcome: outcome}), do: outcome.violations

  defp play(seed, number, options) do
    run = options[:draw].(seed, number)
    {outcome, violations} = attempt(run)

    failures =
      violations
      |> Enum.uniq_by(& &1.invariant)
      |> Enum.take(@most_shrunk)
      |> Enum.map(&failure(&1, number, run, options[:attempts]))

    %{number: number, outcome: outcome, failures: failures}
  end

  defp attempt(run) do
    case isolated(fn -> judge(run) end) do
      {:ok, {:ok, outcome}} -> {outcome, outcome.violations}
      {:ok, {:error, line}} -> {nil, [Violation.new(:crash, 0, [], "not a run: " <> line)]}
      {:exit, reason} -> {nil, [Violation.crash(0, reason)]}
    end
  end

  # In a process of its own, so that what it raises is a finding and not the end.
  defp isolated(function) do
    {pid, monitor} =
      spawn_monitor(fn ->
        Trial.Memory.prepare()
        exit({:chaos_value, Run.attempt(function)})
      end)

    receive do
      {:DOWN, ^monitor, :process, ^pid, {:chaos_value, result}} -> result
      {:DOWN, ^monitor, :process, ^pid, reason} -> {:exit, reason}
    end
  end

  defp failure(violation, number, run, attempts) do
    judge = fn run ->
      with %Violation{at_ms: at_ms} <- again(run, violation.invariant), do: at_ms
    end

    {smallest, needed} = Shrink.shrink(run, judge, attempts)

    %{
      number: number,
      violation: violation,
      smallest: smallest,
      again: if(smallest == run, do: violation, else: again(smallest, violation.invariant)),
      attempts: needed
    }
  end

  # A run that cannot even be set up raises outside its steps.
  defp again(run, invariant) do
    case isolated(fn -> first(run, invariant) end) do
      {:ok, violation} -> violation
      {:exit, reason} -> if invariant == :crash, do: Violation.crash(0, reason)
    end
  end

  @doc "Plays a run to its end; the error is one line of `Lab.Trial.new/1`."
  @spec judge(keyword()) :: {:ok, outcome()} | {:error, String.t()}
  def judge(options) do
    with {:ok, trial} <- Trial.new(Map.new(options)),
         do: {:ok, trial |> judged(&Run.done?/1) |> outcome()}
  end

  @doc """
  The first violation of this invariant, `nil` if there is none, or if there cannot be such a run. The
  run ends with it.
  """
  @spec first(keyword(), atom()) :: Violation.t() | nil
  def first(options, invariant) do
    case Trial.new(Map.new(options)) do
      {:ok, trial} -> first_of(trial, invariant)
      {:error, _line} -> nil
    end
  end

  @doc "The same of a run that was set up."
  @spec first_of(Trial.t(), atom()) :: Violation.t() | nil
  def first_of(%Trial{} = trial, invariant) do
    found? = fn %{checks: [judge]} -> Invariants.first(judge, invariant) != nil end
    run = judged(trial, &(Run.done?(&1) or found?.(&1)))
    [judge] = run.checks
    judge = if found?.(run), do: judge, else: Invariants.finish(judge, Run.result(run))
    Invariants.first(judge, invariant)
  end

  defp judged(trial, over?),
    do: trial |> Run.new([Invariants.new(trial.options)], guarded?: true) |> Run.play(over?)

  defp outcome(%{checks: [judge]} = run) do
    result = Run.result(run)
    judge = Invariants.finish(judge, result)

    judged =
      for claim <- result.claims, (right? = Invariants.right?(judge, claim)) != nil, do: right?

    told = Enum.frequencies_by(result.stages, & &1.stage)

    %{
      violations: Invariants.violations(judge),
      simulated_s: result.simulated_s,
      robots: result.robots,
      elections: Map.get(told, :elected, 0),
      kills: Map.get(told, :killed, 0),
      partitions: length(result.agreement.heals),
      formed?: is_map_key(told, :formed),
      ended_formed?: Trial.formed?(run.source),
      claims: length(judged),
      true_claims: Enum.count(judged, & &1),
      rivals_s: result.agreement.rivals_max_s
    }
  end
end
