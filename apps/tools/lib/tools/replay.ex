defmodule Tools.Replay do
  @moduledoc """
  Replays a recording for people, of a run in lockstep or of robots of processes (`.Recording`): prints its stages, says whether
  every decision is as recorded (`.Verdict`), how the fleet stood at a time (`.Moment`), compares two recordings, and goes
  through one tick by tick at a prompt (`.Session`) or in the browser (`.Live`).
  """
  alias Console.Cli.{Format, OutFile, Output}
  alias Console.Picture.Film

  alias Tools.Replay.{
    Asked,
    Difference,
    Guard,
    Live,
    Moment,
    Options,
    Recording,
    Session,
    Verdict
  }

  alias Console.Tables
  alias Record.Recording.Comparison
  alias Lab.Replay.Kind

  # So many differences are shown; the first ones explain the others.
  @shown 3
  # From one scene of a film to the next.
  @film_ms 500

  @doc """
  Runs the command, and returns its exit status: 0 if all is the same, 2 if something differs or
  was lost, 1 if the recording cannot be read.
  """
  @spec run(Options.t()) :: 0 | 1 | 2
  def run(%Options{} = options) do
    with {:error, line} <- Guard.run(options.file, fn -> read(options) end), do: refuse(line)
  rescue
    error in Mcap.DamagedError -> refuse(Exception.message(error))
  end

  defp read(options) do
    with {:ok, recording} <- Recording.open(options.file),
         names = Recording.names(recording),
         :ok <- Asked.check(options, names, Recording.last_ms(recording) / 1000),
         do: follow(recording, options)
  end

  defp follow(recording, %{step: true} = options) do
    IO.puts(Recording.heading(recording))
    Session.run(options, recording)
  end

  defp follow(recording, %{page: true} = options), do: page(recording, options)
  defp follow(recording, %{against: nil} = options), do: replay(recording, options)
  defp follow(recording, options), do: against(recording, options)

  defp refuse(line) do
    IO.puts(:stderr, "replay: #{line}")
    1
  end

  defp against(one, options) do
    with {:ok, other} <- other(one, options), do: told(first(one, other))
  end

  defp other(one, options) do
    with {:ok, other} <- Recording.open(options.against),
         :ok <- Recording.alike(one, other),
         do: {:ok, other}
  end

  defp first(%{begin: begin} = one, %{begin: begin} = other),
    do: Comparison.first(Recording.comparable(one), Recording.comparable(other))

  defp first(one, other), do: {:begins, Difference.options(one.options, other.options)}

  defp told({:begins, how}) do
    IO.puts("The two begin differently: #{how}")
    2
  end

  defp told({:same, until_ms}) do
    IO.puts("The two are the same, #{Format.seconds(until_ms)} of them.")
    0
  end

  defp told({:ends, after_ms}) do
    IO.puts("The two are the same until one ends, after #{Format.seconds(after_ms)}.")
    2
  end

  defp told({:differs, difference}) do
    Enum.each(Difference.parted(difference), &IO.puts/1)
    2
  end

  # Until a person presses Enter.
  defp page(recording, options) do
    robots = Enum.map(Recording.names(recording), &String.to_existing_atom/1)

    with {:ok, recordings, parts} <- beside(recording, options),
         {:ok, _page, url} <- Console.Page.start_link(module: Live, live: self(), robots: robots) do
      Enum.each(recordings, &IO.puts(Recording.heading(&1)))
      IO.puts("Page:  #{url}")
      IO.puts("Enter ends this program.")
      live = self()

      spawn_link(fn ->
        _line = IO.gets("")
        Live.close(live)
      end)

      at_ms = round(1000 * (options.at_s || 0.0))
      if Live.loop(Live.new(recordings, at_ms, parts)), do: 2, else: 0
    end
  end

  defp beside(one, %{against: nil}), do: {:ok, [one], nil}

  defp beside(one, options) do
    with {:ok, other} <- other(one, options) do
      parts =
        case first(one, other) do
          {:begins, how} -> {0, "the two begin differently: #{how}"}
          {:differs, difference} -> {difference.at_ms, hd(Difference.parted(difference))}
          {:ends, after_ms} -> {after_ms, "one of the two ends here"}
          {:same, _until_ms} -> nil
        end

      {:ok, [one, other], parts}
    end
  end

  defp replay(recording, options) do
    with {:ok, tables} <- tables(options),
         :ok <- OutFile.check("--film", options.film) do
      output = Output.to(:stdio)
      replay = Recording.replay(recording, only(options))
      Output.line(output, Recording.heading(recording))
      asked_s = options.at_s || options.until_s
      until_ms = if asked_s, do: round(1_000 * asked_s), else: Recording.last_ms(recording)

      run = %{
        replay: replay,
        before: nil,
        tick: nil,
        told: 0,
        shown: [],
        count: 0,
        drawn_ms: Hal.Clock.now_ms(),
        output: output,
        until_ms: until_ms,
        quiet?: options.at_s != nil,
        tables: tables,
        film: options.film && [Kind.scene(replay)]
      }

      run =
        recording
        |> Recording.ticks()
        |> Stream.take_while(fn {at_ms, _entries} -> at_ms <= until_ms end)
        |> Enum.reduce(run, &step/2)

      {replay, last} = Kind.finish(run.replay)
      run = differs(%{run | replay: replay}, last)
      Output.finish(output)
      Enum.each(Moment.lines(options, run, Recording.names(recording)), &IO.puts/1)
      compared = Kind.compared(replay)
      verdict = Verdict.lines(compared, Kind.at_ms(replay), run.shown, run.count)
      Enum.each(verdict, &IO.puts/1)

      with :ok <- close(run.tables),
           :ok <- film(run.film, recording, options),
           do: Verdict.status(compared, run.count)
    end
  end

  # Another robot than the one that is shown may be asked why.
  defp only(%{robot: name, why: why}) when why in [nil, name], do: name
  defp only(_options), do: nil

  defp tables(%{csv: nil}), do: {:ok, nil}
  defp tables(%{csv: folder}), do: named(Tables.open(folder))

  defp close(nil), do: :ok
  defp close(tables), do: named(Tables.close(tables))

  defp named({:error, line}), do: {:error, "--csv #{line}"}
  defp named(ok), do: ok

  defp step(tick, run) do
    {replay, differences} = Kind.step(run.replay, tick)
    run = differs(%{run | replay: replay, before: run.replay, tick: tick}, differences)
    run |> tabulate() |> picture() |> draw() |> tell()
  end

  defp picture(%{film: nil} = run), do: run

  defp picture(%{replay: replay} = run) do
    if rem(Kind.at_ms(replay), @film_ms) == 0,
      do: %{run | film: [Kind.scene(replay) | run.film]},
      else: run
  end

  defp film(nil, _recording, _options), do: :ok

  defp film(scenes, recording, options) do
    with {:ok, film} <- Film.draw(Enum.reverse(scenes), recording.about),
         :ok <- OutFile.write("--film", options.film, film) do
      IO.puts("Wrote #{options.film}")
    else
      {:error, "--film" <> _ = line} -> {:error, line}
      {:error, line} -> {:error, "--film: #{line}"}
    end
  end

  defp differs(run, differences) do
    shown = Enum.take(run.shown ++ differences, @shown)
    %{run | shown: shown, count: run.count + length(differences)}
  end

  defp tabulate(%{tables: nil} = run), do: run

  defp tabulate(%{replay: replay} = run),
    do: %{run | tables: Tables.tick(run.tables, Kind.facts(replay, run.tick), Kind.scene(replay))}

  defp draw(run) do
    Output.redraw(run, fn ->
      {Kind.at_ms(run.replay) / 1000, run.until_ms / 1000, "replayed"}
    end)
  end

  defp tell(%{quiet?: true} = run), do: run

  defp tell(run) do
    stages = Kind.stages(run.replay)
    Enum.each(Enum.drop(stages, run.told), &Output.line(run.output, Format.stage(&1)))
    %{run | told: length(stages)}
  end
end
