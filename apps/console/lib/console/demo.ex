defmodule Console.Demo do
  @moduledoc """
  The demo without a view: the run in lockstep, its stages as lines, then report, picture and summary.
  """
  alias Console.{Fleet, Options, Picture, Report}
  alias Console.Cli.{Format, Output, Progress}
  alias Console.Picture.RunTrack

  @progress_ms 100

  @doc """
  Runs `options` with a trial module (`Sim.Trial`) and returns the exit status: 0 if the fleet
  ended in formation, 2 if it did not, 1 if the run cannot be made, or ended before its time. Among
  the `hooks`, `lines` returns lines to print about the trial before it runs, `ended` says why it
  ended before its time (or `nil`), and `stop` ends what it leaves behind.
  """
  @spec run(Options.t(), module(),
          lines: (term() -> [String.t()]),
          ended: (term() -> String.t() | nil),
          stop: (term() -> :ok)
        ) :: 0 | 1 | 2
  def run(%Options{} = options, trial_module, hooks \\ []) do
    lines = Keyword.get(hooks, :lines, fn _trial -> [] end)
    ended = Keyword.get(hooks, :ended, fn _trial -> nil end)
    stop = Keyword.get(hooks, :stop, fn _trial -> :ok end)

    # With `--json -` only the report is written to standard output.
    output = Output.to(if(options.json == "-", do: :stderr, else: :stdio))

    case trial_module.new(Options.trial(options)) do
      {:ok, trial} ->
        Enum.each([heading(options) | lines.(trial)], &Output.line(output, &1))
        started = System.monotonic_time(:millisecond)
        scene = trial_module.scene(trial)

        run =
          play(
            %{
              module: trial_module,
              trial: trial,
              track: track(options, scene),
              told: 0,
              drawn_ms: started,
              output: output,
              duration_s: Options.duration_s(options)
            },
            scene
          )

        Output.finish(output)
        status = finish(run, options, (System.monotonic_time(:millisecond) - started) / 1000)
        line = ended.(run.trial)
        stop.(run.trial)
        if line, do: refuse(line), else: status

      {:error, line} ->
        refuse(line)
    end
  end

  defp refuse(line) do
    IO.puts(:stderr, "demo: #{line}")
    1
  end

  @doc "The first line of a run: the robots, the map, the seed and the formation."
  @spec heading(Options.t()) :: String.t()
  def heading(options) do
    {kind, spacing} = options.formation

    "#{Format.count(length(options.robots), "robot")} (#{Fleet.describe(options.robots)}) in " <>
      "#{options.map}, seed #{options.seed}, #{kind} with #{Format.decimals(spacing, 1)} m spacing"
  end

  # Paths are kept only if a picture is wanted.
  defp track(%Options{picture: nil}, _scene), do: nil
  defp track(_options, scene), do: RunTrack.new(scene)

  defp play(run, scene) do
    run = run |> tell(scene) |> draw(scene)

    if run.module.done?(run.trial) do
      run
    else
      trial = run.module.step(run.trial)
      scene = run.module.scene(trial)
      play(%{run | trial: trial, track: run.track && RunTrack.add(run.track, scene)}, scene)
    end
  end

  defp tell(run, scene) do
    new = Enum.drop(scene.stages, run.told)
    Enum.each(new, &Output.line(run.output, Format.stage(&1)))
    %{run | told: run.told + length(new)}
  end

  defp draw(%{output: %Output{columns: nil}} = run, _scene), do: run

  defp draw(run, scene) do
    now = System.monotonic_time(:millisecond)

    if now - run.drawn_ms >= @progress_ms do
      line =
        Progress.line(scene.at_ms / 1000, run.duration_s, note(scene), run.output.columns - 1)

      Output.progress(run.output, line)
      %{run | drawn_ms: now}
    else
      run
    end
  end

  defp note(%{leader: nil}), do: "no leader yet"
  defp note(%{error: nil} = scene), do: "#{scene.leader} leads"

  defp note(%{error: {mean, _max}} = scene),
    do: "#{scene.leader} leads, formation error #{Format.decimals(mean, 2)} m"

  defp finish(run, options, wall_s) do
    result = run.module.result(run.trial)
    formed? = run.module.scene(run.trial).formed?
    Enum.each(Report.summary(result, formed?, wall_s), &Output.line(run.output, &1))

    title = Picture.title(length(options.robots), options.map, options.seed)
    drawing = run.track && fn -> Picture.draw(run.track, title) end

    case Report.write(options, Report.json(result, wall_s), drawing, run.output) do
      :ok ->
        if formed?, do: 0, else: 2

      {:error, line} ->
        refuse(line)
    end
  end
end
