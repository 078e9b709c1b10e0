defmodule Record.Recorder do
  @moduledoc """
  Records robots of processes into an MCAP file, or into the numbered files of a folder within a
  limit (`Mcap.FileWriter`): each second what their processes told and did, so that `Record.Replay`
  can say whether they would do so again (`Record.Recording`), and what other tools show
  (`Record.Recording.Topics`).

      {:ok, recorder} = Record.Recorder.start_link(robots: [:mag1], file: [path: "run.mcap"])
      config = %{config | trace: {Record.Recorder, :trace, [:mag1]}}
      :ok = Record.Recorder.close(recorder)

  Nothing that goes wrong here concerns a robot: its processes send to this one without waiting,
  and only so much (`Record.Recorder.Queue`); what is too much is lost, counted and recorded as lost.
  Without this process, nothing is sent. If the file cannot be written, or the disk does not answer for a second, the events
  `[:robot, :recorder, :failed]` and `[:robot, :recorder, :healed]` say so; a folder is tried again
  every 10 s, and a disk that hangs is given up after 30 s. A crash is up to its supervisor; the next recorder begins a new file.

  Each file begins with a checkpoint of each role, and has one each minute.
  """
  use GenServer
  alias Hal.Event
  alias Robot.Names
  alias Record.Recorder.{Output, Pictures, Queue}

  @roles Queue.roles()
  @write_ms 1_000
  @again_ms 10_000
  @hangs_ms 1_000
  @given_up_ms 30_000
  @checkpoint_ms 60_000
  # What comes in faster is written sooner.
  @most_entries 5_000
  @call_ms 60_000

  @doc """
  Starts it. Options: `robots` (ids), `file` (options of `Mcap.FileWriter`), `pictures` of their
  cameras a second (`nil`: none); for tests `bound`, of
  the entries under way, `again_ms`, until a folder is tried again, and `given_up_ms`, until a disk that hangs is given up. It starts even if the file cannot be made (`status/1`).
  """
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options), do: GenServer.start_link(__MODULE__, Map.new(options))

  @doc "The child spec of the recorder of one robot, from its id and the checked options of its file's `record:`."
  @spec child_spec({robot :: atom(), keyword()} | keyword()) :: Supervisor.child_spec()
  def child_spec({robot, options}) when is_atom(robot) do
    file = [path: options[:folder], limit_bytes: options[:limit_mb] * 1_048_576]
    child_spec(robots: [robot], file: file, pictures: options[:pictures])
  end

  def child_spec(options),
    do: %{id: __MODULE__, start: {__MODULE__, :start_link, [options]}, shutdown: @call_ms}

  @doc "Sends an entry of a robot's trace to its recorder and to what keeps its last minute, if there are. Never waits."
  @spec trace(robot :: atom(), Robot.Trace.entry()) :: :ok
  def trace(robot, entry) do
    for part <- [:recorder, :incidents],
        {recorder, %Queue{} = queue} <- [Names.lookup(robot, part)],
        do: Queue.send_entry(queue, recorder, robot, entry)

    :ok
  end

  @doc """
  Which file it writes, and why none (`failed`, one line); how many entries it has written, and
  how many were lost.
  """
  @spec status(GenServer.server()) :: %{
          file: Path.t() | nil,
          failed: String.t() | nil,
          entries: non_neg_integer(),
          lost: non_neg_integer()
        }
  def status(recorder), do: GenServer.call(recorder, :status, @call_ms)

  @doc "Writes what it has, and ends the file and this process; the error is one line."
  @spec close(GenServer.server()) :: :ok | {:error, line :: String.t()}
  def close(recorder) do
    result = GenServer.call(recorder, :close, @call_ms)
    :ok = GenServer.stop(recorder)
    result
  end

  @impl GenServer
  def init(%{robots: ids, file: file} = options) do
    # To end the file in order.
    Process.flag(:trap_exit, true)
    queues = Map.new(ids, &{&1, Queue.new(Map.get(options, :bound, 2_000))})
    now_ms = Hal.Clock.now_ms()

    s = %{
      ids: ids,
      again_ms: Map.get(options, :again_ms, @again_ms),
      given_up_ms: Map.get(options, :given_up_ms, @given_up_ms),
      file: file,
      queues: queues,
      robots: Map.new(ids, &{&1, %{offset_ms: nil, profile: nil}}),
      rate: Map.get(options, :pictures),
      pictures: nil,
      shots: [],
      output: nil,
      failed: nil,
      entries: [],
      sent: 0,
      owed: [],
      count: 0,
      slow: nil,
      written: 0,
      lost: 0,
      # The machine's clock may be set; times in a file must not go back.
      unix_ms: System.os_time(:millisecond) - now_ms,
      asked_ms: now_ms,
      tried_ms: now_ms,
      # Until the writer must have answered what it was asked.
      timer: nil
    }

    case Enum.find_value(queues, :ok, &registered/1) do
      :ok ->
        # A disk that hangs must not delay the start.
        send(self(), :open)
        if s.rate, do: send(self(), :look)
        {:ok, later(s)}

      {:error, {:already_registered, pid}} ->
        {:stop, {:already_started, pid}}
    end
  end

  defp registered({id, queue}) do
    with :ok <- Names.register(id, :recorder, queue), do: nil
  end

  @impl GenServer
  def handle_call(:status, _from, s) do
    file = if s.output, do: s.output.file

    lost =
      s.lost + (s.queues |> Enum.map(fn {_id, queue} -> Queue.untold(queue) end) |> Enum.sum())

    {:reply, %{file: file, failed: s.failed || s.slow, entries: s.written, lost: lost}, s}
  end

  def handle_call(:close, _from, s) do
    s = s |> arrived() |> missed() |> settled() |> write() |> settled()
    {:reply, closed(s), %{s | output: nil, failed: s.failed || "is closed"}}
  end

  @impl GenServer
  def handle_info({:entry, id, {role, _kind, _what, at_ms} = entry, now_ms}, s)
      when is_map_key(s.queues, id) and role in @roles and is_integer(at_ms) and
             is_integer(now_ms) do
    s = take(s, id, entry, now_ms)
    {:noreply, if(s.count >= @most_entries, do: write(s), else: s)}
  end

  def handle_info(:open, s), do: {:noreply, open(s)}

  def handle_info(:look, s) do
    {:ok, pictures} = Pictures.start_link(s.ids, s.rate)
    {:noreply, %{s | pictures: pictures}}
  end

  # There are at most five a second of each robot, and no process waits for the disk.
  def handle_info({:picture, id, picture}, %{pictures: pictures} = s)
      when pictures != nil and is_map_key(s.robots, id) do
    Pictures.taken(pictures, id)
    {:noreply, if(s.slow, do: s, else: %{s | shots: [{id, picture} | s.shots]})}
  end

  def handle_info(:write, s),
    do: {:noreply, s |> write() |> minute() |> again() |> later()}

  def handle_info({:timeout, timer, :hangs}, %{timer: timer} = s) when timer != nil,
    do: {:noreply, hangs(s)}

  def handle_info({:EXIT, writer, reason}, %{output: %Output{writer: writer}} = s),
    do: {:noreply, fail(s, of_file(s, "its writer has ended: #{inspect(reason)}"))}

  def handle_info({:EXIT, pictures, _reason}, %{pictures: pictures} = s) when pictures != nil do
    _ = Process.send_after(self(), :look, @again_ms)
    {:noreply, %{s | pictures: nil}}
  end

  def handle_info({:EXIT, _other, _reason}, s), do: {:noreply, s}

  def handle_info(message, %{output: %Output{} = output} = s) do
    case Output.heard(output, message) do
      nil -> {:noreply, s}
      news -> {:noreply, s |> answered() |> news(news)}
    end
  end

  def handle_info(_late, s), do: {:noreply, s}

  @impl GenServer
  def terminate(_reason, s) do
    _ = s |> arrived() |> missed() |> settled() |> write() |> settled() |> closed()
    :ok
  end

  defp later(s) do
    _ = Process.send_after(self(), :write, @write_ms)
    s
  end

  # What was sent before this process was told to end.
  defp arrived(s) do
    receive do
      {:entry, id, {role, _kind, _what, at_ms} = entry, now_ms}
      when is_map_key(s.queues, id) and role in @roles and is_integer(at_ms) and
             is_integer(now_ms) ->
        arrived(take(s, id, entry, now_ms))
    after
      0 -> s
    end
  end

  # What was lost last has no entry after it that could tell it.
  defp missed(s) do
    for {id, queue} <- Enum.sort_by(s.queues, &elem(&1, 0)),
        {role, lost} <- Queue.take_untold(queue),
        reduce: s do
      s ->
        offset_ms = s.robots[id].offset_ms || s.unix_ms

        take(
          s,
          id,
          {role, :lost, lost, Hal.Clock.now_ms() + s.unix_ms - offset_ms},
          Hal.Clock.now_ms()
        )
    end
  end

  defp take(s, id, {_role, :lost, count, _at_ms} = entry, _now_ms),
    do: add(%{s | lost: s.lost + count}, id, entry)

  defp take(s, id, {_role, kind, %_{} = state, at_ms} = entry, now_ms)
       when kind in [:begin, :checkpoint] do
    robots = Output.know(s.robots, id, state, now_ms + s.unix_ms - at_ms)
    add(%{s | robots: robots}, id, entry)
  end

  defp take(s, id, entry, _now_ms), do: add(s, id, entry)

  # Entries that cannot be written are not worth waiting with.
  defp add(%{output: nil, failed: failed} = s, id, entry) when failed != nil,
    do: taken(s, [{id, entry}])

  # While a disk hangs, what comes counts as under way until it is written: only so much is kept.
  defp add(%{slow: nil} = s, id, entry), do: s |> taken([{id, entry}]) |> keep(id, entry)
  defp add(s, id, entry), do: keep(%{s | owed: [{id, entry} | s.owed]}, id, entry)

  defp keep(s, id, entry), do: %{s | entries: [{id, entry} | s.entries], count: s.count + 1}

  defp taken(s, entries) do
    for {id, {role, _kind, _what, _at_ms}} <- entries, do: Queue.taken(s.queues[id], role)
    s
  end

  defp open(s), do: asked(%{s | output: Output.open(s.file, s.ids, s.rate != nil)}, @hangs_ms)

  defp asked(s, ms), do: %{s | timer: :erlang.start_timer(ms, self(), :hangs)}

  defp answered(s) do
    if s.timer, do: :erlang.cancel_timer(s.timer)
    %{s | timer: nil}
  end

  defp news(s, {:open, output}) do
    Enum.each(s.queues, fn {_id, queue} -> Queue.ask(queue) end)
    if s.failed || s.slow, do: tell(s, :healed, %{file: output.file})
    %{taken(s, s.owed) | output: output, failed: nil, slow: nil, owed: []}
  end

  defp news(s, {:written, output, turned?}) do
    if s.slow, do: tell(s, :healed, %{file: output.file})
    s = taken(s, s.owed)
    s = %{s | output: output, slow: nil, owed: [], written: s.written + s.sent, sent: 0}
    if turned?, do: ask(s), else: s
  end

  defp news(s, {:error, line}), do: fail(s, line)

  # For the end of a file.
  defp settled(%{output: %Output{question: question} = output} = s) when question != nil,
    do: s |> answered() |> news(Output.await(output))

  defp settled(s), do: s

  defp hangs(%{slow: nil} = s) do
    line = of_file(s, "its disk does not answer")
    tell(s, :failed, %{line: line})
    asked(%{s | slow: line}, s.given_up_ms - @hangs_ms)
  end

  defp hangs(s),
    do: fail(s, of_file(s, "its disk has not answered for #{div(s.given_up_ms, 1_000)} s"))

  defp of_file(s, line), do: "#{s.file[:path]}: #{line}"

  # The first error is told, and its successors only when it was over meanwhile.
  defp fail(s, line) do
    if s.failed == nil, do: tell(s, :failed, %{line: line})
    if s.output, do: Output.abandon(s.output)
    s = s |> answered() |> taken(s.owed)

    %{
      s
      | output: nil,
        failed: s.failed || line,
        slow: nil,
        entries: [],
        sent: 0,
        owed: [],
        count: 0,
        shots: [],
        tried_ms: Hal.Clock.now_ms()
    }
  end

  defp tell(s, what, about) do
    about = Map.merge(%{robots: s.ids, robot: hd(s.ids)}, about)
    Event.execute([:robot, :recorder, what], %{at_ms: Hal.Clock.now_ms()}, about)
  end

  defp write(%{output: nil} = s), do: %{s | entries: [], count: 0, shots: []}
  # One after the other: what comes meanwhile waits, and counts as under way.
  defp write(%{output: %Output{question: question}} = s) when question != nil, do: s

  defp write(s) do
    ns = (Hal.Clock.now_ms() + s.unix_ms) * 1_000_000
    {entries, shots} = {Enum.reverse(s.entries), Enum.reverse(s.shots)}
    output = Output.write(s.output, entries, shots, s.robots, ns)
    s = %{s | output: output, sent: s.count, entries: [], count: 0, shots: []}
    asked(s, @hangs_ms)
  end

  defp closed(%{output: nil, failed: nil}), do: :ok
  defp closed(%{output: nil, failed: line}), do: {:error, line}
  defp closed(%{output: output}), do: Output.close(output)

  defp minute(s), do: if(Hal.Clock.now_ms() - s.asked_ms >= @checkpoint_ms, do: ask(s), else: s)

  defp ask(s) do
    Enum.each(s.queues, fn {_id, queue} -> Queue.ask(queue) end)
    %{s | asked_ms: Hal.Clock.now_ms()}
  end

  # Of a single file there is a part already, which is not overwritten.
  defp again(%{output: nil, failed: failed} = s) when failed != nil do
    if s.file[:limit_bytes] != nil and Hal.Clock.now_ms() - s.tried_ms >= s.again_ms,
      do: open(s),
      else: s
  end

  defp again(s), do: s
end
