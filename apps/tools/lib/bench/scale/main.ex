defmodule Bench.Scale.Main do
  @moduledoc "Runs the command `mix bench scale`: reads its options, measures, prints table and bars."
  alias Bench.{Command, Load, Scale}
  alias Hal.Cli.Parse

  @doc "Runs the command; each error is one line."
  @spec run([String.t()]) :: :ok | {:error, [String.t()]}
  def run(arguments), do: Command.run(arguments, "scale", table(), &measure/1)

  defp measure(given) do
    fleets = given |> Map.get("robots", [6, 20, 50]) |> Enum.sort()
    blobs = Map.get(given, "blobs", :painted)
    seconds = Map.get(given, "seconds", 180)

    {results, about} =
      Command.loaded(fn output ->
        for {robots, n} <- Enum.with_index(fleets) do
          Command.progress(output, n, length(fleets), "#{robots} robots")
          Scale.measure(robots, blobs, seconds)
        end
      end)

    with [] <- for({:error, line} <- results, do: line) do
      measured = for {:ok, measured} <- results, do: measured
      IO.puts(Scale.verdict(measured) <> "\n")
      IO.write(Scale.draw(measured))

      IO.puts(
        "\nSeed 1 in the hall, blobs #{blobs}, in one process, from the search to ten seconds after the fleet is formed, #{seconds} s at most; times real time by processor time. #{Load.words(about)}."
      )
    else
      lines -> {:error, lines}
    end
  end

  defp table do
    [
      {"robots", "N,N", &Parse.wholes(&1, 1..1_000), "how many robots, up to 1000 (6,20,50)"},
      {"blobs", "HOW", &Parse.choice(&1, painted: :painted, direct: :direct),
       "pictures that are painted, or blobs by geometry: painted, direct (painted)"},
      {"seconds", "S", &Parse.whole(&1, 1..10_000),
       "how long at most, in simulated seconds (180)"}
    ]
  end
end
