defmodule Bench.Soak.Runner do
  @moduledoc """
  Carries out a run of `bin/soak`: starts the nodes, does what the schedule says, reads the logs, and asks the
  judge. One process; what could block it (orders to nodes that may be frozen) is done by others.
  """
  alias Bench.Soak.{
    Deeds,
    Fleet,
    Journal,
    Judge,
    Logs,
    Network,
    Processes,
    Recorder,
    Schedule,
    WorldHost
  }

  alias Bench.Soak.Keeper

  @tick_ms 200
  @up_ms 120_000
  @again_ms 2_000
  @gone_ms 10_000
  # Who has used so many restarts within 5 s gives up, and is started again from outside.
  @given_up_us 10_000_000

  @enforce_keys [:fleet, :journal, :judge, :plan, :duration_ms, :mark, :progress]
  defstruct @enforce_keys ++
              [
                begun_us: nil,
                offsets: %{},
                vms: %{},
                frozen: MapSet.new(),
                ended: %{},
                processes: %{},
                stranger: nil,
                recorded: [],
                counts: %{},
                violations: [],
                recent: [],
                formation: :line,
                start_until_us: 0,
                start_next_us: 0,
                reset?: false,
                gave_up: 0,
                restarts: 0,
                cpu: %{},
                signal: nil,
                ticks: 0
              ]

  @type t :: %__MODULE__{}
  @typedoc "`progress` is called each tick with the state; a `plan` takes the place of the seed's."
  @type options :: %{
          optional(:plan) => [Schedule.deed()],
          seed: integer(),
          duration_ms: pos_integer(),
          robots: [atom(), ...],
          namespaces?: boolean(),
          journal: Path.t(),
          progress: (t() -> term())
        }

  @doc "Runs it to its end, or until `{:signal, status}` comes; returns its last state, with everything taken away."
  @spec run(options()) :: t()
  def run(options) do
    Process.flag(:trap_exit, true)
    mark = "#{System.pid()}-#{System.unique_integer([:positive])}"
    fleet = Fleet.create(options.robots, options.seed, options.namespaces?, mark)

    plan =
      options[:plan] ||
        Schedule.new(options.seed, options.duration_ms, options.robots, options.namespaces?)

    s = %__MODULE__{
      fleet: fleet,
      mark: mark,
      journal: Journal.open(options.journal),
      judge: Judge.new(options.robots),
      plan: plan,
      duration_ms: options.duration_ms,
      progress: options.progress
    }

    s = s |> start() |> loop()
    finish(s)
  end

  defp start(s) do
    :ok = Fleet.start(s.fleet)
    Process.send_after(self(), :tick, @tick_ms)
    s = await_up(s, Recorder.now() + @up_ms * 1000)
    if s.signal || s.violations != [], do: s, else: begin(s)
  end

  defp begin(s) do
    stranger =
      case Network.stranger(s.fleet.network) do
        {:ok, socket} -> socket
        {:error, _reason} -> nil
      end

    %{s | begun_us: Recorder.now(), stranger: stranger}
  end

  defp await_up(s, until) do
    cond do
      s.signal || s.violations != [] ->
        s

      map_size(s.vms) == length(s.fleet.robots) + 1 ->
        s

      Recorder.now() > until ->
        violation(
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
    if elapsed_ms(s) < s.duration_ms, do: s |> heard() |> loop(), else: s
  end

  defp loop(s), do: s

  @doc "How long it has run, in milliseconds."
  @spec elapsed_ms(t()) :: non_neg_integer()
  def elapsed_ms(%{begun_us: nil}), do: 0
  def elapsed_ms(s), do: div(Recorder.now() - s.begun_us, 1000)

  defp heard(s) do
    receive do
      :tick -> tick(s)
      {Keeper, name, what} -> kept(s, name, what)
      {:later, deed} -> Deeds.end_of(s, deed)
      {:said, words} -> write(s, words)
      {:udp, _socket, _ip, _port, datagram} -> recorded(s, datagram)
      {:signal, status} -> %{s | signal: status}
      _other -> s
    end
  end

  defp tick(s) do
    Process.send_after(self(), :tick, @tick_ms)
    {events, offsets} = Logs.read(s.fleet.folder, s.fleet.robots, s.offsets)
    s = Enum.reduce(events, %{s | offsets: offsets, ticks: s.ticks + 1}, &note(&2, &1))
    s = if s.begun_us, do: s |> due() |> order() |> judge(), else: s
    s = if rem(s.ticks, 5) == 0, do: s |> collisions() |> cpu(), else: s
    s.progress.(s)
    s
  end

  defp due(%{plan: [{at_ms, deed} | rest]} = s) do
    if elapsed_ms(s) >= at_ms, do: due(Deeds.carry_out(%{s | plan: rest}, deed)), else: s
  end

  defp due(s), do: s

  # Robots whose mission was ended by what was done to them are started again, as a person would do it.
  defp order(%{start_until_us: until, start_next_us: next} = s) do
    now = Recorder.now()

    cond do
      now < next ->
        s

      s.reset? and Enum.any?(s.judge.stops.held, &match?({_robot, true}, &1)) ->
        Deeds.order(again(s, now), {:reset, []})

      now > until or s.judge.stops.order != nil ->
        s

      true ->
        start_idle(again(s, now))
    end
  end

  defp again(s, now), do: %{s | start_next_us: now + @again_ms * 1000}

  defp start_idle(s) do
    case for robot <- s.fleet.robots, idle?(s.judge.claims[robot]), s.vms[robot], do: robot do
      [] -> s
      idle -> Deeds.order(s, {:start, [[robots: idle, formation: s.formation]]})
    end
  end

  defp idle?(%{phase: phase}), do: phase == :idle
  defp idle?(_none), do: true

  defp judge(s) do
    {lines, judge} = Judge.judge(s.judge, Recorder.now())
    Enum.reduce(lines, %{s | judge: judge}, &violation(&2, &1))
  end

  @doc "Takes an event of the run itself, or of a robot."
  @spec note(t(), Judge.event()) :: t()
  def note(s, event) do
    {lines, judge} = Judge.note(s.judge, event)
    Enum.reduce(lines, %{s | judge: judge}, &violation(&2, &1))
  end

  @doc "Writes a line into the journal."
  @spec write(t(), String.t()) :: t()
  def write(s, words) do
    :ok = Journal.write(s.journal, elapsed_ms(s), words)
    %{s | recent: Enum.take([{elapsed_ms(s), words} | s.recent], 12)}
  end

  defp violation(s, line) do
    s = %{s | violations: s.violations ++ [{elapsed_ms(s), line, s.recent}]}
    write(s, "VIOLATION: " <> line)
  end

  defp collisions(s) do
    with {:ok, at_us, snapshot} <- WorldHost.read(s.fleet.folder),
         do: note(s, {at_us, :soak, :collisions, WorldHost.collisions(snapshot, s.fleet.world)}),
         else: ({:error, _none_yet} -> s)
  end

  # What a process has used when it has ended is what it had used when it was last seen.
  defp cpu(s) do
    used = for {_name, %{pid: pid}} <- s.vms, into: %{}, do: {pid, Processes.cpu_s(pid)}
    %{s | cpu: Map.merge(s.cpu, Map.put(used, System.pid(), Processes.cpu_s(System.pid())))}
  end

  defp kept(s, :world, {:up, vm, us}),
    do: s |> there(:world, vm) |> note({us, :soak, :world, :up})

  defp kept(s, :world, {:down, _words, us}),
    do: s |> gone(:world) |> note({us, :soak, :world, :down})

  defp kept(s, name, {:up, vm, us}), do: s |> there(name, vm) |> note({us, :soak, :up, name})

  defp kept(s, name, {:down, words, us}) do
    s = s |> gone(name) |> note({us, :soak, :down, name})
    killed? = is_map_key(s.ended, name)
    broken? = us - Map.get(s.processes, name, 0) < @given_up_us
    s = %{s | ended: Map.delete(s.ended, name), restarts: s.restarts + 1}

    cond do
      killed? ->
        s

      broken? ->
        write(
          %{s | gave_up: s.gave_up + 1},
          "#{name} has given up, past its restart budget: its node has ended (#{words})"
        )

      true ->
        violation(s, "the node of #{name} has ended by itself; its last words: #{words}")
    end
  end

  defp kept(s, name, {:orphans, lines, us}), do: note(s, {us, :soak, :orphans, {name, lines}})

  defp kept(s, name, {:failed, reason, _us}) do
    s = %{s | ended: Map.put(s.ended, name, :failed)}
    violation(s, "#{name} has not started: #{inspect(reason, limit: 10, printable_limit: 200)}")
  end

  defp there(s, name, vm),
    do: write(%{s | vms: Map.put(s.vms, name, vm)}, "#{name} is up, pid #{vm.pid}")

  defp gone(s, name),
    do:
      write(
        %{s | vms: Map.delete(s.vms, name), frozen: MapSet.delete(s.frozen, name)},
        "#{name} is down"
      )

  defp recorded(s, datagram), do: %{s | recorded: Enum.take([datagram | s.recorded], 200)}

  # Whatever is left is told, and ended.
  defp finish(s) do
    s = cpu(s)
    Fleet.stop(s.fleet)
    left = await_gone(s.mark, Recorder.now() + @gone_ms * 1000)

    s =
      if left == [],
        do: s,
        else: violation(s, "left at the end: #{Enum.map_join(left, ", ", &elem(&1, 1))}")

    for {pid, _words} <- left, do: Vm.signal(pid, "KILL")
    if s.stranger, do: :gen_udp.close(s.stranger)
    Fleet.delete(s.fleet)
    Journal.close(s.journal)
    s
  end

  defp await_gone(mark, until) do
    case Processes.marked(mark) do
      [] ->
        []

      left ->
        if Recorder.now() > until do
          left
        else
          receive do
          after
            100 -> await_gone(mark, until)
          end
        end
    end
  end
end
