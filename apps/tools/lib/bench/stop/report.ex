defmodule Bench.Stop.Report do
  @moduledoc "Shows what `mix bench stop` measured, as a table in Markdown and as a term for JSON. Pure."
  alias Bench.Stop
  alias Bench.Table
  alias Console.Cli.Format

  @heads ["cause", "median", "longest", "goal", "reached", "times", "rolled again by itself"]

  @doc "The table, and a line about what cannot be measured."
  @spec draw([Stop.Runner.result()]) :: String.t()
  def draw(results) do
    table = Table.markdown(@heads, Enum.map(results, &line/1))

    Enum.map_join(
      [table | Enum.flat_map(results, &pulled/1)],
      "\n",
      &(String.trim_trailing(&1) <> "\n")
    )
  end

  @doc "The figures as a term for `Hal.Json.encode!/1`; milliseconds."
  @spec term([Stop.Runner.result()], map()) :: {:object, list()}
  def term(results, about) do
    rows =
      for %{case: case} = result <- results do
        {:object,
         [
           case: case.name,
           goal_ms: case.goal_ms,
           times_ms: Enum.map(result.times, &(&1 && &1 / 1000)),
           rolled: result.rolled,
           known_ms: Enum.map(result.known, &(&1 / 1000))
         ]}
      end

    {:object, [about: about, rows: rows]}
  end

  @doc """
  Whether all stops came, and within the goal.

      iex> Bench.Stop.Report.reached?([200_000, 299_000], 300)
      true
      iex> Bench.Stop.Report.reached?([200_000, nil], 300)
      false
  """
  @spec reached?([number() | nil], pos_integer()) :: boolean()
  def reached?(times, goal_ms), do: Enum.all?(times, &(&1 != nil and &1 <= goal_ms * 1000))

  defp line(%{case: case, times: times, rolled: rolled}) do
    came = Enum.reject(times, &is_nil/1)

    [
      case.says,
      ms(Table.quantile(came, 0.5)),
      if(length(came) < length(times), do: "**none came**", else: ms(Enum.max(came))),
      if(case.goal_ms, do: "#{case.goal_ms} ms", else: "–"),
      reached(times, case.goal_ms),
      "#{length(times)}",
      if(rolled == 0, do: "never", else: "**#{rolled} times**")
    ]
  end

  defp reached(_times, nil), do: "–"
  defp reached(times, goal_ms), do: if(reached?(times, goal_ms), do: "yes", else: "**no**")

  defp pulled(%{case: %{name: :pull}, known: [_ | _] = known}) do
    [
      "On a line that is pulled nothing can be said: there the base's own time-out stops it, which is not ours. " <>
        "The driver knew of it after #{ms(Table.quantile(known, 0.5))} (longest #{ms(Enum.max(known))}); the " <>
        "first speed on the line that is plugged in again is the stop, and nothing else until a person acknowledges."
    ]
  end

  defp pulled(_other), do: []

  defp ms(nil), do: "–"
  defp ms(us), do: "#{Format.decimals(us / 1000, 1)} ms"
end
