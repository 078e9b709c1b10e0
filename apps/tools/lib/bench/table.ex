defmodule Bench.Table do
  @moduledoc "Formats measured runs as a table in Markdown. Pure."
  alias Console.Cli.Format
  alias Lab.Trial.Claims

  @heads [
    "case",
    "map",
    "runs",
    "formed in time",
    "time to formed: median / 95 % / max (s)",
    "error mean: median / 90 % / max (m)",
    "error max: median / 90 % / max (m)",
    "true claims of formed",
    "collisions",
    "leaders at once",
    "leader changes: mean / max",
    "x real time"
  ]

  @doc "The table of rows `{says, map, limit_s, measured}`."
  @spec draw([{String.t(), String.t(), number(), [Bench.Run.measured()]}]) :: String.t()
  def draw(rows), do: markdown(@heads, Enum.map(rows, &row/1))

  @doc "Rows of texts under their heads, in Markdown."
  @spec markdown([String.t()], [[String.t()]]) :: String.t()
  def markdown(heads, rows) do
    lines = [heads, Enum.map(heads, fn _ -> "---" end)] ++ rows
    Enum.map_join(lines, "\n", &("| " <> Enum.join(&1, " | ") <> " |")) <> "\n"
  end

  @doc """
  The value below which this share of the values lies (nearest rank); `nil` of none.

      iex> Bench.Table.quantile([4, 1, 3, 2], 0.5)
      2
      iex> Bench.Table.quantile([], 0.5)
      nil
  """
  @spec quantile([number()], float()) :: number() | nil
  def quantile([], _share), do: nil

  def quantile(values, share) do
    rank = max(ceil(share * length(values)), 1)
    values |> Enum.sort() |> Enum.at(rank - 1)
  end

  defp row({says, map, limit_s, runs}) do
    times = for %{formed_s: s} when s != nil <- runs, do: s
    means = for %{error: {mean, _max}} <- runs, do: mean
    maxima = for %{error: {_mean, max}} <- runs, do: max
    changes = Enum.map(runs, & &1.changes)
    within = Enum.count(runs, & &1.within?)

    [
      says,
      map,
      "#{length(runs)}",
      "#{within} of #{length(runs)} (#{limit_s} s)",
      figures(times, [0.5, 0.95, 1.0], 1),
      figures(means, [0.5, 0.9, 1.0], 3),
      figures(maxima, [0.5, 0.9, 1.0], 3),
      runs |> true_claims() |> share(),
      "#{runs |> Enum.map(& &1.collisions) |> Enum.sum()}",
      "#{runs |> Enum.map(& &1.leaders) |> Enum.max(fn -> 0 end)}",
      "#{Format.decimals(Enum.sum(changes) / max(length(runs), 1), 1)} / #{Enum.max(changes, fn -> 0 end)}",
      figures(Enum.map(runs, & &1.speed), [0.5], 0)
    ]
  end

  @doc """
  How reliable the reports of the fleets were, as lines of text: how many claims of `formed` were
  true, all cases and maps pooled, and the worst case; how many robots were stuck and did not
  report it (`Lab.Trial.Progress`). A claim is true when the worst robot was at most half a metre off
  at the claim and 5 s later (`Lab.Trial.Claims`).
  """
  @spec pooled([{String.t(), String.t(), number(), [Bench.Run.measured()]}]) :: String.t()
  def pooled(rows) do
    led? = Enum.any?(rows, fn {_, _, _, runs} -> Enum.any?(runs, &(&1.leaders > 0)) end)

    if led?,
      do: reliable(rows),
      else:
        "Nobody led, so nobody had a place in a shape: there is none to claim, or to be short of.\n"
  end

  defp reliable(rows) do
    judged =
      for {says, map, _limit_s, runs} <- rows,
          {_right, all} = counts = true_claims(runs),
          all > 0,
          do: {"#{says}, in #{map}", counts}

    right = judged |> Enum.map(fn {_says, {right, _all}} -> right end) |> Enum.sum()
    all = judged |> Enum.map(fn {_says, {_right, all}} -> all end) |> Enum.sum()
    metres = Format.decimals(Claims.right_m(), 1)

    "Claims of formed with the worst robot at most #{metres} m off, at the claim and 5 s later: " <>
      "#{share({right, all})} (goal 99 %).\n" <> least(judged) <> stuck(rows)
  end

  defp least([]), do: ""

  defp least(judged) do
    {says, counts} = Enum.min_by(judged, fn {_says, {right, all}} -> right / all end)
    "Least in one case: #{says}, #{share(counts)} (goal 95 %).\n"
  end

  defp stuck(rows) do
    count = for({_, _, _, runs} <- rows, run <- runs, do: run.stuck) |> Enum.sum()
    "Robots short of their places for 20 s without a word: #{count} (goal 0).\n"
  end

  defp true_claims(runs) do
    verdicts = for run <- runs, claim <- run.claims, do: Claims.right?(claim)
    {Enum.count(verdicts, &(&1 == true)), Enum.count(verdicts, &(&1 != nil))}
  end

  defp share({_right, 0}), do: "–"

  defp share({right, all}),
    do: "#{right} of #{all} (#{Format.decimals(100 * right / all, 1)} %)"

  defp figures([], _shares, _decimals), do: "–"

  defp figures(values, shares, decimals),
    do: Enum.map_join(shares, " / ", &Format.decimals(quantile(values, &1), decimals))
end
