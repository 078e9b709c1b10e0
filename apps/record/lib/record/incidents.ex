defmodule Record.Incidents do
  @moduledoc """
  Keeps the last minute of robots of processes in memory, as `Record.Recorder` would write it, and writes it as a recording of its own when
  something has happened to one of them: an emergency stop, a fault, a crash, a part that hung, or a person asks (`Swarm.keep/1`).

      {:ok, _pid} = Record.Incidents.start_link(robots: [:mag1], folder: "incidents", limit_mb: 100)
      config = %{config | trace: {Record.Recorder, :trace, [:mag1]}}

  It is written two seconds after what happened, so that what the robots made of it is in it, too; what happens meanwhile goes into
  the same file. The folder has numbered files, of which the oldest are deleted (`Mcap.FileWriter`). The events
  `[:robot, :incident, :kept]` and `[:robot, :incident, :failed]` say what became of it.

  A robot's processes never wait for this one, as for a recorder. In memory a minute of a robot takes some 15 MB; of what comes
  beyond `most` entries the oldest are dropped.
  """
  use GenServer
  alias Hal.{Clock, Event}
  alias Record.Recorder.{Output, Queue}
  alias Robot.Names

  @after_ms 2_000
  @second_ms 1_000
  # States come so often, so that what is kept begins with one soon.
  @checkpoint_ms 15_000
  @most 30_000
  @roles Queue.roles()

  @events [
    [:robot, :gate, :estop],
    [:robot, :fault],
    [:robot, :stage],
    [:robot, :gate, :hung],
    [:robot, :executive, :hung],
    [:robot, :pilot, :hung]
  ]

  @doc """
  Starts it. Options: `robots` (ids), `folder`, `limit_mb`, and how long it looks back, `seconds` (60); `most` entries of a
  robot (30,000).
  """
  @spec start_link(keyword()) :: GenServer.on_start()
  def start_link(options), do: GenServer.start_link(__MODULE__, Map.new(options))

  @doc "The child spec for one robot, from its id and the checked options of its file's `incidents:`."
  @spec child_spec({robot :: atom(), keyword()} | keyword()) :: Supervisor.child_spec()
  def child_spec({robot, options}) when is_atom(robot),
    do: child_spec([{:robots, [robot]} | options])

  def child_spec(options), do: %{id: __MODULE__, start: {__MODULE__, :start_link, [options]}}

  @impl GenServer
  def init(%{robots: ids, folder: folder, limit_mb: limit_mb} = options) do
    # To detach its listeners.
    Process.flag(:trap_exit, true)
    queues = Map.new(ids, &{&1, Queue.new()})
    now_ms = Clock.now_ms()

    for {id, queue} <- queues,
        do: :ok = Names.register(id, :incidents, queue)

    for event <- @events do
      _before = Event.detach({__MODULE__, ids, event})
      :ok = Event.attach({__MODULE__, ids, event}, event, &__MODULE__.heard/4, {self(), ids})
    end

    _timer = Process.send_after(self(), :second, @second_ms)

    {:ok,
     %{
       ids: ids,
       file: [path: folder, limit_bytes: limit_mb * 1_048_576],
       keep_ms: Map.get(options, :seconds, 60) * 1_000,
       most: Map.get(options, :most, @most) * length(ids),
       queues: queues,
       robots: Map.new(ids, &{&1, %{offset_ms: nil, profile: nil}}),
       entries: :queue.new(),
       count: 0,
       # The machine's clock may be set; times in a file must not go back.
       unix_ms: System.os_time(:millisecond) - now_ms,
       asked_ms: now_ms,
       why: [],
       writer: nil
     }}
  end

  @doc false
  # In the process in which it happened.
  def heard(event, _measured, %{robot: robot} = about, {pid, ids}) do
    why = if robot in ids, do: why(event, about)
    if why, do: send(pid, {:incident, "#{robot}: #{why}"})
  end

  def heard(_event, _measured, _about, _to), do: :ok

  defp why([:robot, :gate, :estop], _about), do: "emergency stop"
  defp why([:robot, :fault], %{line: line}), do: line && "fault: #{line}"
  defp why([:robot, :stage], %{stage: :crashed, crash: crash}), do: "crashed: #{crash}"
  defp why([:robot, part, :hung], _about), do: "its #{part} hung"
  defp why(_event, _about), do: nil

  @impl GenServer
  def handle_cast({:keep, robot, ref}, s) do
    line =
      "#{robot}: what it knows of the last #{div(s.keep_ms, 1_000)} s is being written to #{s.file[:path]}"

    Mesh.Nonblocking.answer(ref, {:ok, line})
    {:noreply, because(s, "#{robot}: a person asked")}
  end

  @impl GenServer
  def handle_info({:entry, id, {role, kind, what, at_ms} = entry, now_ms}, s)
      when is_map_key(s.queues, id) and role in @roles do
    Queue.taken(s.queues[id], role)
    states? = kind in [:begin, :checkpoint] and is_struct(what)
    offset_ms = now_ms + s.unix_ms - at_ms
    robots = if states?, do: Output.know(s.robots, id, what, offset_ms), else: s.robots
    entries = :queue.in({now_ms, {id, entry}}, s.entries)
    {:noreply, bounded(%{s | entries: entries, count: s.count + 1, robots: robots})}
  end

  def handle_info({:incident, why}, s), do: {:noreply, because(s, why)}

  def handle_info(:second, s) do
    _timer = Process.send_after(self(), :second, @second_ms)
    now_ms = Clock.now_ms()
    s = forget(s, now_ms - s.keep_ms - @after_ms)
    due? = now_ms - s.asked_ms >= @checkpoint_ms
    if due?, do: Enum.each(s.queues, fn {_id, queue} -> Queue.ask(queue) end)
    {:noreply, if(due?, do: %{s | asked_ms: now_ms}, else: s)}
  end

  # One file after the other; what happens while one is written waits for the next.
  def handle_info(:write, %{writer: writer} = s) when writer != nil do
    _timer = Process.send_after(self(), :write, @after_ms)
    {:noreply, s}
  end

  def handle_info(:write, s) do
    {file, ids, robots, unix_ms} = {s.file, s.ids, s.robots, s.unix_ms}
    entries = :queue.to_list(s.entries)
    why = s.why |> Enum.reverse() |> Enum.uniq()
    write = fn -> exit({:wrote, write(file, ids, robots, entries, unix_ms)}) end
    {_pid, ref} = spawn_monitor(write)
    {:noreply, %{s | why: [], writer: {ref, why}}}
  end

  def handle_info({:DOWN, ref, :process, _pid, reason}, %{writer: {ref, why}} = s) do
    case reason do
      {:wrote, {:ok, file}} -> tell(s, :kept, %{file: file, why: why})
      {:wrote, {:error, line}} -> tell(s, :failed, %{line: line, why: why})
      crash -> tell(s, :failed, %{line: "its writer has ended: #{inspect(crash)}", why: why})
    end

    {:noreply, %{s | writer: nil}}
  end

  def handle_info(_late, s), do: {:noreply, s}

  @impl GenServer
  def terminate(_reason, s) do
    for event <- @events, do: Event.detach({__MODULE__, s.ids, event})
    :ok
  end

  defp because(%{why: []} = s, why) do
    _timer = Process.send_after(self(), :write, @after_ms)
    %{s | why: [why]}
  end

  defp because(s, why), do: %{s | why: Enum.take([why | s.why], 20)}

  defp bounded(%{count: count, most: most} = s) when count <= most, do: s
  defp bounded(s), do: %{s | entries: :queue.drop(s.entries), count: s.count - 1}

  defp forget(s, before_ms) do
    case :queue.peek(s.entries) do
      {:value, {at_ms, _entry}} when at_ms < before_ms ->
        forget(%{s | entries: :queue.drop(s.entries), count: s.count - 1}, before_ms)

      _young_or_none ->
        s
    end
  end

  defp tell(s, what, about) do
    about = Map.merge(%{robots: s.ids, robot: hd(s.ids)}, about)
    Event.execute([:robot, :incident, what], %{at_ms: Clock.now_ms()}, about)
  end

  # Second by second, as a recorder.
  defp write(file, ids, robots, entries, unix_ms) do
    seconds = Enum.chunk_by(entries, fn {at_ms, _entry} -> div(at_ms, @second_ms) end)

    with {:open, output} <- Output.await(Output.open(file, ids, false)),
         {:ok, output} <- seconds(seconds, output, robots, unix_ms),
         :ok <- Output.close(output),
         do: {:ok, output.file}
  end

  defp seconds([], output, _robots, _unix_ms), do: {:ok, output}

  defp seconds([second | rest], output, robots, unix_ms) do
    {at_ms, _entry} = List.last(second)
    entries = for {_at_ms, entry} <- second, do: entry
    output = Output.write(output, entries, [], robots, (at_ms + unix_ms) * 1_000_000)

    with {:written, output, _turned?} <- Output.await(output),
         do: seconds(rest, output, robots, unix_ms)
  end
end
