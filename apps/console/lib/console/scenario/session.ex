defmodule Console.Scenario.Session do
  @moduledoc false
  # Runs the files of `mix scenario`: one with its stages as they happen, several side by side, each
  # printed as a whole in the order of the arguments; in real time one after the other.
  alias Console.Cli.{Format, Output}
  alias Console.Scenario.{Options, Recording, Report}
  alias Lab.{Run, Scenario}
  alias Sim.Scene
  alias Lab.Scenario.Runner

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
      for {{file, {:ok, {scenario, _run}}}, name} <- Enum.zip(results, names),
          {^file, at_s} <- failed,
          path = Path.join(options.record, name),
          {:error, line} <- [Recording.record(scenario, path) |> told(path, at_s, output)],
          do: line

    if errors == [], do: 2, else: {:error, errors}
  end

  defp told(:ok, path, at_s, output) do
    path = Path.relative_to_cwd(path)
    Output.line(output, "Recorded it: mix replay #{path} --at #{Format.decimals(at_s, 1)}")
  end

  defp told({:error, line}, _path, _at_s, _output), do: {:error, "--record #{line}"}

  defp open(file) do
    with {:ok, scenario} <- Scenario.File.load(file), {:ok, run} <- Runner.new(scenario) do
      {:ok, {scenario, run}}
    else
      {:error, line} when is_binary(line) -> {:error, ["#{file}: #{line}"]}
      problems -> problems
    end
  end

  defp play(runs, %{live: true} = options) do
    {:ok, _apps} = Application.ensure_all_started(:swarm)
    failed = Enum.flat_map(runs, &alone(&1, options))

    if length(runs) > 1,
      do: IO.puts(Report.total(length(runs), Enum.map(failed, &elem(&1, 0))))

    failed
  end

  defp play([run], options) do
    Lab.Trial.Memory.prepare()
    alone(run, options)
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

  # With its stages as they happen.
  defp alone({file, {scenario, run}}, options) do
    output = Output.to(:stdio)
    unless options.quiet, do: tell(Report.heading(file, scenario, run.source), output)
    view = %{output: output, quiet: options.quiet, told: 0, drawn_ms: Hal.Clock.now_ms()}

    play = fn run ->
      {run, _view} =
        Runner.play(scenario, run, show(scenario, run, view), &{&1, show(scenario, &1, &2)})

      ended(file, run)
    end

    ended = if options.live, do: Runner.live(scenario, play), else: {:ok, play.(run)}
    Output.finish(output)

    case ended do
      {:ok, {verdicts, last}} ->
        tell(shown(verdicts, options) ++ [last], output)
        failed(file, verdicts)

      {:error, line} ->
        tell(["#{file}: #{line}"], output)
        [{file, 0.0}]
    end
  end

  defp whole({file, {scenario, run}}) do
    Lab.Trial.Memory.prepare()
    heading = Report.heading(file, scenario, run.source)
    {run, nil} = Runner.play(scenario, run)
    {verdicts, last} = ended(file, run)
    {file, heading ++ Enum.map(Run.stages(run), &Format.stage/1), verdicts, last}
  end

  defp ended(file, run) do
    {_result, verdicts} = Runner.verdicts(run)
    {verdicts, Report.summary(file, Run.at_ms(run) / 1000, verdicts)}
  end

  defp show(scenario, run, view) do
    view
    |> news(Run.stages(run))
    |> draw(Run.at_ms(run) / 1000, Scenario.duration_s(scenario), run.checks)
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

  defp held?(verdicts), do: not Enum.any?(verdicts, &(&1.held? == false))

  defp shown(verdicts, %{quiet: true}),
    do: verdicts |> Enum.filter(&(&1.held? == false)) |> Report.verdicts()

  defp shown(verdicts, _options), do: Report.verdicts(verdicts)
  # When the first expectation failed.
  defp failed(file, verdicts),
    do: for(%{held?: false, at_s: at_s} <- verdicts, do: {file, at_s}) |> Enum.take(1)

  defp tell(lines, output), do: Enum.each(lines, &Output.line(output, &1))
end
