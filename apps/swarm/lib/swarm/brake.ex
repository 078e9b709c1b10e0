defmodule Swarm.Brake do
  @moduledoc """
  A robot's emergency brake: a companion beside its link, of high priority, with a mailbox of its
  own. What stops the robot comes here (`:estop`, `:reset`, `:stop` and `:disarm` of people, calls of `Swarm.Alarm`)
  and goes to the gate at once, also where the link is flooded, hangs or is dead.

  It alone decides how the emergency stop stands (`Swarm.Stop`), and writes it on the board under
  `:estop`. The link asks it about what heartbeats say, and is told of each change, so that the next
  heartbeats, which follow at once, spread it.

  A stop goes to gate, executive and pilot at once, so that none that hangs holds up the others. It is
  answered by the last of them, the gate, when the mission is out of command and no older wish can follow
  (`Robot.Pilot.halt/2`); where that does not come, by nobody. Where nothing reaches the wheels, the answer says so
  (`Robot.Readiness.stopped/1`), to stop, disarm and e-stop alike.

  A reset goes the same way first: the gate is released once what the robot was at has ended, and unless
  somebody stops it again meanwhile.

  A stop is obeyed however old it is; a reset that a person gave on another node bears a stamp
  (`Swarm.Stamp`), which is asked for here.
  """
  use GenServer
  alias Hal.Device
  alias Robot.{Board, Config, Executive, Gate, Names, Pilot, Readiness}
  alias Swarm.{Alarm, Entry, Post, Stamp, Stop}

  @behaviour Robot.Companion

  # Whoever asks has half a second (`Swarm.Door.Ask`): a robot that nobody was told of stays held.
  @release_ms 400

  @impl Robot.Companion
  def child_spec({config, options}),
    do: %{id: __MODULE__, start: {__MODULE__, :start_link, [config, options]}}

  @doc "Starts the brake of a robot, as its supervisor does."
  @spec start_link(Config.t(), keyword()) :: GenServer.on_start()
  def start_link(%Config{} = config, _options) do
    GenServer.start_link(__MODULE__, config,
      name: Names.via(config.id, :brake),
      spawn_opt: [priority: :high, message_queue_data: :off_heap]
    )
  end

  @doc "A call to stop came from a node, by datagram: for all robots of this one."
  @spec hear(node(), term()) :: :ok
  def hear(_node, {:estop, call, age_ms} = term) do
    if Stop.call?(call) and Stop.age?(age_ms),
      do: Enum.each(Names.all(:brake), &GenServer.cast(&1, term))

    :ok
  end

  def hear(_node, _malformed), do: :ok

  @doc """
  What a heartbeat that the link of this robot heard says of the emergency stop; returns how the stop
  stands with it.
  """
  @spec beat(robot :: atom(), number :: non_neg_integer(), latched? :: boolean()) :: Stop.t()
  def beat(robot, number, latched?),
    do: GenServer.call(Names.via(robot, :brake), {:beat, number, latched?})

  @doc "The gate's latch may be another than this brake knows: buttons set it too."
  @spec follow(robot :: atom()) :: Stop.t()
  def follow(robot), do: GenServer.call(Names.via(robot, :brake), :follow)

  @doc "How the stop stands as the last brake wrote it down; before the first, by the gate's latch."
  @spec written(Board.t()) :: Stop.t()
  def written(board) do
    case Board.fetch(board, :estop, :infinity) do
      {:ok, stop, _at_ms} -> stop
      :error -> Stop.new(Board.latched?(board))
    end
  end

  @doc "Whether a request is for the brake; all others are for the link."
  @spec takes?(request :: term()) :: boolean()
  def takes?({:estop, _call}), do: true
  def takes?(request), do: request in [:stop, :disarm, :estop, :reset]

  @doc "Takes a request for the brake from the robot's link, which has looked how old it is."
  @spec take(robot :: atom(), request :: term(), reference()) :: :ok
  def take(robot, request, ref),
    do: GenServer.cast(Names.via(robot, :brake), {:in_time, request, ref})

  @doc """
  What the robot was at has ended, says its gate: it may be released, before that time (monotonic, ms; who asked for
  it hears nothing later), and if nobody has stopped it since it was
  in the state that `pressed` stands for.
  """
  @spec release(atom(), pressed :: reference(), until_ms :: integer(), reference()) :: :ok
  def release(robot, pressed, until_ms, ref),
    do: GenServer.cast(Names.via(robot, :brake), {:release, pressed, until_ms, ref})

  @doc "What the robot was at has ended, says its gate, which stands: answers whether its wheels do."
  @spec stood(atom(), reference()) :: :ok
  def stood(robot, ref), do: Post.answer(ref, stopped(robot, Board.find!(robot)))

  defp stopped(robot, board),
    do: with({:error, line} <- Readiness.stopped(board), do: {:error, "#{robot}: #{line}"})

  @doc "The robot is there for commands by its name, or no longer: another of that name was first."
  @spec present(robot :: atom(), boolean()) :: :ok
  def present(robot, present?),
    do: GenServer.cast(Names.via(robot, :brake), {:present, present?})

  @impl GenServer
  def init(%Config{id: id} = config) do
    board = Board.find!(id)

    s = %{
      config: config,
      id: id,
      board: board,
      stop: written(board),
      stamps: Stamp.new(System.system_time(:nanosecond)),
      brakes: nil,
      name: nil,
      pressed: make_ref(),
      reset_ms: nil
    }

    {:ok, write(s), {:continue, :enter}}
  end

  @impl GenServer
  def handle_continue(:enter, s) do
    # A stop that was written down by the brake before this one may not have reached the gate.
    if s.stop.latched? and not Board.latched?(s.board), do: :ok = Gate.estop(s.id)
    {:noreply, %{s | brakes: Entry.enter([:brakes]), name: Entry.enter([{:brake, s.id}])}}
  end

  @impl GenServer
  def handle_call({:beat, number, latched?}, _from, s)
      when is_integer(number) and number >= 0 and is_boolean(latched?) do
    s = become(s, Stop.hear(s.stop, number, latched?))
    {:reply, s.stop, s}
  end

  def handle_call(:follow, _from, s) do
    s = become(s, Stop.follow(s.stop, Board.latched?(s.board)))
    {:reply, s.stop, s}
  end

  # Brakes are found in the directory, so anything may come here from anywhere, and counts as
  # nothing.
  def handle_call(_unknown, _from, s), do: {:noreply, s}

  @impl GenServer
  def handle_cast({:estop, call, age_ms}, s), do: {:noreply, called(s, call, age_ms)}

  def handle_cast({:command, request, ref}, s) when is_reference(ref),
    do: {:noreply, command(s, request, ref, nil)}

  def handle_cast({:command, request, ref, stamp}, s) when is_reference(ref),
    do: {:noreply, command(s, request, ref, stamp)}

  def handle_cast({:in_time, request, ref}, s) when is_reference(ref),
    do: {:noreply, obey(s, request, ref)}

  # Nobody else knows this reference.
  def handle_cast({:release, pressed, until_ms, ref}, %{pressed: pressed} = s)
      when is_integer(until_ms) and is_reference(ref) do
    if now() < until_ms do
      s = released(s)
      Post.answer(ref, :ok)
      {:noreply, s}
    else
      {:noreply, s}
    end
  end

  def handle_cast({:release, pressed, _until_ms, ref}, s)
      when is_reference(pressed) and is_reference(ref) do
    Post.answer(ref, {:error, "#{s.id} was stopped again meanwhile; reset it again"})
    {:noreply, s}
  end

  def handle_cast({:stamp, ref}, s) when is_reference(ref) do
    {stamp, stamps} = Stamp.issue(s.stamps, Config.now(s.config))
    Post.answer(ref, stamp)
    {:noreply, %{s | stamps: stamps}}
  end

  def handle_cast({:present, true}, %{name: %{left?: true}} = s),
    do: {:noreply, %{s | name: Entry.enter([{:brake, s.id}])}}

  def handle_cast({:present, false}, s), do: {:noreply, %{s | name: Entry.leave(s.name)}}
  def handle_cast(_unknown, s), do: {:noreply, s}

  @impl GenServer
  def handle_info(message, s) do
    case {Entry.arrived(s.brakes, message), Entry.arrived(s.name, message)} do
      {{:ok, brakes}, :other} -> {:noreply, %{s | brakes: brakes}}
      {:other, {:ok, name}} -> {:noreply, %{s | name: name}}
      {:other, :other} -> {:noreply, s}
    end
  end

  defp command(s, request, ref, stamp) do
    case Stamp.judge(s.stamps, request, ref, stamp, Config.now(s.config)) do
      :ok ->
        obey(s, request, ref)

      {:error, age} ->
        GenServer.cast(Names.via(s.id, :link), {:rejected, :too_old})
        Post.answer(ref, Stamp.refusal(s.id, age))
        s
    end
  end

  # Nobody is waited for here: a mission that is slow to end delays no emergency stop.
  defp obey(s, :stop, ref) do
    halt(s, {__MODULE__, :stood, [s.id, ref]})
    s
  end

  # The drive first says that its wheels are disarmed.
  defp obey(s, :disarm, ref) do
    halt(s, nil)
    stopped = {Pilot, :halt, [s.id, {__MODULE__, :stood, [s.id, ref]}]}
    :ok = Device.disarm_later(Names.via(s.id, :drive), stopped)
    s
  end

  defp obey(%{stop: %{latched?: true}} = s, :reset, ref) do
    halt(s, {__MODULE__, :release, [s.id, s.pressed, now() + @release_ms, ref]})
    s
  end

  # Whoever is not held drives on.
  defp obey(s, :reset, ref) do
    s = released(s)
    Post.answer(ref, :ok)
    s
  end

  defp obey(s, request, ref) do
    {answer, s} = answer(request, s)
    Post.answer(ref, answer)
    s
  end

  defp answer(:estop, s) do
    s = become(%{s | pressed: make_ref()}, Stop.press(s.stop))
    {stopped(s.id, s.board), s}
  end

  defp answer({:estop, call}, s) do
    s = called(s, call, 0)

    if s.stop.latched?,
      do: {stopped(s.id, s.board), s},
      else: {{:error, "#{s.id} was reset meanwhile"}, s}
  end

  defp answer(other, s),
    do:
      {{:error, "#{inspect(other, limit: 5)} does not stop #{s.id}; stop, disarm and estop do"},
       s}

  defp called(s, call, age_ms) do
    with true <- Stop.call?(call) and Stop.age?(age_ms),
         stop when stop != s.stop <- Stop.call(s.stop, call) do
      if over?(s, age_ms) do
        write(%{s | stop: Stop.late(s.stop, call)})
      else
        s = become(%{s | pressed: make_ref()}, stop)
        Alarm.pass_on(call, age_ms)
        s
      end
    else
      _malformed_or_heard_before -> s
    end
  end

  defp released(s) do
    :ok = Gate.reset(s.id)
    Alarm.quiet(s.stop.calls)
    become(%{s | reset_ms: now()}, Stop.reset(s.stop))
  end

  # The gate stands at once. The goal goes also where the pilot is stuck in its mission, and again
  # when the mission is out of command: it may have set another meanwhile.
  defp halt(%{id: id}, then) do
    :ok = Gate.forget(id)
    :ok = Executive.stand(id)
    :ok = Pilot.halt(id, then)
  end

  # Made before a person reset this robot: somebody far away has only now been heard.
  defp over?(%{reset_ms: nil}, _age_ms), do: false
  defp over?(%{reset_ms: reset_ms}, age_ms), do: age_ms > now() - reset_ms

  defp now, do: System.monotonic_time(:millisecond)

  defp become(%{stop: stop} = s, stop), do: s

  # Written down before the gate is told: a brake that restarts in between knows that there is a
  # stop to carry out and to spread.
  defp become(%{stop: before} = s, stop) do
    s = write(%{s | stop: stop})
    if stop.latched? and not Board.latched?(s.board), do: :ok = Gate.estop(s.id)

    # The mission ends with it: after the reset nothing moves until somebody says so.
    if stop.latched? and not before.latched?, do: halt(s, nil)

    GenServer.cast(Names.via(s.id, :link), :stop)
    s
  end

  defp write(s) do
    Board.put(s.board, :brake, :estop, s.stop, Config.now(s.config))
    s
  end
end
