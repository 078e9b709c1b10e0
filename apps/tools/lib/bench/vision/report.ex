defmodule Bench.Vision.Report do
  @moduledoc false
  # Shows what `mix bench vision` measured, as a table in Markdown and as a term for JSON. Pure. Ratios are
  # to the kernel; each is the median of the rounds' ratios.
  alias Bench.{Table, Vision}
  alias Console.Cli.Format

  @type measured :: [
          {kind :: atom(), %{atom() => Vision.Runner.result()} | {:absent, String.t()}}
        ]

  @doc "The table: a line for each way, for each kind of frame its time, ratio and page faults."
  @spec draw([Vision.way()], measured()) :: String.t()
  def draw(ways, measured) do
    heads = ["us a frame (times the kernel; page faults)" | Enum.map(measured, &head/1)]
    rows = for way <- ways, do: [way.says | Enum.map(measured, &cell(way.name, &1))]
    table = String.trim_trailing(Table.markdown(heads, rows))
    Enum.join([table | Enum.flat_map(measured, &notes(&1, ways))], "\n\n") <> "\n"
  end

  @doc "The figures as a term for `Hal.Json.encode!/1`; microseconds."
  @spec term([Vision.way()], measured(), map()) :: {:object, list()}
  def term(ways, measured, about) do
    rows =
      for {kind, results} <- measured, is_map(results), way <- ways do
        {:object, [frame: kind, way: way.name] ++ figures(results, way.name)}
      end

    {:object, [about: about, rows: rows]}
  end

  @doc """
  The median over the rounds that both took part in of a function of their times.

      iex> results = %{kernel: {:ok, %{1 => %{us: 10.0}, 2 => %{us: 20.0}}}, call: {:ok, %{2 => %{us: 21.0}}}}
      iex> Bench.Vision.Report.compare(results, :call, fn call, kernel -> call - kernel end)
      1.0
      iex> Bench.Vision.Report.compare(%{results | kernel: {:absent, "not built"}}, :call, fn _, _ -> 0 end)
      nil
  """
  @spec compare(%{atom() => Vision.Runner.result()}, atom(), (float(), float() -> float())) ::
          float() | nil
  def compare(results, name, function) do
    with {:ok, kernel} <- results[:kernel], {:ok, rounds} <- results[name] do
      Table.quantile(
        for(
          {round, %{us: us}} <- rounds,
          %{us: base} <- [kernel[round]],
          do: function.(us, base)
        ),
        0.5
      )
    else
      _absent -> nil
    end
  end

  defp head({kind, _results}), do: Vision.kinds()[kind]

  defp cell(_name, {_kind, {:absent, _why}}), do: "–"

  defp cell(name, {_kind, results}) do
    case results[name] do
      {:absent, why} -> if(String.length(why) < 12, do: why, else: "failed")
      {:ok, rounds} -> time(median(rounds, :us)) <> besides(results, name, rounds)
    end
  end

  defp besides(results, name, rounds) do
    ratio = compare(results, name, &Kernel.//2)
    faults = median(rounds, :faults)
    ratio = if ratio, do: ["#{Format.decimals(ratio, 2)}"], else: []
    faults = if faults, do: ["#{Format.decimals(faults, 0)}"], else: []
    if ratio ++ faults == [], do: "", else: " (" <> Enum.join(ratio ++ faults, "; ") <> ")"
  end

  defp notes({kind, {:absent, why}}, _ways),
    do: ["No figures of the #{Vision.kinds()[kind]}: #{why}."]

  defp notes({kind, results}, ways) do
    over =
      for name <- [:call, :blobs],
          us = compare(results, name, &Kernel.-/2),
          do: "#{name} #{Format.decimals(us, 1)} us"

    failed =
      for %{name: name, says: says} <- ways,
          {:absent, why} <- [results[name]],
          String.length(why) >= 12,
          do: "#{says} on #{Vision.kinds()[kind]}: #{why}"

    over = if over == [], do: [], else: ["Over the kernel, #{kind}: #{Enum.join(over, ", ")}."]
    over ++ failed
  end

  defp figures(results, name) do
    case results[name] do
      {:absent, why} ->
        [absent: why]

      {:ok, rounds} ->
        [
          us: median(rounds, :us),
          ratio: compare(results, name, &Kernel.//2),
          faults: median(rounds, :faults),
          rounds: map_size(rounds)
        ]
    end
  end

  defp median(rounds, key) do
    Table.quantile(for({_round, %{^key => value}} when value != nil <- rounds, do: value), 0.5)
  end

  defp time(us) when us < 1_000, do: "#{Format.decimals(us, 0)}"
  defp time(us), do: us |> round() |> Integer.to_string() |> thousands()

  defp thousands(digits), do: Regex.replace(~r/(?<=\d)(?=(\d{3})+$)/, digits, ",")
end
