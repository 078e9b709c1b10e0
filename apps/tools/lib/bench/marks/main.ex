defmodule Bench.Marks.Main do
  @moduledoc "Runs the command `mix bench marks`: reads its options, measures, prints the tables."
  alias Bench.{Command, Load, Table}
  alias Bench.Marks.{Plot, Rooms, Round, Runner}
  alias Hal.Cli.Parse
  alias Vision.Marks

  @maps ["hall", "hospital", "offices"]

  @doc "Runs the command; each error is one line."
  @spec run([String.t()]) :: :ok | {:error, [String.t()]}
  def run(arguments), do: Command.run(arguments, "marks", table(), &measure/1)

  defp measure(given) do
    case {Marks.available(), given} do
      {:ok, %{"round" => map}} -> round(map, given)
      {{:error, line}, %{"round" => _map}} -> {:error, [line]}
      {_available, _given} -> measured(given)
    end
  end

  # Each run with and without the marks.
  defp round(map, given) do
    {plan, svg} = {given["plan"] || :known, given["svg"]}

    jobs =
      for what <- [:patrol, :lifted],
          known <- [[], :all],
          seed <- given["seeds"] || 1..5,
          do: {what, known, seed}

    named = fn {what, known, seed} -> "#{what}, #{marks(known)}, seed #{seed}" end

    results =
      Command.each(
        jobs,
        fn {what, known, seed} -> apply(Round, what, [map, seed, plan, known]) end,
        named
      )

    of = fn what, known -> for {{^what, ^known, _seed}, {:ok, run}} <- results, do: run end

    kinds =
      for known <- [[], :all],
          of.(:patrol, known) != [],
          do: {marks(known), of.(:patrol, known), of.(:lifted, known)}

    heads = [
      "#{map}, slipping wheels",
      "runs",
      "off: mean / 95 % / max (m)",
      "within what they tell"
    ]

    heads = heads ++ ["lifted: right again, of", "median / max (s)"]
    IO.write(Table.markdown(heads, Enum.map(kinds, &row/1)))

    if svg && kinds != [],
      do: File.write!(svg, Plot.svg(for {words, runs, _} <- kinds, do: {words, runs}))

    Command.failed(for {job, {:error, line}} <- results, do: "#{named.(job)}: #{line}")
  end

  defp marks([]), do: "without marks"
  defp marks(:all), do: "with twelve marks"

  defp row({words, runs, lifted}) do
    all = for ticks <- runs, {_at_ms, robots} <- ticks, robot <- robots, do: robot
    offs = Enum.map(all, &elem(&1, 0))
    inside = Enum.count(all, &elem(&1, 1)) / length(all)
    right = Enum.reject(lifted, &(&1 == nil))

    off =
      Enum.map_join(
        [Enum.sum(offs) / length(offs), Plot.share(offs, 0.95), Enum.max(offs)],
        " / ",
        &decimals(&1, 3)
      )

    times =
      if right == [],
        do: "-",
        else: Enum.map_join([Plot.share(right, 0.5), Enum.max(right)], " / ", &decimals(&1, 1))

    [
      words,
      "#{length(runs)}",
      off,
      "#{decimals(100 * inside, 1)} %",
      "#{length(right)} of #{length(lifted)}",
      times
    ]
  end

  defp decimals(number, digits), do: :erlang.float_to_binary(number * 1.0, decimals: digits)

  defp measured(given) do
    [pictures, empty, tagged, seed] =
      for {name, default} <- [
            {"pictures", 100},
            {"empty", 10_000},
            {"tagged", 1_000},
            {"seed", 1}
          ],
          do: Map.get(given, name, default)

    {_none, about} =
      Command.loaded(fn output ->
        for family <- Marks.families(), there?(family) do
          note = &Command.note(output).("#{family}, #{&1}")
          IO.puts("\n#{family}\n")
          found = Runner.found(family, pictures, seed, note)
          heads = Enum.map(Bench.Marks.conditions(), &elem(&1, 1))
          IO.write(Table.markdown(["pixels wide" | heads], Enum.map(found, &shares/1)))
          note.("pictures without a mark")
          wrong = Runner.empty(family, empty, @maps, seed)
          IO.puts("\nMarks seen in #{empty} pictures without one: #{wrong}")
          note.("pictures with a mark")
          seen = Runner.tagged(family, tagged, @maps, seed)
          IO.puts("Ids in #{tagged} pictures with one: #{words(seen)}")
          IO.puts("A picture is searched in #{Runner.times(seen)} (median / 95 %)\n")
          IO.write(Table.markdown(errors(), Runner.errors(seen)))
        end
      end)

    IO.puts(
      "\n#{pictures} pictures a cell, of 160x120; the others of simulated rooms (#{Enum.join(@maps, ", ")}), 320x240, " <>
        "with marks of #{Rooms.size()} m; seed #{seed}. #{Load.words(about)}."
    )
  end

  defp there?(family) do
    with {:error, line} <- Marks.available(family) do
      IO.puts("\n#{family}: #{line}")
      false
    else
      :ok -> true
    end
  end

  defp shares({width, shares}), do: ["#{width}" | Enum.map(shares, &"#{round(100 * &1)}")]

  defp words(seen) do
    counts = Enum.frequencies_by(seen, & &1.what)
    "#{counts[:right] || 0} right, #{counts[:none] || 0} not seen, #{counts[:wrong] || 0} wrong"
  end

  defp errors do
    [
      "pixels wide",
      "pictures",
      "seen",
      "range: median / 95 % of its error",
      "bearing: the same (deg)",
      "with a yaw",
      "yaw: the same (deg)",
      "error within 2 deviations: range, bearing, yaw"
    ]
  end

  defp table do
    [
      {"pictures", "N", &Parse.whole(&1, 1..100_000),
       "pictures of each width and condition (100)"},
      {"empty", "N", &Parse.whole(&1, 1..1_000_000), "pictures without a mark (10000)"},
      {"tagged", "N", &Parse.whole(&1, 1..1_000_000), "pictures with one (1000)"},
      {"round", "MAP", &Parse.text/1,
       "instead: how far off robots are that patrol it, with marks and without"},
      {"plan", "HOW", &Parse.choice(&1, known: :known, none: :none),
       "with --round: whether they have its floor plan (known)"},
      {"seeds", "A-B", &Parse.span(&1, 0..100_000), "with --round: which seeds (1-5)"},
      {"svg", "FILE", &Parse.text/1, "with --round: a drawing of that over time"},
      {"seed", "N", &Parse.whole(&1, 0..1_000_000_000), "the seed (1)"}
    ]
  end
end
