defmodule Bench.Marks.Main do
  @moduledoc "Runs the command `mix bench marks`: reads its options, measures, prints the tables."
  alias Bench.{Command, Load, Table}
  alias Bench.Marks.{Rooms, Runner}
  alias Hal.Cli.Parse
  alias Vision.Marks

  @maps ["hall", "hospital", "offices"]

  @doc "Runs the command; each error is one line."
  @spec run([String.t()]) :: :ok | {:error, [String.t()]}
  def run(arguments), do: Command.run(arguments, "marks", table(), &measure/1)

  defp measure(given) do
    case Marks.available() do
      :ok -> measured(given)
      {:error, line} -> {:error, [line]}
    end
  end

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
        for family <- Marks.families() do
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
      {"seed", "N", &Parse.whole(&1, 0..1_000_000_000), "the seed (1)"}
    ]
  end
end
