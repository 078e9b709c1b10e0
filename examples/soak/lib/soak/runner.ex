defmodule Soak.Runner do
  @moduledoc """
  Carries out a run of `bin/soak`: starts the nodes, does what the schedule says, reads the logs, and asks the
  judge. One process; what could block it (orders to nodes that may be frozen) is done by others.
  """
  alias Lab.Node.Network
  alias Lab.Node.Log
  alias Soak.{Deeds, Fleet, Journal, Judge, Orders, Schedule, State}
  alias Soak.Fleet.{Nodes, Processes}

  @tick_ms 200
  @up_ms 120_000
  @gone_ms 10_000

  @typedoc "`progress` is called each tick with the state; a `plan` takes the place of the seed's."
  @type options :: %{
          optional(:plan) => [Schedule.deed()],
          seed: integer(),
          duration_ms: pos_integer(),
          robots: [atom(), ...],
          namespaces?: boolean(),
          journal: Path.t(),
          progress: (State.t() -> term())
        }

  @doc "Runs it to its end, or until `{:signal, status}` comes; returns its last state, with everything taken away."
  @spec run(options()) :: State.t()
  def run(options) do
    Process.flag(:trap_exit, true)
    mark = "#{System.pid()}-#{System.unique_integer([:positive])}"
    fleet = Fleet.create(options.robots, options.seed, options.namespaces?, mark)

    plan =
      options[:plan] ||
        Schedule.new(options.seed, options.duration_ms, options.robots, options.namespaces?)

    s = %State{
      fleet: fleet,
      mark: mark,
      journal: Journal.open(options.journal),
      journal_path: options.journal,
      judge: Judge.new(options.robots),
      plan: plan,
      duration_ms: options.duration_ms,
      progress: options.progress
    }

    s = s |> start() |> loop()
    finish(s)
  end

  defp start(s) do
    _started = Lab.Node.Fleet.start(s.fleet)
    Process.send_after(self(), :tick, @tick_ms)
    s = await_up(s, Log.now() + @up_ms * 1000)
    if s.signal || s.violations != [], do: s, else: begin(s)
  end

  defp begin(s) do
    stranger =
      case Network.stranger(s.fleet.network) do
        {:ok, socket} -> socket
        {:error, _reason} -> nil
      end

    %{s | begun_us: Log.now(), stranger: stranger}
  end

  defp await_up(s, until) do
    cond do
      s.signal || s.violations != [] ->
        s

      map_size(s.vms) == length(s.fleet.robots) + 1 ->
        s

      Log.now() > until ->
        State.violation(
          s,
          "not all nodes are up within #{div(@up_ms, 1000)} s: only #{inspect(Map.keys(s.vms))}"
        )

      true ->
        await_up(heard(s), until)
    end
  end

  # What has not started cannot be judged.
  defp loop(%{begun_us: nil} = s), do: s

  defp loop(%{signal: nil} = s) do
    if State.elapsed_ms(s) < s.duration_ms, do: s |> heard() |> loop(), else: s
  end

  defp loop(s), do: s

  defp heard(s) do
    receive do
      :tick -> tick(s)
      {Vm.Fleet, name, what, us} -> Nodes.kept(s, name, what, us)
      {:orphans, name, mark} -> Nodes.orphans(s, name, mark)
      {:later, deed} -> Deeds.end_of(s, deed)
      {:said, words} -> State.write(s, words)
      {:udp, _socket, _ip, _port, datagram} -> recorded(s, datagram)
      {:signal, status} -> %{s | signal: status}
      _other -> s
    end
  end

  defp tick(s) do
    Process.send_after(self(), :tick, @tick_ms)
    {events, offsets} = Log.read(s.fleet.folder, s.fleet.robots, s.offsets)
    s = Enum.reduce(events, %{s | offsets: offsets, ticks: s.ticks + 1}, &State.note(&2, &1))
    s = if s.begun_us, do: s |> due() |> Orders.due() |> State.judge(), else: s
    s = if rem(s.ticks, 5) == 0, do: s |> collisions() |> cpu(), else: s
    s.progress.(s)
    s
  end

  defp due(%{plan: [{at_ms, deed} | rest]} = s) do
    if State.elapsed_ms(s) >= at_ms, do: due(Deeds.carry_out(%{s | plan: rest}, deed)), else: s
  end

  defp due(s), do: s

  defp collisions(s) do
    with {:ok, at_us, snapshot} <- Lab.Node.Fleet.snapshot(s.fleet),
         told = Fleet.collisions(snapshot, s.fleet.world),
         do: State.note(s, {at_us, :soak, :collisions, told}),
         else: ({:error, _none_yet} -> s)
  end

  # What a process has used when it has ended is what it had used when it was last seen.
  defp cpu(s) do
    used = for {_name, %{pid: pid}} <- s.vms, into: %{}, do: {pid, Processes.cpu_s(pid)}
    %{s | cpu: Map.merge(s.cpu, Map.put(used, System.pid(), Processes.cpu_s(System.pid())))}
  end

  defp recorded(s, datagram), do: %{s | recorded: Enum.take([datagram | s.recorded], 200)}

  # Whatever is left is told, and ended.
  defp finish(s) do
    s = cpu(s)
    Vm.Fleet.stop(s.fleet.nodes)
    left = Processes.await_gone(s.mark, @gone_ms)
    words = Enum.map_join(left, ", ", &elem(&1, 1))
    s = if left == [], do: s, else: State.violation(s, "left at the end: #{words}")
    for {pid, _words} <- left, do: Vm.signal(pid, "KILL")
    if s.stranger, do: :gen_udp.close(s.stranger)
    s = if s.violations == [], do: s, else: %{s | kept: Fleet.keep(s.fleet, s.journal_path)}
    Fleet.delete(s.fleet)
    Journal.close(s.journal)
    s
  end
end
