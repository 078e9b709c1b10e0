defmodule Bench.Page.Main do
  @moduledoc "Runs the command `mix bench page`: reads its options, measures, prints the table."
  alias Bench.{Command, Load, Page}
  alias Hal.Cli.Parse

  @defaults %{robots: 30, clients: 20, slow: 100, seconds: 15, rounds: 5, service: :page}

  @doc "Runs the command; each error is one line."
  @spec run([String.t()]) :: :ok | {:error, [String.t()]}
  def run(arguments), do: Command.run(arguments, "page", table(), &measure/1)

  defp measure(given) do
    given = Map.new(@defaults, fn {key, most} -> {key, Map.get(given, "#{key}", most)} end)
    Logger.configure(level: :none)
    {measured, about} = Command.loaded(&Page.measure(given, Command.note(&1)))

    with {:ok, turns} <- measured do
      IO.puts(Page.draw(turns))

      IO.puts(
        "\n#{given.robots} robots; #{given.clients} readers, #{given.slow} deaf; #{given.rounds} turns of " <>
          "#{given.seconds} s each, medians. Processor time without the robots' own. " <>
          "#{Load.words(about)}; #{about.schedulers} processors."
      )
    else
      {:error, line} -> {:error, [line]}
    end
  end

  defp table do
    [
      {"robots", "N", &Parse.whole(&1, 1..100), "robots, all as processes (30)"},
      {"clients", "N", &Parse.whole(&1, 1..200), "browsers that read (20)"},
      {"slow", "N", &Parse.whole(&1, 1..200), "browsers that read nothing (100)"},
      {"seconds", "S", &Parse.whole(&1, 1..600), "of each turn (15)"},
      {"rounds", "N", &Parse.whole(&1, 1..100), "how often each is measured (5)"},
      {"service", "NAME",
       &Parse.choice(&1, page: :page, foxglove: :foxglove, rosbridge: :rosbridge),
       "what is served: page, foxglove, rosbridge, all of whose topics each\nclient asks for (page)"}
    ]
  end
end
