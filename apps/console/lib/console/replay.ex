defmodule Console.Replay do
  @moduledoc """
  Replays a recorded run for people: prints its stages, says whether every decision and every
  reading is as recorded, how the fleet stood at a time (`.Moment`), compares two recordings, and goes through one tick by
  tick (`.Session`).
  """
  alias Console.Cli.{Format, Output}
  alias Console.Replay.{Asked, Difference, Guard, Live, Moment, Options, Session}
  alias Console.Tables
  alias Sim.{Recording, Replay, Trial}

  # So many differences are shown; the first ones explain the others.
  @shown 3

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
    with :other <- Live.run(options),
         {:ok, file} <- Recording.File.open(options.file),
         :ok <- asked(options, file),
         {:ok, status} <- follow(file, options) do
      status
    else
      {:live, status} -> status
      {:error, line} -> {:error, line}
    end
  end

  defp asked(options, file) do
    names = for robot <- file.setup.robots, do: Atom.to_string(robot.id)
    Asked.check(options, names, ["leader" | names], Recording.File.last_ms(file) / 1000)
  end

  defp follow(file, %{step: true} = options) do
    IO.puts(heading(file))
    {:ok, Session.run(options, file)}
  end

  defp follow(file, %{against: nil} = options), do: replay(file, options)
  defp follow(file, options), do: against(file, options)

  defp refuse(line) do
    IO.puts(:stderr, "replay: #{line}")
    1
  end

  defp against(one, options) do
    with {:ok, other} <- Recording.File.open(options.against) do
      if one.setup == other.setup do
        {:ok, told(Recording.Comparison.first(ticks(one), ticks(other)))}
      else
        IO.puts("The two begin differently: #{Difference.setups(one.setup, other.setup)}")
        {:ok, 2}
      end
    end
  end

  defp told({:same, ticks}) do
    IO.puts("The two are the same, #{Format.decimals(ticks / 10, 1)} s of them.")
    0
  end

  defp told({:ends, ticks}) do
    IO.puts("The two are the same until one ends, after #{Format.decimals(ticks / 10, 1)} s.")
    2
  end

  defp told({:differs, difference}) do
    Enum.each(Difference.parted(difference), &IO.puts/1)
    2
  end

  defp replay(file, options) do
    with {:ok, tables} <- tables(options) do
      output = Output.to(:stdio)

      until_ms =
        round(1_000 * (options.at_s || options.until_s || Recording.File.last_ms(file) / 1000))

      Output.line(output, heading(file))

      run = %{
        replay: Replay.new(file.setup),
        before: nil,
        tick: nil,
        told: 0,
        differences: [],
        drawn_ms: Hal.Clock.now_ms(),
        output: output,
        until_ms: until_ms,
        quiet?: options.at_s != nil,
        tables: tables
      }

      run =
        file
        |> ticks()
        |> Stream.take_while(fn {at_ms, _entries} -> at_ms <= until_ms end)
        |> Enum.reduce(run, &step/2)

      Output.finish(output)
      Enum.each(Moment.lines(options, run), &IO.puts/1)
      Enum.each(verdict(run), &IO.puts/1)
      with :ok <- close(run.tables), do: {:ok, if(run.differences == [], do: 0, else: 2)}
    end
  end

  defp ticks(file), do: Guard.watched(Recording.File.ticks(file))

  defp tables(%{csv: nil}), do: {:ok, nil}
  defp tables(%{csv: folder}), do: named(Tables.open(folder))

  defp close(nil), do: :ok
  defp close(tables), do: named(Tables.close(tables))

  defp named({:error, line}), do: {:error, "--csv #{line}"}
  defp named(ok), do: ok

  defp heading(%{setup: setup} = file) do
    "#{file.path}: #{Format.count(length(setup.robots), "robot")} in #{setup.options.map}, " <>
      "seed #{setup.options.seed}, #{Format.decimals(Recording.File.last_ms(file) / 1000, 1)} s" <>
      if(file.whole?, do: "", else: " (not ended in order: read as far as it is whole)")
  end

  defp step(tick, run) do
    {replay, differences} = Replay.step(run.replay, tick)
    differences = Enum.take(run.differences ++ differences, @shown)
    run = %{run | replay: replay, before: run.replay, tick: tick, differences: differences}
    run |> tabulate() |> draw() |> tell()
  end

  defp tabulate(%{tables: nil} = run), do: run

  defp tabulate(%{tick: {_at_ms, entries}} = run),
    do: %{run | tables: Tables.tick(run.tables, entries, Trial.scene(Replay.trial(run.replay)))}

  defp draw(run) do
    Output.redraw(run, fn ->
      {Replay.trial(run.replay).at_ms / 1000, run.until_ms / 1000, "replayed"}
    end)
  end

  defp tell(%{quiet?: true} = run), do: run

  defp tell(run) do
    stages = Trial.stages(Replay.trial(run.replay))
    Enum.each(Enum.drop(stages, run.told), &Output.line(run.output, Format.stage(&1)))
    %{run | told: length(stages)}
  end

  defp verdict(%{differences: []} = run) do
    [
      "#{Format.decimals(Replay.trial(run.replay).at_ms / 1000, 1)} s replayed: all decisions on " <>
        "#{run.replay.inputs} inputs, and all readings of the world, are as recorded."
    ]
  end

  defp verdict(run) do
    [
      "The replay differs from the recording, first in this:"
      | Enum.flat_map(run.differences, &Difference.lines/1)
    ]
  end
end
