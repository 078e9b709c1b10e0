defmodule Soak.Main do
  @moduledoc "Runs the command `bin/soak`: reads its arguments, runs, prints the table."
  alias Soak.{Report, Runner, State}
  alias Console.Cli.{Output, Progress}

  @minute_ms 60_000
  @robots ~w(mag1 mag2 mag3 min1 min2 min3)a

  @doc """
  Runs the command; returns the status to exit with. Arguments were checked by `arguments/1`; `where` is the
  folder of the journal.
  """
  @spec run({minutes :: number(), seed :: integer()}, Path.t()) :: non_neg_integer()
  def run({minutes, seed}, where) do
    # Robots are killed here on purpose.
    Logger.configure(level: :none)
    main = self()

    for {signal, status} <- [sigterm: 143, sighup: 129],
        do:
          {:ok, _id} = System.trap_signal(signal, fn -> send(main, {:signal, status}) && :ok end)

    output = Output.to(:stdio)
    why_not = Vm.Net.why_not()
    path = Path.join(where, "soak-#{seed}-#{System.pid()}.log")

    Output.line(
      output,
      "soak: #{minutes} min with seed #{seed}; what is done is written to #{path}"
    )

    if why_not, do: Output.line(output, "soak: on loopback, without cut links: #{why_not}")
    duration_ms = round(minutes * @minute_ms)

    s =
      Runner.run(%{
        seed: seed,
        duration_ms: duration_ms,
        robots: @robots,
        namespaces?: why_not == nil,
        journal: path,
        progress: &progress(output, &1, duration_ms)
      })

    Output.finish(output)
    IO.write("\n" <> Report.table(s, State.elapsed_ms(s)))
    tell(s, seed)
  end

  defp tell(%{violations: [], signal: nil}, _seed) do
    IO.puts("\nAll that was checked held.")
    0
  end

  defp tell(%{violations: [], signal: signal}, _seed) do
    IO.puts("\nEnded before its time; all that was checked till then held.")
    signal
  end

  defp tell(s, seed) do
    IO.puts("\n#{length(s.violations)} violations. " <> Report.first(s, seed))
    IO.puts("\nWhat the nodes wrote is in #{s.kept}.")
    1
  end

  defp progress(output, s, duration_ms) do
    ms = State.elapsed_ms(s)
    line = Report.line(s, ms)

    cond do
      output.columns ->
        if rem(s.ticks, 5) == 0,
          do:
            Output.progress(
              output,
              Progress.line(ms / 1000, duration_ms / 1000, line, output.columns - 1)
            )

      # A tick is 200 ms: once in each minute.
      rem(s.ticks, 300) == 0 and ms > 0 ->
        Output.line(output, "soak: #{div(ms, 1000)} of #{div(duration_ms, 1000)} s: #{line}")

      true ->
        :ok
    end
  end

  @doc """
  The arguments, `[MINUTES] [SEED]`.

      iex> Soak.Main.arguments([])
      {:ok, {10, 1}}
      iex> Soak.Main.arguments(["0.5", "7"])
      {:ok, {0.5, 7}}
      iex> Soak.Main.arguments(["long"])
      {:error, "MINUTES: expected a number from 0.1 to 10000, got \\"long\\""}
  """
  @spec arguments([String.t()]) :: {:ok, {number(), integer()}} | {:error, String.t()}
  def arguments([]), do: {:ok, {10, 1}}
  def arguments([minutes]), do: arguments([minutes, "1"])

  def arguments([minutes, seed]) do
    with {:ok, minutes} <- minutes(minutes), {:ok, seed} <- seed(seed), do: {:ok, {minutes, seed}}
  end

  def arguments([_minutes, _seed | rest]),
    do: {:error, "expected MINUTES and SEED, got also #{Enum.join(rest, " ")}"}

  defp minutes(text) do
    case Float.parse(text) do
      {minutes, ""} when minutes >= 0.1 and minutes <= 10_000 ->
        {:ok, if(minutes == trunc(minutes), do: trunc(minutes), else: minutes)}

      _other ->
        {:error, "MINUTES: expected a number from 0.1 to 10000, got #{inspect(text)}"}
    end
  end

  defp seed(text) do
    case Integer.parse(text) do
      {seed, ""} when seed in 0..1_000_000_000 ->
        {:ok, seed}

      _other ->
        {:error, "SEED: expected a whole number from 0 to 1000000000, got #{inspect(text)}"}
    end
  end
end
