defmodule Console.Chaos.Report do
  @moduledoc "Writes what `mix chaos` prints and writes of its runs. Pure."
  alias Console.Cli.Format
  alias Lab.Chaos.Runner
  alias Lab.Check.{Invariants, Violation}

  @doc "The line of a failure: the run, what was wrong, and the command that plays it again; `words` are its options that draw (`Console.Chaos.Options.words/1`)."
  @spec failure(String.t(), Runner.failure()) :: String.t()
  def failure(words, %{number: number, violation: violation} = failure) do
    "run #{number}: #{Violation.line(violation)} (mix chaos #{words} --run #{number})" <>
      size(failure)
  end

  defp size(%{attempts: 0}), do: ""

  defp size(%{smallest: smallest}) do
    events = for key <- [:kills, :moves, :cuts, :script], do: length(smallest[key] || [])

    "; shrunk to #{Format.count(length(smallest[:robots]), "robot")}, " <>
      "#{Format.count(Enum.sum(events), "event")}, #{smallest[:duration_s]} s"
  end

  @doc "A note for the progress line."
  @spec note(violations :: non_neg_integer()) :: String.t()
  def note(violations), do: Format.count(violations, "violation")

  @doc "The table at the end."
  @spec table(Runner.report()) :: String.t()
  def table(report) do
    %{figures: figures, violations: violations} = summary(report)
    %{claims: claims, true_claims: true_claims} = figures

    rows = [
      {"runs", "#{figures.runs}"},
      {"simulated hours", Format.decimals(figures.simulated_s / 3600, 2)},
      {"elections", "#{figures.elections}"},
      {"partitions healed", "#{figures.partitions}"},
      {"robots killed", "#{figures.kills}"},
      {"runs that formed / ended in formation", "#{figures.formed} / #{figures.ended_formed}"},
      {"true claims of formed", "#{true_claims} of #{claims}#{share(true_claims, claims)}"},
      {"two leaders that reach each other, longest", "#{Format.decimals(figures.rivals_s, 1)} s"}
    ]

    wrong =
      for {invariant, runs} <- violations,
          do: {"#{invariant}", if(runs == [], do: "none", else: "runs #{listed(runs)}")}

    Enum.join(
      lines(["", "chaos, seed #{report.seed}"], rows) ++
        [""] ++ lines(["violated", "in"], wrong),
      "\n"
    )
  end

  defp lines(heads, rows) do
    for row <- [heads, ["---", "---"] | Enum.map(rows, &Tuple.to_list/1)],
        do: "| " <> Enum.join(row, " | ") <> " |"
  end

  defp share(_true_claims, 0), do: ""
  defp share(some, all), do: " (#{Format.decimals(100 * some / all, 1)} %, the goal is 99 %)"

  defp listed(runs) do
    {first, others} = Enum.split(runs, 10)
    more = if others == [], do: "", else: " and #{length(others)} more"
    Enum.join(first, ", ") <> more
  end

  @doc "The report for `--json`; its numbers are those of the table."
  @spec json(Runner.report()) :: map()
  def json(report) do
    %{figures: figures, violations: violations} = summary(report)

    %{
      seed: report.seed,
      clean: report.clean?,
      figures: figures,
      violations: for({name, runs} <- violations, do: %{invariant: name, runs: runs}),
      failures:
        for run <- report.runs, failure <- run.failures do
          %{
            run: failure.number,
            violation: violation(failure.violation),
            shrunk: violation(failure.again),
            attempts: failure.attempts,
            options: inspect(failure.smallest, limit: :infinity, width: 98)
          }
        end
    }
  end

  defp violation(violation), do: Map.from_struct(violation)

  defp summary(%{runs: runs}) do
    outcomes = for %{outcome: outcome} when outcome != nil <- runs, do: outcome
    sum = fn key -> outcomes |> Enum.map(&Map.fetch!(&1, key)) |> Enum.sum() end
    {claims, true_claims} = Runner.claims(runs)

    %{
      figures: %{
        runs: length(runs),
        simulated_s: sum.(:simulated_s),
        elections: sum.(:elections),
        partitions: sum.(:partitions),
        kills: sum.(:kills),
        formed: Enum.count(outcomes, & &1.formed?),
        ended_formed: Enum.count(outcomes, & &1.ended_formed?),
        claims: claims,
        true_claims: true_claims,
        rivals_s: outcomes |> Enum.map(& &1.rivals_s) |> Enum.max(fn -> 0.0 end)
      },
      violations:
        for name <- Invariants.names() do
          {name,
           for(run <- runs, Enum.any?(Runner.found(run), &(&1.invariant == name)), do: run.number)}
        end
    }
  end
end
