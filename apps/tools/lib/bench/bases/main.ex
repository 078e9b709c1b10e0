defmodule Bench.Bases.Main do
  @moduledoc "Runs the command `mix bench bases`: reads its options, measures, prints the table."
  alias Bench.{Bases, Command, Load, Table}
  alias Hal.Cli.Parse

  @doc "Runs the command; each error is one line."
  @spec run([String.t()]) :: :ok | {:error, [String.t()]}
  def run(arguments),
    do: Command.run(arguments, "bases", table(), &measure/1, Command.cases(Bases.bases()))

  defp measure(given), do: Command.in_folder("bases", &measure(given, &1))

  defp measure(given, folder) do
    bases = Map.get(given, "only", Bases.bases())
    times = Map.get(given, "times", 10)

    {rows, about} =
      Command.loaded(fn output ->
        for case <- Bases.cases() do
          figures =
            for base <- bases do
              Command.note(output).("#{base.name}, #{case.says}")
              base |> Bases.Runner.run(case.name, times, folder) |> words()
            end

          [case.says | figures]
        end
      end)

    IO.write(Table.markdown(["cause" | Enum.map(bases, & &1.says)], rows))

    IO.puts(
      "\nMilliseconds from before the cause until the wheels of the emulated base stand, from 0.2 m/s: median / longest of #{times}. " <>
        "#{Load.words(about)}; #{about.schedulers} processors."
    )
  end

  @doc """
  Times in words.

      iex> {Bench.Bases.Main.words([120, 100, 110]), Bench.Bases.Main.words([120, nil])}
      {"110 / 120", "1 of 2 drove on after 5 s"}
      iex> Bench.Bases.Main.words([nil, nil])
      "drives on"
  """
  @spec words([non_neg_integer() | nil]) :: String.t()
  def words(times) do
    case Enum.count(times, &is_nil/1) do
      0 -> "#{Table.quantile(times, 0.5)} / #{Enum.max(times)}"
      n when n == length(times) -> "drives on"
      n -> "#{n} of #{length(times)} drove on after 5 s"
    end
  end

  defp table do
    [
      {"times", "N", &Parse.whole(&1, 1..1_000), "how often each is measured (10)"},
      {"only", "NAME,NAME", &Bases.choose/1, "which bases (all)"}
    ]
  end
end
