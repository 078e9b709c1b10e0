defmodule Bench.Goto.Main do
  @moduledoc "Runs the command `mix bench goto`: reads its options, measures, prints the table."
  alias Bench.{Command, Goto, Table}
  alias Bench.Goto.Place
  alias Console.Cli.Format
  alias Hal.Cli.Parse

  @maps ~w(offices hospital clinic lab cave ring doorway openplan)

  @heads [
    "map",
    "draws",
    "arrived",
    "time / time of the shortest way: median / 90 % / max",
    "way: median / max (m)",
    "truly off: median / 90 % / max (m)",
    "given up",
    "silent",
    "collisions"
  ]

  @place_heads [
    "map",
    "draws",
    "off while it is not lifted: median / 95 % / max (m)",
    "within what it tells",
    "lost: said / median / max (s)",
    "found again / within 60 s / median (s) / truly off, max (m)",
    "sure and wrong later than 5 s: longest (s) / draws"
  ]

  @doc "Runs the command; each error is one line."
  @spec run([String.t()]) :: :ok | {:error, [String.t()]}
  def run(arguments), do: Command.run(arguments, "goto", table(), &measure/1)

  defp measure(%{"place" => how} = given) do
    maps = given["maps"] || if(how == :way, do: ["hospital"], else: ~w(lab cave rooms:3))
    noise = given["noise"] || if(how == :way, do: :slip, else: :default)
    jobs = for map <- maps, seed <- given["seeds"] || 1..20, do: {map, seed}
    named = fn {map, seed} -> "#{map}, seed #{seed}" end
    results = Command.each(jobs, fn {map, seed} -> Place.run(map, seed, how, noise) end, named)
    measured = for {_job, {:ok, measured}} <- results, do: measured

    IO.write(
      table(maps, measured, @place_heads, &placed/2) <>
        Enum.map_join(measured, &wrong/1)
    )

    Command.failed(for {job, {:error, line}} <- results, do: "#{named.(job)}: #{line}")
  end

  defp measure(given) do
    maps = given["maps"] || @maps
    jobs = for map <- maps, seed <- given["seeds"] || 1..50, do: {map, seed}

    named = fn {map, seed} -> "#{map}, seed #{seed}" end
    results = Command.each(jobs, fn {map, seed} -> Goto.run(map, seed) end, named)
    measured = for {_job, {:ok, measured}} <- results, do: measured
    IO.write(table(maps, measured, @heads, &row/2) <> failures(measured))
    Command.failed(for {job, {:error, line}} <- results, do: "#{named.(job)}: #{line}")
  end

  defp table(maps, measured, heads, row) do
    rows =
      for map <- maps,
          some = Enum.filter(measured, &(&1.map == map)),
          some != [],
          do: row.(map, some)

    all = if length(rows) > 1, do: [row.("all", measured)], else: []
    Table.markdown(heads, rows ++ all)
  end

  defp row(map, some) do
    there = Enum.filter(some, &Goto.arrived?/1)

    [
      map,
      length(some),
      "#{length(there)} (#{Format.decimals(100 * length(there) / length(some), 1)} %)",
      figures(for(m <- there, do: m.took_s / m.way_s), [0.5, 0.9, 1.0]),
      figures(Enum.map(some, & &1.way_m), [0.5, 1.0]),
      figures(for(%{ended: :done} = m <- some, do: m.off_m), [0.5, 0.9, 1.0]),
      Enum.count(some, &match?({:given_up, _why}, &1.ended)),
      Enum.count(some, &(&1.ended == :silent)),
      some |> Enum.map(& &1.collisions) |> Enum.sum()
    ]
  end

  defp placed(map, some) do
    offs = Enum.flat_map(some, & &1.offs)
    inside = Enum.sum(Enum.map(some, & &1.inside)) / length(some)
    lost = for %{lost_s: s} when s != nil <- some, do: s
    found = for %{found_s: s} when s != nil <- some, do: s
    found_offs = for %{found_off: off} when off != nil <- some, do: off
    wrong = Enum.map(some, & &1.wrong_s)

    [
      map,
      length(some),
      figures(offs, [0.5, 0.95, 1.0]),
      "#{Format.decimals(100 * inside, 1)} %",
      "#{length(lost)} / #{figures(lost, [0.5, 1.0])}",
      "#{length(found)} / #{Enum.count(found, &(&1 <= 60.0))} / #{figures(found, [0.5])} / #{figures(found_offs, [1.0])}",
      "#{Format.decimals(Enum.max(wrong), 1)} / #{Enum.count(wrong, &(&1 > 0.0))}"
    ]
  end

  # What can be repeated.
  defp wrong(%{wrong_s: seconds} = measured) when seconds > 0.0,
    do:
      "#{measured.map}, seed #{measured.seed}: sure and wrong for #{Format.decimals(seconds, 1)} s\n"

  defp wrong(_right), do: ""

  defp figures([], _shares), do: "–"

  defp figures(values, shares),
    do: Enum.map_join(shares, " / ", &Format.decimals(Table.quantile(values, &1), 2))

  # Every draw that did not arrive, so that it can be repeated.
  defp failures(measured) do
    for m <- measured, not Goto.arrived?(m), into: "" do
      {x, y} = m.goal
      place = fn {x, y} -> "#{Format.decimals(x, 2)},#{Format.decimals(y, 2)}" end

      "#{m.map}, seed #{m.seed}: from #{place.({m.from.x, m.from.y})} to #{place.({x, y})}, #{Format.decimals(m.way_m, 1)} m: " <>
        "#{ended(m.ended)} after #{Format.decimals(m.took_s, 1)} s, truly #{Format.decimals(m.off_m, 2)} m off\n"
    end
  end

  defp ended(:done), do: "says that it is there,"
  defp ended(:silent), do: "says nothing"
  defp ended({:given_up, why}), do: "given up, blocked by #{why},"

  defp table do
    [
      {"seeds", "A-B", &Parse.span(&1, 0..100_000), "which seeds, one draw each (1-50)"},
      {"place", "HOW", &Parse.choice(&1, way: :way, near: :near, anywhere: :anywhere),
       "how well it knows where it is: way (over 50 m, hospital), near (lifted by\n1 to 3 m) or anywhere (lifted to anywhere); seeds 1-20"},
      {"noise", "HOW", &Parse.choice(&1, default: :default, slip: :slip, off: :off),
       "with place, the wheels: default, slip or off (slip over a way)"},
      Command.maps(@maps)
    ]
  end
end
