defmodule Bench.Recording.Main do
  @moduledoc "Runs the command `mix bench recording`: reads its options, measures, prints the table."
  alias Bench.{Command, Load, Recording, Table}
  alias Hal.Cli.Parse

  @doc "Runs the command; each error is one line."
  @spec run([String.t()]) :: :ok | {:error, [String.t()]}
  def run(arguments), do: Command.run(arguments, "recording", table(), &measure/1)

  defp measure(given), do: Command.in_folder("recording", &measure(given, &1))

  defp measure(given, folder) do
    rounds = Map.get(given, "rounds", 7)

    jobs =
      for robots <- given["robots"] || [6, 12], seed <- given["seeds"] || 1..5, do: {robots, seed}

    {results, about} =
      Command.loaded(fn output ->
        for {{robots, seed}, n} <- Enum.with_index(jobs) do
          Command.progress(output, n, length(jobs), "#{robots} robots, seed #{seed}")
          Recording.measure(robots, seed, rounds, folder)
        end
      end)

    measured = for {:ok, measured} <- results, do: measured
    IO.write(draw(measured))

    IO.puts(
      "#{rounds} runs of each seed, by turns without and with recording; medians; of what recording " <>
        "adds, the quartiles and the median of all pairs. Processor time is the VM's.\n#{Load.words(about)}."
    )

    Command.failed(for({:error, line} <- results, do: line))
  end

  @heads [
    "robots",
    "seeds",
    "processor time (s)",
    "recording adds (%)",
    "wall time (s)",
    "recording adds (%)",
    "MB a robot-minute: mean / most"
  ]

  defp draw(measured) do
    rows =
      for {robots, some} <- measured |> Enum.group_by(& &1.robots) |> Enum.sort() do
        figures = Recording.figures(some)

        [
          robots,
          length(some),
          figures.cpu_s,
          added(figures.cpu_percent),
          figures.wall_s,
          added(figures.wall_percent),
          "#{figures.mb} / #{figures.most_mb}"
        ]
      end

    Table.markdown(@heads, rows)
  end

  defp added({low, middle, high}), do: "#{low} / #{middle} / #{high}"

  defp table do
    [
      {"robots", "N,N", &Parse.wholes(&1, 1..100), "how many robots (6,12)"},
      {"seeds", "A-B", &Parse.span(&1, 0..100_000), "which seeds (1-5)"},
      {"rounds", "N", &Parse.whole(&1, 1..1_000), "how often each is measured (7)"}
    ]
  end
end
