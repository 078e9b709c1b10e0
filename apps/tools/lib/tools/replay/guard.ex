defmodule Tools.Replay.Guard do
  @moduledoc false
  # Runs what reads a recording in a process of its own, within bounds of memory and of processor time. A recording may be
  # foreign: what it holds has the right form and checksums, and yet may be what no robot of ours has been told, on which
  # a replay fails, or does not end.

  # Of the process's heap.
  @most_bytes 2_000_000_000
  # From one tick or entry to the next, in reductions: some seconds of a processor, however busy the machine is. A tick of a
  # hundred robots takes 6 million.
  @most_work 250_000_000
  @look_ms 100

  @doc """
  What the function returns. What it fails with is an error of one line that names the file; a lost output, and the exit
  of a command, pass, and so does `Mcap.DamagedError`.
  """
  @spec run(Path.t(), (... -> result)) :: result | {:error, line :: String.t()}
        when result: term()
  def run(path, read) do
    passed = :atomics.new(1, [])

    heap = %{
      size: div(@most_bytes, :erlang.system_info(:wordsize)),
      kill: true,
      error_logger: false
    }

    {guard, ref} = {self(), make_ref()}

    # In it a `GenServer` may take over.
    pid =
      :proc_lib.spawn_opt(
        fn ->
          Process.put(__MODULE__, passed)
          send(guard, {ref, outcome(read)})
        end,
        max_heap_size: heap
      )

    wait(%{
      path: path,
      pid: pid,
      ref: ref,
      monitor: Process.monitor(pid),
      passed: passed,
      seen: {0, 0}
    })
  end

  defp outcome(read) do
    {:returned, read.()}
  catch
    kind, reason -> {kind, reason, __STACKTRACE__}
  end

  @doc "These ticks or entries of a recording; each that is taken begins a new measure of processor time."
  @spec watched(Enumerable.t()) :: Enumerable.t()
  def watched(ticks) do
    Stream.map(ticks, fn tick ->
      passed()
      tick
    end)
  end

  @doc "Begins a new measure: what the caller does next is no work on a tick."
  @spec passed() :: :ok
  def passed do
    with passed when passed != nil <- Process.get(__MODULE__),
         do: :atomics.add(passed, 1, 1),
         else: (nil -> :ok)
  end

  defp wait(%{monitor: monitor, pid: pid, ref: ref} = guard) do
    receive do
      {^ref, outcome} ->
        Process.demonitor(monitor, [:flush])
        result(outcome, guard.path)

      {:DOWN, ^monitor, :process, ^pid, _killed} ->
        told(guard.path, "takes too much memory")
    after
      @look_ms -> look(guard)
    end
  end

  # The work on a tick counts from the first look that finds it begun.
  defp look(%{pid: pid, seen: {tick, from}} = guard) do
    case {:atomics.get(guard.passed, 1), Process.info(pid, :reductions)} do
      {^tick, {:reductions, work}} when work - from > @most_work ->
        Process.demonitor(guard.monitor, [:flush])
        Process.exit(pid, :kill)
        told(guard.path, "takes too long")

      {^tick, _still_some_left} ->
        wait(guard)

      {passed, {:reductions, work}} ->
        wait(%{guard | seen: {passed, work}})

      {_passed, nil} ->
        wait(guard)
    end
  end

  defp result({:returned, result}, _path), do: result

  defp result({:error, reason, stack}, path)
       when reason != :terminated and not is_struct(reason, Mcap.DamagedError),
       do: told(path, "cannot be replayed (#{failure(reason, stack)})")

  defp result({:throw, _thrown, stack}, path),
    do: told(path, "cannot be replayed (#{failure(:nocatch, stack)})")

  defp result({kind, reason, stack}, _path), do: :erlang.raise(kind, reason, stack)

  defp told(path, what),
    do: {:error, "#{path} has something that this program did not record, and that #{what}"}

  # Its message would show what may be of any size.
  defp failure(reason, stack) do
    error = inspect(Exception.normalize(:error, reason, stack).__struct__)

    case stack do
      [{module, function, arity, _place} | _] when is_integer(arity) ->
        "#{error} in #{Exception.format_mfa(module, function, arity)}"

      [{module, function, arguments, _place} | _] ->
        "#{error} in #{Exception.format_mfa(module, function, length(arguments))}"

      _no_place ->
        error
    end
  end
end
