defmodule Swarm.Replacement.Server do
  @moduledoc """
  The process of `Swarm.Replacement`, one on a node, because its robots share their code: checks orders, carries out
  the effects of `Swarm.Replacement.Job`, and remembers what the release had. If it ends, so that nobody watches any more,
  its successor brings back the release.
  """
  use GenServer
  alias Hal.{Event, HardenedServer}
  alias Mesh.{Nonblocking, Secret}
  alias Robot.{Board, Mission, Names}
  alias Robot.Control.{Delivery, Pilot}
  alias Robot.Mission.Manual
  alias Swarm.Missions
  alias Swarm.Replacement.{Code, Job, Order}

  @tick_ms 50
  @watch_s div(Job.watch_ms(), 1_000)
  @start_ms 2_000
  # Slower wheels rest.
  @rest_linear 0.02
  @rest_turn 0.05

  @doc "Starts the process of this node."
  @spec start_link(term()) :: GenServer.on_start()
  def start_link(_options), do: HardenedServer.start_link(__MODULE__, [], name: __MODULE__)

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

  @impl GenServer
  def init([]) do
    s = %{
      secret: Secret.random(),
      kept: %{},
      loaded: %{},
      release: %{},
      jobs: %{},
      taken: %{},
      monitors: %{},
      fallen: %{},
      tick: nil
    }

    {:ok, s, {:continue, :forget}}
  end

  # A predecessor may have left missions, and code, that nobody watches any more.
  @impl GenServer
  def handle_continue(:forget, s) do
    left = for id <- Names.robots(), board = board(id), noted(board) != nil, do: {id, board}

    for {id, board} <- left do
      Pilot.halt_at_once(id, nil)
      says = "has its own mission again: #{inspect(__MODULE__)} was started again"
      put(board, %{mission: nil, changing?: false, says: says})
    end

    if left != [], do: Code.revert()
    allowed? = Enum.any?(Names.robots(), &(allowed(&1) == :ok))
    {:noreply, if(allowed?, do: %{s | kept: Code.keep()}, else: s)}
  end

  @impl GenServer
  def handle_call({:sign, bytes}, {caller, _tag}, s)
      when is_binary(bytes) and node(caller) == node(),
      do: {:reply, {:ok, own(bytes, s)}, s}

  def handle_call(_unknown, _from, s), do: HardenedServer.drop(s)

  @impl GenServer
  def handle_cast(:keep, %{kept: kept} = s) when kept == %{},
    do: {:noreply, %{s | kept: Code.keep()}}

  def handle_cast(:keep, s), do: {:noreply, s}

  def handle_cast({:take, robot, {:replace, content, mac}, {_life, at_us} = stamp, ref}, s)
      when is_atom(robot) and is_binary(content) and is_integer(at_us) and is_reference(ref) do
    {answer, s} =
      case judge(robot, content, mac, stamp, s) do
        {:ok, order} -> admit(order, put_in(s.taken[robot], at_us), at_us)
        {:error, line} -> {{:error, "#{robot}: #{line}"}, s}
      end

    Nonblocking.answer(ref, answer)
    {:noreply, s}
  end

  def handle_cast({:stood, id, robot}, s) when is_map_key(s.jobs, id),
    do: {:noreply, step(s, id, {:stood, robot})}

  def handle_cast({:started, id, robot, result}, s) when is_map_key(s.jobs, id),
    do: {:noreply, step(s, id, {:started, robot, result})}

  def handle_cast(_unknown, s), do: HardenedServer.drop(s)

  @impl GenServer
  def handle_info({:tick, tick}, %{tick: tick} = s) when tick != nil do
    turning = Enum.filter(Names.robots(), &turns?/1)
    s = Enum.reduce(s.fallen, s, &fallen/2)
    s = Enum.reduce(Map.keys(s.jobs), s, &step(&2, &1, {:tick, turning}))
    {:noreply, schedule(%{s | tick: nil})}
  end

  def handle_info({:DOWN, monitor, :process, _pid, reason}, s)
      when is_map_key(s.monitors, monitor) do
    {what, s} = pop_in(s.monitors[monitor])
    {:noreply, ended(what, reason, s)}
  end

  def handle_info(_unknown, s), do: HardenedServer.drop(s)

  defp own(bytes, s),
    do: :crypto.mac(:hmac, :sha256, Secret.subkey(s.secret, Order.label()), bytes)

  defp signature(bytes, s),
    do: if(Mesh.running?(), do: Mesh.sign(Order.label(), bytes), else: {:ok, own(bytes, s)})

  # Nothing of the content is looked at before the signature.
  defp judge(robot, content, mac, {_life, at_us} = stamp, s) do
    with :ok <- allowed(robot),
         :ok <- small(content),
         {:ok, right} <- signature(Order.signed_bytes(robot, stamp, content), s),
         {:signed, true} <- {:signed, Order.same?(right, mac)},
         {:new, true} <- {:new, at_us > Map.get(s.taken, robot, at_us - 1)},
         {:ok, order} <- Order.decode(content),
         true <- Atom.to_string(robot) in order.to do
      {:ok, order}
    else
      {:signed, false} -> {:error, "this order is not signed by its fleet's key"}
      {:new, false} -> {:error, "this order was given before; repeat it"}
      {:error, line} -> {:error, line}
      _no_order_for_it -> {:error, "this order is malformed"}
    end
  end

  defp allowed(robot) do
    case release(board(robot)) do
      %{replace: true} ->
        :ok

      _off ->
        {:error, "its mission cannot be replaced: its file does not say replace: true"}
    end
  end

  defp small(content) do
    if byte_size(content) <= Order.most_bytes(),
      do: :ok,
      else: {:error, "this order is larger than #{div(Order.most_bytes(), 1024)} kB"}
  end

  # The same order to the next robot of this node.
  defp admit(%{id: id}, s, _at_us) when is_map_key(s.jobs, id), do: {:ok, s}

  defp admit(order, s, at_us) do
    robots = for id <- Names.robots(), Atom.to_string(id) in order.to, do: id

    with :ok <- each(robots, &free(&1, s)),
         {:ok, module, modules, earlier} <- Code.check(order, s.loaded, s.kept),
         :ok <- alone(modules, robots, s) do
      {:ok, begin(order, robots, {module, modules, earlier}, at_us, s)}
    else
      {:error, line} -> {{:error, line}, s}
    end
  end

  defp each(robots, check) do
    Enum.find_value(robots, :ok, fn id ->
      with {:error, line} <- check.(id), do: {:error, "#{id}: #{line}"}
    end)
  end

  defp free(id, s) do
    cond do
      match?({:error, _line}, allowed(id)) ->
        allowed(id)

      Board.latched?(board(id)) ->
        {:error, "it is held by the emergency stop; reset it first"}

      Enum.any?(s.jobs, fn {_id, job} -> is_map_key(job.job.robots, id) end) ->
        {:error, "what it was given last is watched for #{@watch_s} s first"}

      true ->
        :ok
    end
  end

  # Code is the node's: who runs it now, and is not meant, would go on with a state that the new code does not know.
  defp alone(modules, robots, s) do
    names = for {module, _beam} <- modules, do: module
    busy = Enum.find(s.jobs, fn {_id, job} -> Enum.any?(job.modules, &(elem(&1, 0) in names)) end)

    others =
      for id <- Names.robots() -- robots, {module, _} <- [running(board(id))], do: {id, module}

    other = Enum.find(others, fn {_id, module} -> module in names end)

    cond do
      busy ->
        {:error, "the same code was given to others, and is watched for #{@watch_s} s first"}

      other ->
        {:error,
         "#{elem(other, 0)} runs #{inspect(elem(other, 1))} on this node, too, and they share its code: give it to both"}

      true ->
        :ok
    end
  end

  defp begin(order, robots, {module, modules, earlier}, at_us, s) do
    s = Enum.reduce(robots, s, &watch/2)
    on = Map.new(robots, &{&1, running(board(&1))})
    before = Map.new(robots, &{&1, noted(board(&1))})
    {job, effects} = Job.new(on, {module, []}, now())

    entry = %{
      job: job,
      order: order,
      modules: modules,
      earlier: earlier,
      before: before,
      at_us: at_us
    }

    schedule(carry_out(effects, order.id, put_in(s.jobs[order.id], entry)))
  end

  defp step(s, id, event) do
    case s.jobs do
      %{^id => entry} ->
        {job, effects} = Job.step(entry.job, event, now())
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

    forsaken(%{s | jobs: Map.delete(s.jobs, id), monitors: Map.new(monitors)})
  end

  defp carry_out(effects, id, s), do: Enum.reduce(effects, s, &effect(&1, id, s.jobs[id], &2))

  defp effect({:stand, robot}, id, _entry, s) do
    Pilot.halt_at_once(robot, {__MODULE__, :stood, [id, robot]})
    s
  end

  defp effect(:load, id, %{modules: modules, earlier: earlier}, s) do
    result = Code.load(modules)

    s =
      if result == :ok,
        do: %{
          s
          | loaded: Map.merge(s.loaded, Map.new(modules)),
            release: Map.merge(Map.new(earlier), s.release)
        },
        else: s

    step(s, id, {:loaded, result})
  end

  defp effect(:restore, _id, %{earlier: earlier}, s), do: restore(earlier, s)

  defp effect(:try, id, %{order: order, job: %{mission: {module, _}} = job}, s) do
    robots = Map.keys(job.robots)
    # It is foreign code, which may do anything but return.
    {pid, monitor} = spawn_monitor(fn -> exit({:tried, try_out(module, order, robots)}) end)
    put_in(s.monitors[monitor], {:try, id, pid})
  end

  defp effect({:start, robot, {module, options}}, id, entry, s) do
    s = monitor(s, Names.whereis(robot, :pilot), {:pilot, id, robot})

    Pilot.deliver(robot, :start, %Delivery{
      ways: [{:start, module, options}],
      asked: entry.at_us,
      until_ms: now() + @start_ms,
      reply: {__MODULE__, :started, [id, robot]}
    })

    s
  end

  defp effect({:note, what, why}, _id, entry, s) do
    for robot <- Map.keys(entry.job.robots), board = board(robot) do
      note(what, why, robot, board, entry)
    end

    s
  end

  defp note(what, why, robot, board, entry) do
    mission =
      if what in [:replaced, :kept],
        do: entry.job.mission,
        else: with(%{mission: mission} <- entry.before[robot], do: mission)

    says = says(what, why, entry)
    put(board, %{mission: mission, changing?: what == :changing, says: says})
    code = Order.digest(entry.order)
    about = %{robot: robot, stage: :replacement, what: what, from: entry.order.from, code: code}
    Event.execute([:robot, :stage], %{at_ms: Board.now(board)}, Map.put(about, :says, says))
  end

  defp put(board, replaced),
    do: Board.put(board, :replacement, :replaced, replaced, Board.now(board))

  defp says(what, why, %{order: order, job: %{mission: {module, _options}}}) do
    code = if digest = Order.digest(order), do: " (code #{digest})", else: ""
    mission = Missions.name(module) <> code

    case what do
      :changing -> "is given #{mission} by #{order.from}"
      :replaced -> "was given #{mission} by #{order.from}"
      :kept -> "keeps #{mission}, given by #{order.from}"
      :back -> "went back from #{mission}, given by #{order.from}: #{why}"
    end
  end

  defp try_out(module, order, robots) do
    with {:ok, options} <- options(order),
         {:ok, options} <- Mission.check_options(module, options, length(robots)) do
      for robot <- robots do
        {phase, _mission, effects} = module.init(robot, options)
        true = is_atom(phase) and is_list(effects)
      end

      {:ok, options}
    end
  end

  defp options(order) do
    with :error <- Order.options(order),
         do: {:error, "its options have names that its code does not know"}
  end

  defp ended({:try, id, _pid}, {:tried, result}, s), do: step(s, id, {:tried, result})

  defp ended({:try, id, _pid}, reason, s),
    do: step(s, id, {:tried, {:error, "its init fails: #{brief(reason)}"}})

  defp ended({:pilot, id, robot}, reason, s), do: put_in(s.fallen[robot], {id, brief(reason)})

  defp ended({:robot, robot}, _reason, s) do
    s = Enum.reduce(Map.keys(s.jobs), s, &step(&2, &1, {:gone, robot}))
    forsaken(%{s | taken: Map.delete(s.taken, robot)})
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

  # A robot that starts again has the mission of its release, and its code once no other uses what came in its place.
  defp forsaken(%{jobs: jobs} = s) when jobs == %{} do
    used? = fn id ->
      board = board(id)
      noted = with %{mission: mission} <- noted(board), do: mission
      Enum.any?([noted, running(board)], &(&1 != nil and is_map_key(s.release, elem(&1, 0))))
    end

    if Enum.any?(Names.robots(), used?), do: s, else: restore(Map.to_list(s.release), s)
  end

  defp forsaken(s), do: s

  defp restore(earlier, s) do
    Code.restore(earlier)
    back = for {module, beam} <- earlier, s.release[module] == beam, do: module
    now = for {module, beam} <- earlier, is_binary(beam), module not in back, do: {module, beam}

    %{
      s
      | loaded: s.loaded |> Map.drop(Keyword.keys(earlier)) |> Map.merge(Map.new(now)),
        release: Map.drop(s.release, back)
    }
  end

  defp watch(id, s) do
    if {:robot, id} in Map.values(s.monitors),
      do: s,
      else: monitor(s, Names.whereis(id, :robot), {:robot, id})
  end

  defp monitor(s, nil, _what), do: s
  defp monitor(s, pid, what), do: put_in(s.monitors[Process.monitor(pid)], what)

  # `nil` for an order that a person gave to this robot alone: that goes on.
  defp running(board) do
    case entry(board, :mission) do
      %{state: {module, _phase}, options: options} when module != Manual -> {module, options}
      _idle_or_alone -> nil
    end
  end

  defp turns?(id) do
    case entry(board(id), :odometry) do
      %{twist: %{linear: linear, turn: turn}} ->
        abs(linear) > @rest_linear or abs(turn) > @rest_turn

      _no_wheels ->
        false
    end
  end

  defp release(board), do: entry(board, :release)
  defp noted(board), do: entry(board, :replaced)

  defp board(id) do
    case Board.find(id) do
      {:ok, board} -> board
      :error -> nil
    end
  end

  defp entry(nil, _key), do: nil

  defp entry(board, key) do
    case Board.fetch(board, key, :infinity) do
      {:ok, value, _at_ms} -> value
      :error -> nil
    end
  end

  defp brief({%{__exception__: true} = error, _stack}), do: Exception.message(error)
  defp brief({reason, [_ | _]}), do: brief(reason)
  defp brief(reason), do: inspect(reason, limit: 5, printable_limit: 60)

  defp schedule(%{jobs: jobs} = s) when jobs == %{}, do: %{s | tick: nil}

  defp schedule(%{tick: nil} = s) do
    tick = make_ref()
    Process.send_after(self(), {:tick, tick}, @tick_ms)
    %{s | tick: tick}
  end

  defp schedule(s), do: s

  defp now, do: System.monotonic_time(:millisecond)
end
