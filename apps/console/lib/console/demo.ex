defmodule Console.Demo do
  @moduledoc """
  Runs the demo without a view: the run in lockstep, its stages as lines, then report, picture and summary.
  """
  alias Console.{Fleet, Options, Picture, Report, Tables}
  alias Console.Cli.{Format, MapName, Output}
  alias Console.Picture.RunTrack
  alias Hal.Pose
  alias Nav.MapFile
  alias Lab.{Recorder, Run, Trial}
  alias Sim.Floorplan.Maps
  alias Sim.Scene
  alias Lab.Recording.{Facts, Pictures}
  alias Lab.Trial.Coverage

  # A fleet of more robots may be too large for real time.
  @large 20

  @doc """
  Runs `options` with `Lab.Trial`, or `Lab.Fleet` in real time, and returns the exit status: 0 if the fleet
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

    case begin(trial_module, options) do
      {:ok, trial, recorder, tables} ->
        scene = trial_module.scene(trial)
        heading = heading(options, scene) <> slow(trial_module, trial)
        Enum.each([heading | lines.(trial)], &Output.line(output, &1))
        started = Hal.Clock.now_ms()

        view = %{
          track: track(options, scene),
          recorder: recorder,
          pictures: options.record_pictures,
          tables: tables,
          told: 0,
          starts: for(robot <- scene.robots, do: Pose.point(robot.pose)),
          drawn_ms: started,
          pace: {0, started, trial_module == Trial and length(scene.robots) > @large},
          output: output,
          duration_s: Options.duration_s(options)
        }

        view = view |> tell(scene) |> draw(scene)

        {run, view} = trial |> Run.new() |> Run.fold(view, &Run.done?/1, &show/3)

        Output.finish(output)
        status = finish(run, view, options, (Hal.Clock.now_ms() - started) / 1000)
        line = ended.(run.source) || recorded(view, options, output)
        stop.(run.source)
        if line, do: refuse(line), else: status

      {:error, line} ->
        refuse(line)
    end
  end

  # What the machine does not manage in real time: the second of two steps of a large fleet in lockstep is timed. They are
  # made again in the run. Robots that hear and see each other take longer than they do then, so it is timed on.
  @step_us 100_000
  @paced_ms 10_000

  defp slow(Trial, trial) do
    trial = if length(Trial.living(trial)) > @large, do: Trial.step(trial)
    {us, _trial} = if trial, do: :timer.tc(fn -> Trial.step(trial) end), else: {0, nil}

    if us > @step_us,
      do: "; at first they go at #{Format.decimals(@step_us / us, 2)} times real time here",
      else: ""
  end

  defp slow(_real_time, _trial), do: ""

  defp begin(Lab.Fleet, options) do
    with {:ok, fleet} <- Lab.Fleet.start_link(Options.trial(options)), do: {:ok, fleet, nil, nil}
  end

  defp begin(module, %Options{record: nil, csv: nil} = options) do
    with {:ok, trial} <- module.new(Options.trial(options)), do: {:ok, trial, nil, nil}
  end

  # Only what runs in lockstep is recorded (`Console.Options`).
  defp begin(Trial, options) do
    with {:ok, setup} <- Trial.setup(Options.trial(options)),
         {:ok, recorder} <- named("--record", options.record, &recorder(&1, setup, options)),
         {:ok, tables} <- named("--csv", options.csv, &Tables.open/1) do
      {:ok, Trial.begin(setup, record: true), recorder, tables}
    end
  end

  defp recorder(path, setup, options),
    do: Recorder.start_link(path, setup, pictures: options.record_pictures != nil)

  defp named(_option, nil, _open), do: {:ok, nil}

  defp named(option, path, open),
    do: with({:error, line} <- open.(path), do: {:error, "#{option} #{line}"})

  # Why what was wanted of the run is not whole, or `nil`.
  defp recorded(view, options, output) do
    kept = [
      {"--record", options.record, view.recorder && fn -> Recorder.close(view.recorder) end},
      {"--csv", options.csv, view.tables && fn -> Tables.close(view.tables) end}
    ]

    Enum.find_value(kept, fn
      {_option, _path, nil} ->
        nil

      {option, path, close} ->
        case close.() do
          :ok ->
            Output.line(output, "Wrote #{path}")
            nil

          {:error, line} ->
            "#{option} #{line}"
        end
    end)
  end

  defp refuse(line) do
    IO.puts(:stderr, "demo: #{line}")
    1
  end

  @doc """
  The first line of a run: the robots, the map, whether grey in its picture was taken for wall, the seed and the formation, or
  the mission; and where landmark and robots stand, if that was chosen: on a built-in map, whose middle is known, only of a
  landmark that is not there; and which bodies see nothing ahead.
  """
  @spec heading(Options.t(), Scene.t()) :: String.t()
  def heading(options, scene) do
    "#{Format.count(length(options.robots), "robot")} (#{Fleet.describe(options.robots)}) in " <>
      "#{options.map}#{MapName.grey(scene, "--grey floor")}, seed #{options.seed}, " <>
      task(options, scene) <> places(options, scene) <> unseeing(options)
  end

  defp task(%{mission: {module, _own}}, _scene) when module != Missions.Landmark,
    do: Swarm.MissionRegistry.name(module)

  defp task(_options, %{formation: {kind, spacing}}),
    do: "#{kind} with #{Format.decimals(spacing, 1)} m spacing"

  defp places(options, scene) do
    drawing? = not Maps.built_in?(options.map)
    chosen? = options.landmark == :default and scene.landmark != nil
    landmark? = chosen? and (drawing? or scene.landmark != {0.0, 0.0})

    if(landmark?, do: "; the landmark stands at #{place(scene.landmark)}", else: "") <>
      if(drawing?,
        do: "; #{starts(for robot <- scene.robots, do: Pose.point(robot.pose))}",
        else: ""
      )
  end

  defp unseeing(%{robots: robots, bodies: bodies}) do
    {:ok, bodies} = Lab.Trial.Options.bodies(robots, bodies)
    kinds = robots |> Enum.map(&bodies[&1]) |> Enum.uniq()
    for body <- kinds, line = Robot.File.Warnings.blind(body), into: "", do: "; #{line}"
  end

  defp starts([place]), do: "the robot starts at #{place(place)}"

  defp starts(places) do
    {xs, ys} = Enum.unzip(places)

    "the robots start between #{place({Enum.min(xs), Enum.min(ys)})} and #{place({Enum.max(xs), Enum.max(ys)})}"
  end

  defp place({x, y}), do: "#{Format.decimals(x, 2)},#{Format.decimals(y, 2)}"

  # Paths are kept only if a picture is wanted.
  defp track(%Options{picture: nil}, _scene), do: nil
  defp track(_options, scene), do: RunTrack.new(scene)

  defp show(before, run, view) do
    scene = Run.scene(run)
    {pace, line} = pace(view.pace, scene.at_ms, Hal.Clock.now_ms())
    if line, do: Output.line(view.output, line)
    {trial, view} = record(view, before.source, run.source, scene)
    view = %{view | pace: pace, track: view.track && RunTrack.add(view.track, scene)}
    {%{run | source: trial}, view |> tell(scene) |> draw(scene)}
  end

  @doc """
  How fast a run goes, at this simulated time and this time of the clock (ms): since when it was not looked at, and the line
  that says so, once, after 10 simulated seconds that took longer than that; else `nil`.

      iex> pace = {0, 500, true}
      iex> {pace, nil} = Console.Demo.pace(pace, 9_900, 100_000)
      iex> {later, nil} = Console.Demo.pace(pace, 10_000, 10_400)
      iex> Console.Demo.pace(later, 20_000, 35_400)
      {{20_000, 35_400, false}, "From 10 to 20 s the run went at 0.40 times real time here"}
  """
  @spec pace(pace, integer(), integer()) :: {pace, String.t() | nil}
        when pace: {at_ms :: integer(), clock_ms :: integer(), tells? :: boolean()}
  def pace({from_ms, started_ms, true}, at_ms, now_ms) when at_ms - from_ms >= @paced_ms do
    {simulated, real} = {at_ms - from_ms, max(now_ms - started_ms, 1)}

    if real > simulated do
      span = "From #{div(from_ms, 1_000)} to #{div(at_ms, 1_000)} s"
      speed = Format.decimals(simulated / real, 2)
      {{at_ms, now_ms, false}, "#{span} the run went at #{speed} times real time here"}
    else
      {{at_ms, now_ms, true}, nil}
    end
  end

  def pace(pace, _at_ms, _now_ms), do: {pace, nil}

  defp record(%{recorder: nil, tables: nil} = view, _before, trial, _scene), do: {trial, view}

  defp record(view, before, trial, scene) do
    {entries, trial} = Trial.take_entries(trial)

    if view.recorder do
      frames = Pictures.due(before, view.pictures)
      :ok = Recorder.tick(view.recorder, {scene.at_ms, entries}, scene, frames)
    end

    {trial, %{view | tables: view.tables && Tables.tick(view.tables, Facts.of(entries), scene)}}
  end

  defp tell(view, scene) do
    new = Scene.news(scene.stages, view.told)
    Enum.each(new, &Output.line(view.output, Format.stage(&1)))
    %{view | told: Scene.told(scene.stages)}
  end

  defp draw(view, scene),
    do: Output.redraw(view, fn -> {scene.at_ms / 1000, view.duration_s, note(scene)} end)

  defp note(%{leader: nil}), do: "no leader yet"
  defp note(%{error: nil} = scene), do: "#{scene.leader} leads"

  defp note(%{error: {mean, _max}} = scene),
    do: "#{scene.leader} leads, formation error #{Format.decimals(mean, 2)} m"

  defp finish(%{source: trial} = run, view, options, wall_s) do
    result = run |> Run.result() |> Map.put(:seen, seen(trial, view.starts))
    formed? = Run.scene(run).formed?
    Enum.each(Report.summary(result, formed?, wall_s), &Output.line(view.output, &1))

    drawing =
      view.track && fn -> Picture.draw(view.track, Picture.title(Options.trial(options))) end

    written =
      with :ok <- Report.write(options, Report.json(result, wall_s), drawing, view.output),
           do: save_map(trial, options, view.output)

    case written do
      :ok ->
        if formed?, do: 0, else: 2

      {:error, line} ->
        refuse(line)
    end
  end

  defp seen(%Trial{} = trial, starts), do: Coverage.of(trial, starts)
  defp seen(_real_time, _starts), do: nil

  # That of the robot that knows most: what another one has told last may not have reached all.
  defp save_map(_trial, %Options{save_map: nil}, _output), do: :ok

  defp save_map(trial, %Options{save_map: file}, output) do
    with map when map != nil <- Coverage.fullest(trial),
         :ok <- named("--save-map", file, &MapFile.save(&1, map)) do
      Output.line(output, "Wrote #{file}")
    else
      nil -> {:error, "--save-map #{file} cannot be written: no robot is left that has a map"}
      error -> error
    end
  end
end
