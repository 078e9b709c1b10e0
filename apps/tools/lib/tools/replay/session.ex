defmodule Tools.Replay.Session do
  @moduledoc false
  # Runs `mix replay FILE --step`: a person goes forwards and backwards in a recording, and asks how the fleet stood at each
  # tick, and why. Reads commands (`Tools.Replay.Command`) from standard input, a terminal or not, until its end.
  alias Console.Cli.{Format, Output, Progress}
  alias Tools.Replay.{Command, Difference, Moment, Options, Recording, Verdict}
  alias Lab.Replay.{Cursor, Kind}

  # Long ways are gone in parts, and a terminal shows how far.
  @part_ms 5_000
  # An event may be known a tick after the time that it names.
  @margin_ms 200
  # So many events of a way are told.
  @told 12

  @doc "Goes on until the person quits: 2 if a tick that was passed differed, or was not compared, else 0."
  @spec run(Options.t(), Recording.t()) :: 0 | 2
  def run(%Options{} = options, recording) do
    output = Output.to(:stdio)

    session = %{
      cursor: Cursor.new(Recording.replay(recording, nil), &Recording.ticks(recording, &1)),
      options: options,
      names: Recording.names(recording),
      last_ms: Recording.last_ms(recording),
      output: output,
      echo?: output.columns == nil or not typed?(),
      differs?: false,
      again: {:step, 1}
    }

    Output.line(output, "Enter goes on by a tick of 0.1 s; help lists the commands.")
    session = moved(session, &goto(&1, round(1000 * (options.at_s || 0.0))))
    if options.why, do: show(session, options.why, nil)
    status(ask(session))
  end

  defp status(%{differs?: true}), do: 2
  defp status(_session), do: 0

  # A terminal shows what a person types; what comes from a file or a program is not shown.
  defp typed?, do: match?({:ok, %File.Stat{type: :device}}, File.stat("/dev/stdin"))

  defp ask(session) do
    case IO.gets(Format.seconds(Cursor.at_ms(session.cursor)) <> "> ") do
      line when is_binary(line) ->
        if session.echo?, do: IO.puts(String.trim_trailing(line, "\n"))
        answer(session, Command.parse(line, session.names, session.last_ms / 1000))

      :eof ->
        IO.puts("")
        session

      {:error, _reason} ->
        IO.puts("\nThis is not text in UTF-8; the replay ends here.")
        session
    end
  end

  defp answer(session, {:ok, :quit}), do: session
  defp answer(session, {:ok, :again}), do: answer(session, {:ok, session.again})
  defp answer(session, {:ok, command}), do: ask(follow(session, command))

  defp answer(session, {:error, line}) do
    IO.puts(line)
    ask(session)
  end

  defp follow(session, {:step, count} = command),
    do: moved(%{session | again: command}, &walk(&1, fn cursor -> Cursor.step(cursor, count) end))

  defp follow(session, {:goto, to_ms}), do: moved(session, &goto(&1, to_ms))
  defp follow(session, :next), do: moved(%{session | again: :next}, &next/1)

  defp follow(session, :previous),
    do: moved(%{session | again: :previous}, &previous/1)

  defp follow(session, {:show, name}) do
    show(session, nil, name || session.options.robot)
    session
  end

  defp follow(session, {:why, name}) do
    name = name || session.options.why || "leader"
    show(session, name, nil)
    %{session | options: %{session.options | why: name}}
  end

  defp follow(session, :help) do
    Enum.each(Command.help(), &IO.puts/1)
    session
  end

  # Tells what happened on the way, and where it has led.
  defp moved(before, move) do
    session = move.(%{before | differs?: false})
    Output.finish(session.output)
    # After going back, tells what happened at the tick reached.
    back? = Cursor.at_ms(session.cursor) < Cursor.at_ms(before.cursor)
    from = if back?, do: known_before(session), else: length(stages(before))
    events = stages(session) |> Enum.drop(from) |> Enum.map(&Format.stage/1)
    Enum.each(few(events), &IO.puts/1)
    Enum.each(session.cursor.here.differences, &tell_difference/1)
    %{replay: replay, end?: end?} = session.cursor.here
    IO.puts(Format.status(Kind.scene(replay)))
    if end? and not back?, do: IO.puts("The recording ends here.")
    differs? = session.differs? or Verdict.gaps?(Kind.compared(replay))
    %{session | differs?: before.differs? or differs?}
  end

  defp few(events) when length(events) <= @told, do: events

  defp few(events) do
    {skipped, last} = Enum.split(events, -@told)
    ["… #{Format.count(length(skipped), "event")} before these" | last]
  end

  defp tell_difference(difference) do
    IO.puts("This tick differs from the recording:")
    Enum.each(Difference.lines(difference), &IO.puts/1)
  end

  defp goto(session, to_ms) do
    at_ms = Cursor.at_ms(session.cursor)

    if to_ms > at_ms + @part_ms do
      part_ms = at_ms + @part_ms
      session = walk(session, &Cursor.goto(&1, part_ms))
      draw(session, to_ms)
      # A recording may have a gap, or end before its last message.
      if Cursor.at_ms(session.cursor) == part_ms,
        do: goto(session, to_ms),
        else: walk(session, &Cursor.goto(&1, to_ms))
    else
      walk(session, &Cursor.goto(&1, to_ms))
    end
  end

  defp next(session) do
    told = length(stages(session))
    started = Cursor.at_ms(session.cursor)

    over? = fn replay ->
      known(replay) > told or Kind.at_ms(replay) >= started + @part_ms
    end

    next = walk(session, &Cursor.until(&1, over?))
    draw(next, session.last_ms)

    if length(stages(next)) > told or Cursor.at_ms(next.cursor) == started,
      do: next,
      else: next(next)
  end

  # Back to the tick that made the newest event known, or the one before if this is it.
  defp previous(session) do
    known = length(stages(session))
    before = known_before(session)
    target = if before < known, do: before, else: known

    case Enum.at(stages(session), target - 1) do
      %{at_s: at_s} when target > 0 ->
        session
        |> goto(max(round(1000 * at_s) - @margin_ms, 0))
        |> walk(&Cursor.until(&1, fn replay -> known(replay) >= target end))

      _nothing_before ->
        goto(session, 0)
    end
  end

  # Differences on the way are told once, when they are passed first.
  defp walk(session, move) do
    {cursor, found} = move.(session.cursor)
    Output.finish(session.output)

    for difference <- found, difference not in cursor.here.differences do
      IO.puts("A tick on the way differs from the recording:")
      Enum.each(Difference.lines(difference), &IO.puts/1)
    end

    differs? = found != [] or cursor.here.differences != []
    %{session | cursor: cursor, differs?: session.differs? or differs?}
  end

  defp draw(%{output: %{columns: nil}}, _to_ms), do: :ok

  defp draw(session, to_ms) do
    at_s = Cursor.at_ms(session.cursor) / 1000
    line = Progress.line(at_s, to_ms / 1000, "replayed", session.output.columns - 1)
    Output.progress(session.output, line)
  end

  defp show(session, why, robot) do
    at_s = if why, do: nil, else: Cursor.at_ms(session.cursor) / 1000
    options = %{session.options | at_s: at_s, robot: robot, why: why}
    Enum.each(Moment.lines(options, session.cursor.here, session.names), &IO.puts/1)
  end

  defp known_before(%{cursor: %{here: %{before: nil}}}), do: 0
  defp known_before(%{cursor: %{here: %{before: before}}}), do: known(before)
  defp known(replay), do: length(Kind.stages(replay))
  defp stages(session), do: Kind.stages(session.cursor.here.replay)
end
