defmodule Bench.Mesh.Report do
  @moduledoc "Formats measurements as a table in Markdown, and as a term for JSON. Pure."
  alias Bench.Mesh
  alias Bench.Mesh.Figures
  alias Console.Cli.Format

  @typedoc "One line: our figures, and those of bare OTP in the same run."
  @type row :: %{
          case: Mesh.case(),
          size: Mesh.size(),
          robots: pos_integer(),
          ours: Figures.t() | nil,
          bare: Figures.t() | nil
        }

  @heads [
    "case",
    "nodes",
    "ours: p50 / p99",
    "bare OTP, same run",
    "ratio",
    "goal",
    "reached",
    "times",
    "JADE 4.3 (another day)"
  ]

  @doc "The table."
  @spec draw([row()]) :: String.t()
  def draw(rows), do: Bench.Table.markdown(@heads, Enum.map(rows, &line/1))

  @doc "The rows as a term for `Hal.Json.encode!/1`; microseconds, bytes, ticks a second, percent."
  @spec term([row()], map()) :: {:object, list()}
  def term(rows, about), do: {:object, [about: about, rows: Enum.map(rows, &object/1)]}

  @doc """
  A figure for people.

      iex> for us <- [85.4, 3_271.0, 1_100_000], do: Bench.Mesh.Report.figure(us, :time)
      ["85 us", "3.3 ms", "1.10 s"]
      iex> {Bench.Mesh.Report.figure(52_428_800, :memory), Bench.Mesh.Report.figure(nil, :time)}
      {"50.0 MB", "–"}
  """
  @spec figure(number() | nil, :time | :memory | :rate | :share) :: String.t()
  def figure(nil, _unit), do: "–"
  def figure(bytes, :memory), do: "#{Format.decimals(bytes / 1_048_576, 1)} MB"
  def figure(percent, :share), do: "#{Format.decimals(percent, 2)} %"
  def figure(hz, :rate), do: "#{Format.decimals(hz, 1)}/s"
  def figure(us, :time) when us < 1_000, do: "#{Format.decimals(us, 0)} us"
  def figure(us, :time) when us < 1_000_000, do: "#{Format.decimals(us / 1_000, 1)} ms"
  def figure(us, :time), do: "#{Format.decimals(us / 1_000_000, 2)} s"

  defp line(%{case: case, ours: ours, bare: bare} = row) do
    goal = Mesh.goal(case.name, row.size)

    [
      case.says,
      size(row),
      both(ours, case.unit),
      both(bare, case.unit),
      ratio(Figures.ratio(ours && ours.p50, bare && bare.p50)),
      goal(goal, case.unit),
      reached(ours, goal, case.unit),
      if(ours, do: "#{ours.count}", else: "–"),
      Mesh.jade(case.name, row.size) || "–"
    ]
  end

  defp size(%{size: :one, robots: robots}), do: "1 (#{robots} robots)"
  defp size(%{size: nodes}), do: "#{nodes}"

  defp both(nil, _unit), do: "–"
  defp both(figures, unit), do: "#{figure(figures.p50, unit)} / #{figure(figures.p99, unit)}"

  defp ratio(nil), do: "–"
  defp ratio(ratio), do: "#{Format.decimals(ratio, 2)}"

  defp goal({nil, nil}, _unit), do: "–"
  defp goal({hz, nil}, :rate), do: ">= #{figure(hz, :rate)}"
  defp goal({p50, nil}, unit), do: "<= #{figure(p50, unit)}"
  defp goal({p50, p99}, unit), do: "<= #{figure(p50, unit)} / #{figure(p99, unit)}"

  defp reached(nil, _goal, _unit), do: "–"
  defp reached(_ours, {nil, nil}, _unit), do: "–"
  # Allow for a tick more or less at the ends of the measured time.
  defp reached(ours, {hz, nil}, :rate), do: yes(ours.p50 >= hz - 0.2)
  defp reached(ours, {p50, nil}, _unit), do: yes(ours.p50 <= p50)
  defp reached(ours, {p50, p99}, _unit), do: yes(ours.p50 <= p50 and ours.p99 <= p99)

  defp yes(true), do: "yes"
  defp yes(false), do: "**no**"

  defp object(row) do
    {p50, p99} = Mesh.goal(row.case.name, row.size)

    {:object,
     [
       case: row.case.name,
       nodes: if(row.size == :one, do: 1, else: row.size),
       robots: row.robots,
       unit: %{time: "us", memory: "bytes", rate: "1/s", share: "%"}[row.case.unit],
       ours: row.ours,
       bare: row.bare,
       goal: %{p50: p50, p99: p99}
     ]}
  end
end
