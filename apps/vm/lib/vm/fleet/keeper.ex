defmodule Vm.Fleet.Keeper do
  @moduledoc false
  # Keeps one node of a fleet: starts its VM, tells of its life, and starts it again. What it prints is kept for its last
  # words.
  use GenServer

  # What a node prints is of no use later, but for its last line.
  @forget_ms 60_000

  @doc "Starts the keeper, and then the node; `table` gets its VM."
  @spec start_link(map(), :ets.table()) :: GenServer.on_start()
  def start_link(node, table), do: GenServer.start_link(__MODULE__, {node, table})

  @impl GenServer
  def init({node, table}) do
    send(self(), :boot)
    keeper = self()
    spawn(fn -> guard(keeper, node.owner) end)
    {options, node} = Map.pop!(node, :vm)
    own = %{table: table, options: options, vm: nil, monitor: nil, printed: nil}
    {:ok, Map.merge(node, Map.merge(own, %{words: "none", life: 0, answer: {:error, :not_yet}}))}
  end

  # While a node starts, its keeper hears nothing.
  defp guard(keeper, owner) do
    [kept, ended] = for pid <- [keeper, owner], do: Process.monitor(pid)

    receive do
      {:DOWN, ^ended, _, _, _} -> Process.exit(keeper, :kill)
      {:DOWN, ^kept, _, _, _} -> :ok
    end
  end

  @impl GenServer
  def handle_call(:answer, _from, s), do: {:reply, s.answer, s}

  @impl GenServer
  def handle_cast({:again, main}, s), do: {:noreply, boot(%{ended(s) | main: main || s.main})}

  defp ended(%{vm: nil} = s), do: s

  defp ended(%{monitor: monitor} = s) do
    Vm.stop(s.vm)
    down = receive do: ({:DOWN, ^monitor, _, _, _} = down -> down)
    {:noreply, s} = handle_info(down, s)
    s
  end

  @impl GenServer
  def handle_info(:boot, %{vm: nil} = s), do: {:noreply, boot(s)}
  # It was started meanwhile.
  def handle_info(:boot, s), do: {:noreply, s}

  def handle_info({:DOWN, monitor, :process, _peer, _reason}, %{monitor: monitor} = s) do
    s = heard(s)
    {:ok, _printed} = StringIO.close(s.printed)
    :ets.update_element(s.table, s.name, {3, nil})
    tell(s, {:down, s.words, s.life})
    if s.again_ms, do: Process.send_after(self(), :boot, s.again_ms)
    {:noreply, %{s | vm: nil, monitor: nil, printed: nil, words: "none"}}
  end

  def handle_info({:forget, printed}, %{printed: printed} = s) do
    Process.send_after(self(), {:forget, printed}, @forget_ms)
    {:noreply, heard(s)}
  end

  # What a node that has ended says late.
  def handle_info(_other, s), do: {:noreply, s}

  defp boot(s) do
    s = %{s | life: s.life + 1}
    # A start that fails ends those that were to help with it.
    Process.flag(:trap_exit, true)

    try do
      Vm.start_one(options(s))
    catch
      :exit, reason -> failed(s, {:no_vm, reason})
    else
      vm -> run(s, vm)
    after
      Process.flag(:trap_exit, false)
    end
  end

  defp run(s, vm) do
    :ets.insert(s.table, {s.name, self(), vm})
    {:ok, printed} = StringIO.open("")
    Process.send_after(self(), {:forget, printed}, @forget_ms)
    s = %{s | vm: vm, monitor: Process.monitor(vm.peer), printed: printed}

    # Somebody may kill it while it starts.
    try do
      answer = s.main.(vm)
      # Not before: Elixir wants a real device when it starts.
      Process.group_leader(vm.peer, printed)
      tell(s, {:up, vm, answer})
      %{s | answer: {:ok, answer}}
    catch
      :exit, reason ->
        Vm.signal(vm, "KILL")
        failed(s, reason)
    end
  end

  defp failed(s, reason) do
    tell(s, {:failed, reason})
    if s.vm == nil and s.again_ms, do: Process.send_after(self(), :boot, s.again_ms)
    %{s | answer: {:error, reason}}
  end

  # What the emulator itself says when it ends, and a dump of it, is of use to no one.
  defp options(s) do
    {env, options} = Keyword.pop(s.options, :env, [])
    {through, options} = Keyword.pop(options, :through, [])
    own = [{"VM_FLEET", "#{s.mark}.#{s.name}.#{s.life}"}, {"ERL_CRASH_DUMP_SECONDS", "0"}]
    quiet = ["sh", "-c", "exec \"$@\" 2>/dev/null", "sh"]
    options ++ [env: own ++ env, through: quiet ++ through]
  end

  defp heard(s) do
    line = s.printed |> StringIO.flush() |> String.split("\n", trim: true) |> List.last()
    if line, do: %{s | words: String.slice(line, 0, 300)}, else: s
  end

  defp tell(%{tell: nil}, _what), do: :ok
  defp tell(s, what), do: send(s.tell, {s.tag, s.name, what, :os.perf_counter(:microsecond)})
end
