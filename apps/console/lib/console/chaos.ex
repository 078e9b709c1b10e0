defmodule Console.Chaos do
  @moduledoc "Runs the command `mix chaos`: plays the runs, and prints and writes what comes of them."
  alias Console.Chaos.{Options, Report}
  alias Console.Cli.{OutFile, Output, Progress}
  alias Console.Scenario.Recording
  alias Lab.Chaos.{Draw, Runner, ScenarioFile}
  alias Lab.Scenario

  @doc """
  Plays the runs and returns the exit status: 0 if nothing was wrong, 2 if something was, 1 if a file
  cannot be written. `draw` replaces what is drawn, for tests.
  """
  @spec run(Options.t(), keyword()) :: 0 | 1 | 2
  def run(%Options{} = options, draw \\ []) do
    with :ok <- OutFile.check("--json", options.json), :ok <- folder(options.keep) do
      # With `--json -` only the report is written to standard output.
      output = Output.to(if(options.json == "-", do: :stderr, else: :stdio))
      report = play(options, draw, output)
      Output.finish(output)
      Output.line(output, Report.table(report))
      finish(report, options)
    else
      {:error, line} -> refuse(line)
    end
  end

  defp folder(nil), do: :ok

  defp folder(path) do
    with {:error, reason} <- File.mkdir_p(path),
         do: {:error, "--keep #{path} cannot be made: #{:file.format_error(reason)}"}
  end

  defp play(options, draw, output) do
    numbers = Options.numbers(options)
    all = Enum.count(numbers)
    counts = :counters.new(2, [])

    done = fn played ->
      :counters.add(counts, 1, 1)
      :counters.add(counts, 2, length(played.failures))
      Enum.each(played.failures, &Output.line(output, Report.failure(Options.words(options), &1)))
      note = Report.note(:counters.get(counts, 2))
      columns = (output.columns || 80) - 1
      Output.progress(output, Progress.line(:counters.get(counts, 1), all, note, columns, "runs"))
    end

    draw = if options.mission && draw == [], do: [draw: drawn(options.mission)], else: draw
    jobs = if options.jobs, do: [jobs: options.jobs], else: []
    Output.progress(output, Progress.line(0, all, "", (output.columns || 80) - 1, "runs"))
    Runner.run(options.seed, numbers, jobs ++ draw ++ [attempts: options.attempts, done: done])
  end

  defp drawn({_text, mission}), do: &Draw.instead(Draw.options(&1, &2), mission)

  defp finish(report, options) do
    with :ok <- keep(report, options.keep), :ok <- write(options.json, report) do
      if report.clean?, do: 0, else: 2
    else
      {:error, line} -> refuse(line)
    end
  end

  defp write(nil, _report), do: :ok

  defp write(path, report) do
    text = [Hal.Json.encode!(Report.json(report)), "\n"]
    if path == "-", do: IO.write(text), else: OutFile.write("--json", path, text)
  end

  defp keep(_report, nil), do: :ok

  defp keep(report, folder) do
    for run <- report.runs, failure <- run.failures, reduce: :ok do
      :ok ->
        with {:ok, name, text} <- ScenarioFile.text(report.seed, failure),
             path = Path.join(folder, name),
             :ok <- OutFile.write("--keep", path, text),
             do: record(path)

      error ->
        error
    end
  end

  # Reads the file back, as `mix scenario` does.
  defp record(path) do
    recorded =
      with {:ok, scenario} <- Scenario.File.load(path),
           do: Recording.record(scenario, Path.rootname(path) <> ".mcap")

    with {:error, lines} <- recorded, do: {:error, "--keep #{lines |> List.wrap() |> hd()}"}
  end

  defp refuse(line) do
    IO.puts(:stderr, "chaos: #{line}")
    1
  end
end
