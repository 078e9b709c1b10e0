defmodule Bench.Explore.Main do
  @moduledoc "Runs the command `mix bench explore`: reads its options, measures, prints the table."
  alias Bench.{Command, Explore, Table}
  alias Console.Cli.Format
  alias Hal.Cli.Parse

  @maps ~w(hall openplan offices)
  @fleets [1, 4]
  @limit_s 1_800

  @doc "Runs the command; each error is one line."
  @spec run([String.t()]) :: :ok | {:error, [String.t()]}
  def run(arguments), do: Command.run(arguments, "explore", table(), &measure/1)

  defp measure(given) do
    maps = given["maps"] || @maps
    limit_s = given["duration"] || @limit_s

    jobs =
      for map <- maps, robots <- @fleets, seed <- given["seeds"] || 1..5, do: {map, robots, seed}

    run = fn {map, robots, seed} -> Explore.run(map, robots, seed, limit_s) end

    named = fn {map, robots, seed} ->
      "#{Format.count(robots, "robot")} in #{map}, seed #{seed}"
    end

    results = Command.each(jobs, run, named)
    measured = for {_job, {:ok, measured}} <- results, do: measured
    IO.write(draw(maps, measured))
    Command.failed(for {job, {:error, line}} <- results, do: "#{named.(job)}: #{line}")
  end

  @heads [
    "map",
    "area (m²)",
    "robots",
    "95 % seen (s), each run",
    "median (s)",
    "of one robot's",
    "all say that they are ready: median (s)",
    "seen in the end: least",
    "walls that are there: median",
    "walls farther than 0.2 m from true ones: median",
    "off its place at the end: worst (m)",
    "collisions"
  ]

  defp draw(maps, measured) do
    rows =
      for map <- maps,
          robots <- @fleets,
          some = Enum.filter(measured, &(&1.map == map and &1.robots == robots)),
          some != [],
          do: row(map, robots, some, Enum.filter(measured, &(&1.map == map and &1.robots == 1)))

    Table.markdown(@heads, rows)
  end

  defp row(map, robots, some, alone) do
    seen = some |> Enum.map(& &1.seen_s) |> Enum.sort()

    [
      map,
      some |> Enum.map(& &1.area_m2) |> median() |> Format.decimals(0),
      robots,
      Enum.map_join(seen, ", ", &seconds/1),
      seconds(median(seen)),
      share(median(seen), median(for one <- alone, do: one.seen_s)),
      some |> Enum.map(& &1.ready_s) |> median() |> seconds(),
      percent(some |> Enum.map(& &1.share) |> Enum.min()),
      percent(median(for %{walls: walls} when walls != nil <- some, do: walls)),
      percent(median(for %{wrong: wrong} when wrong != nil <- some, do: wrong)),
      Format.decimals(some |> Enum.map(& &1.off_m) |> Enum.max(), 2),
      some |> Enum.map(& &1.collisions) |> Enum.sum()
    ]
  end

  # `nil`, never, is after all numbers.
  defp median(values), do: values |> Enum.sort() |> Enum.at(div(length(values), 2))

  defp seconds(nil), do: "never"
  defp seconds(s), do: Format.decimals(s, 0)

  defp share(some, alone) when is_number(some) and is_number(alone) and alone > 0,
    do: Format.decimals(some / alone, 2)

  defp share(_some, _alone), do: "–"

  defp percent(nil), do: "–"
  defp percent(share), do: "#{Format.decimals(100 * share, 1)} %"

  defp table do
    [
      {"seeds", "A-B", &Parse.span(&1, 0..100_000), "which seeds, one run each (1-5)"},
      Command.maps(@maps),
      {"duration", "S", &Parse.whole(&1, 1..100_000), "simulated seconds at most (#{@limit_s})"}
    ]
  end
end
