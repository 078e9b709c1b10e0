defmodule Bench.Mesh.Main do
  @moduledoc "Runs the command `mix bench swarm`: reads its options, measures, prints the table."
  alias Console.Cli.Output
  alias Hal.Cli.Parse
  alias Bench.{Command, Load, Mesh}

  @doc "Runs the command; each error is one line."
  @spec run([String.t()]) :: :ok | {:error, [String.t()]}
  def run(arguments),
    do: Command.run(arguments, "swarm", table(), &measure/1, Command.cases(Mesh.cases()))

  defp measure(given) do
    many = Map.get(given, "robots-in-one-node", 100)
    sizes = Map.get(given, "nodes", [3, 10, 30]) ++ if(many > 0, do: [:one], else: [])
    cases = Map.get(given, "only", Mesh.cases())
    share = Map.get(given, "share", 100) / 100

    {rows, about} =
      Command.loaded(fn output ->
        plan = %{cases: cases, share: share, note: Command.note(output)}
        Enum.flat_map(sizes, &Mesh.Runner.rows(&1, if(&1 == :one, do: many, else: &1), plan))
      end)

    IO.write(Mesh.Report.draw(rows))
    IO.puts("\n" <> words(about))
    Output.json(given["json"], Mesh.Report.term(rows, about))
  end

  defp words(about) do
    "Bare OTP: the same nodes with :pg and send alone, right before ours. Of fewer than 100 times the second " <>
      "figure is the largest.\n#{Load.words(about)}; #{about.schedulers} processors."
  end

  defp table do
    [
      {"nodes", "N,N", &Parse.wholes(&1, 2..100), "how many nodes (3,10,30)"},
      {"robots-in-one-node", "N", &Parse.whole(&1, 0..200),
       "and this many robots in one node; 0 for none (100)"},
      {"only", "NAME,NAME", &Mesh.choose/1, "which cases (all)"},
      {"share", "PERCENT", &Parse.whole(&1, 1..1_000), "how much of the usual repetitions (100)"},
      {"json", "FILE", &{:ok, &1}, "write the figures there too"}
    ]
  end
end
