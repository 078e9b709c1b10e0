defmodule Console.Replay.Live do
  @moduledoc false
  # Replays a recording of robots of processes (`Robot.Recorder`) for people: whether they decide
  # the same again, how they were at a time, and why.
  alias Robot.Recording
  alias Console.Cli.Output
  alias Console.Replay.{Asked, Guard, LiveText, Options}
  alias Robot.Replay

  # So many differences are shown; the first ones explain the others.
  @shown 3

  @doc """
  Replays the file of the options: the exit status as of `Console.Replay.run/1`; `:other` for a
  file that is no such recording. The error is one line.
  """
  @spec run(Options.t()) :: {:live, 0 | 2} | :other | {:error, line :: String.t()}
  def run(%Options{} = options) do
    Sim.Recording.File.know()

    with {:ok, file} <- Recording.File.open(options.file),
         :ok <- check(options, file),
         do: {:live, replay(options, file)}
  end

  defp check(options, file) do
    names = Enum.map(Recording.File.ids(file), &Atom.to_string/1)
    last_s = (file.end_ms - file.start_ms) / 1000

    with :ok <- only_lockstep(options), do: Asked.check(options, names, names, last_s)
  end

  defp only_lockstep(options) do
    asked = [{"--against", options.against}, {"--csv", options.csv}, {"--step", options.step}]

    Enum.find_value(asked, :ok, fn
      {_option, no} when no in [nil, false] ->
        nil

      {option, _} ->
        {:error, "#{option} needs a recording of a run in lockstep; this is one of live robots"}
    end)
  end

  defp replay(options, file) do
    output = Output.to(:stdio)
    Output.line(output, LiveText.heading(file))
    until_s = options.at_s || options.until_s
    until = if until_s, do: [until_ms: file.start_ms + round(until_s * 1000)], else: []

    run =
      file
      |> Recording.File.entries(until)
      |> Guard.watched()
      |> Stream.filter(&asked?(&1, options.robot))
      |> Enum.reduce(
        %{
          file: file,
          replay: Replay.new(),
          found: [],
          count: 0,
          last_ms: 0,
          drawn_ms: Hal.Clock.now_ms(),
          output: output
        },
        &step/2
      )

    {replay, last} = Replay.finish(run.replay)
    run = %{run | replay: replay, found: run.found ++ last, count: run.count + length(last)}
    Output.finish(output)
    at_s = until_s || run.last_ms / 1000
    Enum.each(LiveText.moment(options, file, replay, at_s), &IO.puts/1)

    Enum.each(
      LiveText.verdict(file, replay, run.last_ms, Enum.take(run.found, @shown), run.count),
      &IO.puts/1
    )

    if run.count == 0 and LiveText.whole?(replay), do: 0, else: 2
  end

  defp asked?(_entry, nil), do: true
  defp asked?({id, _entry}, name), do: Atom.to_string(id) == name

  defp step({id, {_role, _kind, _what, at_ms}} = entry, run) do
    {replay, difference} = Replay.step(run.replay, entry)
    last_ms = max(run.last_ms, Recording.File.since_start_ms(run.file, id, at_ms))
    draw(note(%{run | replay: replay, last_ms: last_ms}, difference))
  end

  defp note(run, nil), do: run

  defp note(run, difference),
    do: %{run | found: Enum.take(run.found ++ [difference], @shown), count: run.count + 1}

  defp draw(run) do
    Output.redraw(run, fn ->
      {run.last_ms / 1000, (run.file.end_ms - run.file.start_ms) / 1000, "replayed"}
    end)
  end
end
