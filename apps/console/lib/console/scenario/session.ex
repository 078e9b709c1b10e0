defmodule Console.Scenario.Session do
  @moduledoc false
  # Runs the files of `mix scenario`: one with its stages as they happen, several side by side, each
  # printed as a whole in the order of the arguments; in real time one after the other.
  alias Console.Cli.{Format, Output}
  alias Console.Scenario.{Options, Recording, Report}
  alias Sim.{Scenario, Scene, Trial}
  alias Sim.Scenario.Runner

  @doc """
  Reads all files before the first run. The status is 0 if all expectations hold, else 2; an error
  has one line for each problem of a file.
  """
  @spec run(Options.t()) :: 0 | 2 | {:error, [String.t(), ...]}
  def run(%Options{files: files} = options) do
    results = for file <- files, do: {file, open(file)}

    case for {_file, {:error, lines}} <- results, line <- lines, do: line do
      [] ->
        record(
          play(for({file, {:ok, run}} <- results, do: {file, run}), options),
          results,
          options
        )

      lines ->
        {:error, lines}
    end
  end

  # So that one can see why; a recording that cannot be written is an error.
  defp record([], _results, _options), do: 0
  defp record(_failed, _results, %{record: nil}), do: 2

  defp record(failed, results, options) do
    output = Output.to(:stdio)
    names = results |> Enum.map(&elem(&1, 0)) |> Recording.names()

    errors =
      for {{file, {:ok, run}}, name} <- Enum.zip(results, names),
          {^file, at_s} <- failed,
          path = Path.join(options.record, name),
          {:error, line} <- [Recording.record(run.scenario, path) |> told(path, at_s, output)],
          do: line

    if errors == [], do: 2, else: {:error, errors}
  end

  defp told(:ok, path, at_s, output) do
    path = Path.relative_to_cwd(path)
    Output.line(output, "Recorded it: mix replay #{path} --at #{Format.decimals(at_s, 1)}")
  end

  defp told({:error, line}, _path, _at_s, _output), do: {:error, "--record #{line}"}

  defp open(file) do
    with {:ok, scenario} <- Scenario.File.load(file),
         {:error, line} <- Runner.new(scenario),
         do: {:error, ["#{file}: #{line}"]}
  end

  defp play(runs, %{live: true} = options) do
    {:ok, _apps} = Application.ensure_all_started(:swarm)
    failed = Enum.flat_map(runs, &in_real_time(&1, options))

    if length(runs) > 1,
      do: IO.puts(Report.total(length(runs), Enum.map(failed, &elem(&1, 0))))

    failed
  end

  defp play([{file, run}], options) do
    Sim.Trial.Memory.prepare()
    output = Output.to(:stdio)
    unless options.quiet, do: tell(Report.heading(file, run.scenario, run.trial), output)
    now_ms = Hal.Clock.now_ms()
    run = live(run, %{output: output, quiet: options.quiet, told: 0, drawn_ms: now_ms})
    Output.finish(output)
    verdicts = Runner.verdicts(run)
    tell(shown(verdicts, options) ++ [summary(file, run, verdicts)], output)
    failed(file, verdicts)
  end

  defp play(runs, options) do
    output = Output.to(:stdio)
    count = length(runs)
    progress(output, 0, count)

    failed =
      runs
      |> Task.async_stream(&whole/1, timeout: :infinity)
      |> Enum.with_index(1)
      |> Enum.flat_map(fn {{:ok, {file, lines, verdicts, last}}, n} ->
        lines = if options.quiet, do: [], else: lines
        blank = if options.quiet, do: [], else: [""]

        if not options.quiet or not held?(verdicts),
          do: tell(lines ++ shown(verdicts, options) ++ [last | blank], output)

        progress(output, n, count)
        failed(file, verdicts)
      end)

    Output.finish(output)
    Output.line(output, Report.total(count, Enum.map(failed, &elem(&1, 0))))
    failed
  end

  defp in_real_time({file, %{scenario: scenario, trial: trial}}, options) do
    output = Output.to(:stdio)
    unless options.quiet, do: tell(Report.heading(file, scenario, trial), output)
    now_ms = Hal.Clock.now_ms()
    view = %{output: output, quiet: options.quiet, told: 0, drawn_ms: now_ms}

    shown = fn at_ms, stages, checks, view ->
      view
      |> news(stages)
      |> draw(at_ms / 1000, Scenario.duration_s(scenario), checks)
    end

    ended = Scenario.Live.run(scenario, view, shown)
    Output.finish(output)

    case ended do
      {:ok, _result, at_s, verdicts} ->
        tell(shown(verdicts, options) ++ [Report.summary(file, at_s, verdicts)], output)
        failed(file, verdicts)

      {:error, line} ->
        tell(["#{file}: #{line}"], output)
        [{file, 0.0}]
    end
  end

  # A run that is over is large: only what is printed of it comes back from its process.
  defp whole({file, run}) do
    Sim.Trial.Memory.prepare()
    heading = Report.heading(file, run.scenario, run.trial)
    run = finish(run)
    verdicts = Runner.verdicts(run)

    {file, heading ++ Enum.map(stages(run), &Format.stage/1), verdicts,
     summary(file, run, verdicts)}
  end

  defp finish(run), do: if(Runner.done?(run), do: run, else: run |> Runner.step() |> finish())

  defp live(run, view) do
    at_s = run.trial.at_ms / 1000
    view = view |> news(stages(run)) |> draw(at_s, Scenario.duration_s(run.scenario), run.checks)
    if Runner.done?(run), do: run, else: run |> Runner.step() |> live(view)
  end

  defp news(%{quiet: true} = view, _stages), do: view

  defp news(view, stages) do
    tell(stages |> Scene.news(view.told) |> Enum.map(&Format.stage/1), view.output)
    %{view | told: Scene.told(stages)}
  end

  defp draw(view, at_s, duration_s, checks) do
    Output.redraw(view, fn ->
      open = Enum.count(checks, &(&1.status in [:open, :holding]))
      {at_s, duration_s, "#{open} of #{length(checks)} expectations undecided"}
    end)
  end

  defp progress(%Output{columns: nil}, _done, _count), do: :ok

  defp progress(output, done, count),
    do:
      Output.progress(
        output,
        String.slice("#{done} of #{count} scenarios", 0, output.columns - 1)
      )

  defp stages(run), do: Trial.scene(run.trial).stages
  defp at_s(run), do: run.trial.at_ms / 1000
  defp summary(file, run, verdicts), do: Report.summary(file, at_s(run), verdicts)
  defp held?(verdicts), do: not Enum.any?(verdicts, &(&1.held? == false))

  defp shown(verdicts, %{quiet: true}),
    do: verdicts |> Enum.filter(&(&1.held? == false)) |> Report.verdicts()

  defp shown(verdicts, _options), do: Report.verdicts(verdicts)
  # When the first expectation failed.
  defp failed(file, verdicts),
    do: for(%{held?: false, at_s: at_s} <- verdicts, do: {file, at_s}) |> Enum.take(1)

  defp tell(lines, output), do: Enum.each(lines, &Output.line(output, &1))
end
