defmodule Soak.Fleet.Keeper do
  @moduledoc """
  Keeps a node of `bin/soak` running, as systemd does (`rel/convoy.service`): whoever ended it, it is started again 2 s later,
  for ever. After each end it looks for processes of the operating system that the node has left behind, by a
  mark in their environment, and ends them. What the node prints is kept for its last words.

  The owner gets `{Keeper, name, what}` with `{:up, vm, at_us}`, `{:down, last_words, at_us}`, `{:orphans, lines, at_us}`
  or `{:failed, reason, at_us}` when a start did not come about.
  """
  use GenServer
  alias Soak.Fleet.Processes
  alias Soak.Recorder

  @restart_ms 2_000
  # The kernel tells each child of the death of its parent at once; a busy machine takes its time.
  @orphan_ms 3_000

  @typedoc "`options` are those of `Vm.start_one/1`, `main` is called with the new VM."
  @type start :: %{
          name: atom(),
          mark: String.t(),
          options: Vm.options(),
          main: (Vm.t() -> :ok),
          owner: pid()
        }

  @doc "Starts the keeper, and then the node."
  @spec start_link(start()) :: GenServer.on_start()
  def start_link(start), do: GenServer.start_link(__MODULE__, start)

  @impl GenServer
  def init(start) do
    send(self(), :boot)
    {:ok, Map.merge(start, %{vm: nil, monitor: nil, words: nil, life: 0})}
  end

  @impl GenServer
  def handle_info(:boot, s) do
    s = %{s | life: s.life + 1}
    vm = Vm.start_one(options(s))
    monitor = Process.monitor(vm.peer)
    {:ok, words} = StringIO.open("")
    s = %{s | vm: vm, monitor: monitor, words: words}

    # Somebody may kill it while it starts.
    try do
      :ok = s.main.(vm)
      # Not before: Elixir wants a real device when it starts.
      Process.group_leader(vm.peer, words)
      tell(s, {:up, vm, Recorder.now()})
    catch
      :exit, reason ->
        tell(s, {:failed, reason, Recorder.now()})
        Vm.signal(vm, "KILL")
    end

    {:noreply, s}
  end

  def handle_info({:DOWN, monitor, :process, _peer, _reason}, %{monitor: monitor} = s) do
    tell(s, {:down, last_words(s.words), Recorder.now()})
    Process.send_after(self(), {:orphans, mark(s)}, @orphan_ms)
    Process.send_after(self(), :boot, @restart_ms)
    {:noreply, %{s | vm: nil, monitor: nil, words: nil}}
  end

  def handle_info({:orphans, mark}, s) do
    case Processes.marked(mark) do
      [] ->
        :ok

      left ->
        tell(s, {:orphans, for({_pid, words} <- left, do: words), Recorder.now()})
        for {pid, _words} <- left, do: Vm.signal(pid, "KILL")
    end

    {:noreply, s}
  end

  # What a node says on its way down.
  def handle_info(_other, s), do: {:noreply, s}

  # What the emulator itself says when it ends, and a dump of it, is for nobody.
  defp options(s) do
    env = [{"CONVOY_SOAK", mark(s)}, {"ERL_CRASH_DUMP_SECONDS", "0"} | s.options[:env] || []]
    quiet = ["sh", "-c", "exec \"$@\" 2>/dev/null", "sh"]
    Keyword.merge(s.options, env: env, through: quiet ++ (s.options[:through] || []))
  end

  defp last_words(device) do
    {:ok, {"", text}} = StringIO.close(device)
    line = text |> String.split("\n", trim: true) |> List.last()
    if line, do: String.slice(line, 0, 300), else: "none"
  end

  defp mark(s), do: "#{s.mark}.#{s.name}.#{s.life}"
  defp tell(s, what), do: send(s.owner, {__MODULE__, s.name, what})
end
