defmodule Swarm.Replacement.Server do
  @moduledoc false
  # Runs the process of `Swarm.Replacement`, one on a node: checks orders, and carries out the effects of
  # `Swarm.Replacement.Job`. If it ends, so that nothing watches any more, its successor brings back the release's missions.
  use GenServer
  alias Hal.Event
  alias Mesh.{Nonblocking, Secret}
  alias Robot.{Board, Names}
  alias Robot.Control.{Delivery, Pilot}
  alias Swarm.Replacement.{Admission, Entries, Job, Order}

  @tick_ms 50
  @start_ms 2_000
  # Twice as long as an order is believed.
  @seen_ms 1_000

  @doc "Starts the process of this node."
  @spec start_link(term()) :: GenServer.on_start()
  def start_link(_options), do: GenServer.start_link(__MODULE__, [], name: __MODULE__)

  @doc """
  Signs bytes as this node's robots demand it: by the key of the fleet, or on a node without a mesh by one
  of its own, which no other node has.
  """
  @spec sign(binary()) :: {:ok, <<_::256>>} | {:error, line :: String.t()}
  def sign(bytes) do
    if Mesh.running?(),
      do: Mesh.sign(Order.label(), bytes),
      else: Nonblocking.call(__MODULE__, {:sign, bytes}, "what signs orders")
  end

  @doc "Called by the gate of a robot whose mission a job has ended."
  @spec stood(id :: binary(), robot :: atom()) :: :ok
  def stood(id, robot), do: GenServer.cast(__MODULE__, {:stood, id, robot})

  @doc "Called by pilot or executive with the outcome of a start."
  @spec started(id :: binary(), robot :: atom(), :ok | Delivery.refusal()) :: :ok
  def started(id, robot, result), do: GenServer.cast(__MODULE__, {:started, id, robot, result})

  @doc false
  @spec phase(Event.name(), map(), map(), pid()) :: term()
  def phase(_event, _measured, %{robot: robot, state: {module, _phase}}, server),
    do: send(server, {:runs, robot, module})

  def phase(_event, _measured, _idle, _server), do: :ok

  @impl GenServer
  def init([]) do
    # That of a predecessor.
    Event.detach(__MODULE__)

    s = %{
      secret: Secret.random(),
      jobs: %{},
      taken: %{},
      seen: %{},
      monitors: %{},
      fallen: %{},
      tick: nil
    }

    {:ok, s, {:continue, :forget}}
  end

  # A predecessor may have left missions that nothing watches any more.
  @impl GenServer
  def handle_continue(:forget, s) do
    for robot <- Names.robots(), Entries.noted(robot) do
      Pilot.halt_at_once(robot, nil)
      Entries.forget(robot, "#{inspect(__MODULE__)} was started again")
    end

    {:noreply, s}
  end

  @impl GenServer
  def handle_call({:sign, bytes}, {caller, _tag}, s)
      when is_binary(bytes) and node(caller) == node(),
      do: {:reply, {:ok, own(bytes, s)}, s}

  def handle_call(_unknown, _from, s), do: {:noreply, s}

  @impl GenServer
  def handle_cast({:take, robot, {:replace, content, mac}, {life, at_us} = stamp, ref}, s)
      when is_atom(robot) and is_binary(content) and (is_integer(life) or life == :asked) and
             is_integer(at_us) and is_reference(ref) do
    {answer, s} =
      case Admission.read(robot, {content, mac}, stamp, s.taken[robot], &signature(&1, s)) do
        # To another robot of this node before.
        {:ok, %{id: id}} when is_map_key(s.seen, id) -> {:ok, put_in(s.taken[robot], at_us)}
        {:ok, order} -> admit(order, put_in(s.taken[robot], at_us), at_us)
        {:error, line} -> {{:error, "#{robot}: #{line}"}, s}
      end

    Nonblocking.answer(ref, answer)
    {:noreply, s}
  end

  # Also of jobs that are over: a slow robot has no fault.
  def handle_cast({:stood, id, robot}, s), do: {:noreply, step(s, id, {:stood, robot})}

  def handle_cast({:started, id, robot, result}, s),
    do: {:noreply, step(s, id, {:started, robot, result})}

  # What a robot's comms process was asked, by any node, comes here as it is.
  def handle_cast(_unknown, s), do: {:noreply, s}

  @impl GenServer
  def handle_info({:tick, tick}, %{tick: tick} = s) when tick != nil do
    s = Enum.reduce(s.fallen, s, &fallen/2)
    s = Enum.reduce(s.jobs, s, fn {id, entry}, s -> step(s, id, {:tick, turning(entry.job)}) end)
    {:noreply, schedule(%{s | tick: nil})}
  end

  def handle_info({:runs, robot, module}, s) when is_atom(robot) do
    of = for {id, %{job: %{mission: {^module, _}}}} <- s.jobs, do: id
    {:noreply, schedule(Enum.reduce(of, s, &step(&2, &1, {:runs, robot})))}
  end

  def handle_info({:DOWN, monitor, :process, _pid, reason}, s)
      when is_map_key(s.monitors, monitor) do
    {what, s} = pop_in(s.monitors[monitor])
    {:noreply, ended(what, reason, s)}
  end

  def handle_info(_unknown, s), do: {:noreply, s}

  defp turning(%{phase: :standing, robots: robots}),
    do: robots |> Map.keys() |> Enum.filter(&Entries.turns?/1)

  defp turning(_on_its_way), do: []

  defp own(bytes, s),
    do: :crypto.mac(:hmac, :sha256, Secret.subkey(s.secret, Order.label()), bytes)

  defp signature(bytes, s),
    do: if(Mesh.running?(), do: Mesh.sign(Order.label(), bytes), else: {:ok, own(bytes, s)})

  defp admit(order, s, at_us) do
    case Admission.admit(order, Map.values(s.jobs)) do
      {:ok, robots, module} ->
        # The same order to the next robot of this node comes within half a second.
        s = put_in(s.seen, recent(s.seen, order.id))
        {:ok, begin(order, robots, module, at_us, s)}

      {:error, line} ->
        {{:error, line}, s}
    end
  end

  defp recent(seen, id) do
    now_ms = Hal.Clock.now_ms()
    seen |> Map.filter(fn {_id, at_ms} -> now_ms - at_ms < @seen_ms end) |> Map.put(id, now_ms)
  end

  defp begin(order, robots, module, at_us, s) do
    waiting =
      for {id, entry} <- s.jobs,
          not Admission.busy?(entry),
          Admission.meets?(entry, robots),
          do: id

    s = Enum.reduce(waiting, s, &finish(&2, &1))
    if s.jobs == %{}, do: listen()
    s = Enum.reduce(robots, s, &watch/2)
    on = Map.new(robots, &{&1, Entries.running(&1)})
    before = Map.new(robots, &{&1, Entries.noted(&1)})
    {job, effects} = Job.new(on, {module, []}, Hal.Clock.now_ms())

    entry = %{job: job, order: order, before: before, at_us: at_us}
    schedule(carry_out(effects, order.id, put_in(s.jobs[order.id], entry)))
  end

  defp listen,
    do: :ok = Event.attach(__MODULE__, [:robot, :pilot, :phase], &__MODULE__.phase/4, self())

  defp step(s, id, event) do
    case s.jobs do
      %{^id => entry} ->
        {job, effects} = Job.step(entry.job, event, Hal.Clock.now_ms())
        s = carry_out(effects, id, put_in(s.jobs[id].job, job))
        if job.phase == :done, do: finish(s, id), else: s

      _done ->
        s
    end
  end

  defp finish(s, id) do
    {over, monitors} = Enum.split_with(s.monitors, fn {_monitor, what} -> elem(what, 1) == id end)

    for {monitor, what} <- over do
      Process.demonitor(monitor, [:flush])
      with {:try, ^id, pid} <- what, do: Process.exit(pid, :kill)
    end

    s = %{s | jobs: Map.delete(s.jobs, id), monitors: Map.new(monitors)}
    if s.jobs == %{}, do: Event.detach(__MODULE__)
    s
  end

  defp carry_out(effects, id, s), do: Enum.reduce(effects, s, &effect(&1, id, s.jobs[id], &2))

  defp effect({:stand, robot}, id, _entry, s) do
    Pilot.halt_at_once(robot, {__MODULE__, :stood, [id, robot]})
    s
  end

  defp effect(:try, id, %{order: order, job: %{mission: {module, _}} = job}, s) do
    robots = Map.keys(job.robots)
    # It is foreign code, which may do anything but return.
    {pid, monitor} =
      spawn_monitor(fn -> exit({:tried, Admission.rehearse(module, order, robots)}) end)

    put_in(s.monitors[monitor], {:try, id, pid})
  end

  defp effect({:watch, robot}, id, _entry, s),
    do: monitor(s, Names.whereis(robot, :pilot), {:pilot, id, robot})

  defp effect({:start, robot, {module, options}}, id, entry, s) do
    s = effect({:watch, robot}, id, entry, s)

    Pilot.deliver(robot, :start, %Delivery{
      ways: [{:start, module, options}],
      asked: entry.at_us,
      # By the robot's clock; one that has gone is watched above.
      until_ms: robot_ms(robot) + @start_ms,
      reply: {__MODULE__, :started, [id, robot]}
    })

    s
  end

  defp effect({:note, what, why}, _id, %{order: order, job: job, before: before}, s) do
    for robot <- Map.keys(job.robots),
        do: Entries.note(robot, {what, why}, order, job, before[robot])

    s
  end

  defp ended({:try, id, _pid}, {:tried, result}, s), do: step(s, id, {:tried, result})

  defp ended({:try, id, _pid}, reason, s),
    do: step(s, id, {:tried, {:error, "its init fails: #{brief(reason)}"}})

  defp ended({:pilot, id, robot}, reason, s), do: put_in(s.fallen[robot], {id, brief(reason)})

  defp ended({:robot, robot}, _reason, s) do
    s = Enum.reduce(Map.keys(s.jobs), s, &step(&2, &1, {:gone, robot}))
    %{s | taken: Map.delete(s.taken, robot)}
  end

  # A pilot that is there again has crashed, or what it depends on has. One that is not may have ended with its robot.
  defp fallen({robot, {id, why}}, s) do
    cond do
      not is_map_key(s.jobs, id) or Names.whereis(robot, :robot) == nil ->
        %{s | fallen: Map.delete(s.fallen, robot)}

      Names.whereis(robot, :pilot) ->
        step(%{s | fallen: Map.delete(s.fallen, robot)}, id, {:crashed, robot, why})

      true ->
        s
    end
  end

  defp watch(id, s) do
    if {:robot, id} in Map.values(s.monitors),
      do: s,
      else: monitor(s, Names.whereis(id, :robot), {:robot, id})
  end

  defp robot_ms(robot) do
    case Board.find(robot) do
      {:ok, board} -> Board.now(board)
      :error -> 0
    end
  end

  defp monitor(s, nil, _what), do: s
  defp monitor(s, pid, what), do: put_in(s.monitors[Process.monitor(pid)], what)

  defp brief({%{__exception__: true} = error, _stack}), do: Exception.message(error)
  defp brief({reason, [_ | _]}), do: brief(reason)
  defp brief(reason), do: inspect(reason, limit: 5, printable_limit: 60)

  defp schedule(%{tick: nil} = s) do
    if Enum.any?(Map.values(s.jobs), &Admission.busy?/1) do
      tick = make_ref()
      Process.send_after(self(), {:tick, tick}, @tick_ms)
      %{s | tick: tick}
    else
      s
    end
  end

  defp schedule(s), do: s
end
