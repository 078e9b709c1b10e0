defmodule Soak.Report do
  @moduledoc "Writes what `bin/soak` prints of a run, as text. Pure."
  alias Soak.{Journal, Schedule, State}

  @doc "One line on how it stands."
  @spec line(State.t(), elapsed_ms :: non_neg_integer()) :: String.t()
  def line(s, elapsed_ms) do
    here = for({_name, _vm} <- s.vms, do: 1) |> length()

    "#{disturbed(s)} disturbances, #{here} of #{length(s.fleet.robots) + 1} nodes up, #{length(s.violations)} violations, " <>
      "#{decimals(cores(s, elapsed_ms), 2)} cores"
  end

  defp disturbed(s), do: Enum.sum(for kind <- Schedule.kinds(), do: Map.get(s.counts, kind, 0))

  # How many processors it has kept busy.
  defp cores(s, elapsed_ms), do: Enum.sum(Map.values(s.cpu)) * 1000 / max(elapsed_ms, 1)

  @doc "The table at the end."
  @spec table(State.t(), elapsed_ms :: non_neg_integer()) :: String.t()
  def table(s, elapsed_ms) do
    judge = s.judge
    counts = for kind <- Schedule.kinds(), do: "| #{kind} | #{Map.get(s.counts, kind, 0)} |"

    checks = [
      "| e-stops, worst time to all | #{judge.stops.count}, #{ms(judge.stops.worst_us)} |",
      "| two leaders that reach each other, longest | #{ms(judge.leaders.worst_us)} |",
      "| collisions | #{judge.collisions} |",
      "| a robot healed by itself after, at most | #{ms(judge.health.worst_us.self)} |",
      "| all one group again after, at most | #{ms(judge.health.worst_us.all)} |",
      "| robots past their restart budget, told and started again | #{s.gave_up} |",
      "| nodes started again | #{s.restarts} |",
      "| looks of the judge, all whole in one group | #{judge.checks}, #{round(100 * judge.health.whole / max(judge.health.looks, 1))} % |",
      "| processors, mean | #{decimals(cores(s, elapsed_ms), 2)} |"
    ]

    sizes =
      for {robot, %{first: first, last: last}} <- Enum.sort(judge.growth.told) do
        "| #{robot} | #{megabytes(first.bytes)} | #{megabytes(last.bytes)} | #{first.atoms} | #{last.atoms} |"
      end

    Enum.join(
      ["| disturbance | times |", "|---|---|"] ++
        counts ++
        ["", "| check | |", "|---|---|"] ++
        checks ++
        ["", "| robot | MB first | MB last | atoms first | atoms last |", "|---|---|---|---|---|"] ++
        sizes,
      "\n"
    ) <> "\n"
  end

  @doc "The first violation: when, what, and what was done just before."
  @spec first(State.t(), seed :: integer()) :: String.t() | nil
  def first(%{violations: []}, _seed), do: nil

  def first(%{violations: [{at_ms, line, before} | _]}, seed) do
    lines = for {ms, words} <- Enum.reverse(before), do: Journal.line(ms, words)

    Enum.join(
      ["The first violation, with seed #{seed}; before it:" | lines] ++
        [Journal.line(at_ms, line)],
      "\n"
    )
  end

  defp ms(us), do: "#{div(us, 1000)} ms"
  defp megabytes(bytes), do: decimals(bytes / 1.0e6, 1)
  defp decimals(number, count), do: :erlang.float_to_binary(number * 1.0, decimals: count)
end
