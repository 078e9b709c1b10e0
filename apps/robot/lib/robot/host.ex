defmodule Robot.Host do
  @moduledoc """
  Runs a role of a robot (`Robot.Role`) as a process: hands it what arrives, carries out its effects, and records both
  (`Robot.Trace`). It is a `GenServer`; a role that has phases is run by `Robot.Host.Phases`.
  """
  use GenServer
  alias Hal.{Device, Event, Ticker}
  alias Robot.{Board, Meters, Names, Role, Trace}
  alias Robot.Control.{Crash, Executive}
  alias Robot.Host.LoadShedder
  alias Robot.Safety.Reflex

  @slow_us 50_000
  @dropped_every_ms 60_000
  # The number of messages that are handled between two checks of the mailbox's length.
  @look_every 64

  @doc "The process of a role as a child of the robot's supervisor."
  @spec child_spec({module(), Robot.Config.t()}) :: Supervisor.child_spec()
  def child_spec({role, %Robot.Config{}} = arg),
    do: %{id: role, start: {__MODULE__, :start_link, [arg]}}

  @doc "Starts the process of a role. The robot's board must be running."
  @spec start_link({module(), Robot.Config.t()}) :: GenServer.on_start()
  def start_link({role, %Robot.Config{id: id}} = arg),
    do:
      GenServer.start_link(__MODULE__, arg,
        name: Names.via(id, role.name()),
        spawn_opt: spawned(role)
      )

  @doc "The options of a role's process, for `:erlang.spawn_opt/2`."
  @spec spawned(module()) :: keyword()
  def spawned(role), do: [priority: role.priority(), message_queue_data: :off_heap]

  @impl GenServer
  def init(arg), do: {:ok, begin(arg)}

  @doc "The state of a process with which it begins, once its first effects are carried out."
  @spec begin({module(), Robot.Config.t()}) :: map()
  def begin({role, config}) do
    board = Board.find!(config.id)
    Meters.began(board.meters, role.name())
    at_ms = Robot.Config.now(config)
    trace = if role.name() in Trace.roles(), do: config.trace
    config = %{config | trace: trace, boot: config.boot || System.system_time(:nanosecond)}
    {state, effects} = role.init(config, board, at_ms)
    period_ms = role.period_ms()
    ticker = period_ms && Robot.Config.ticker(config, :tick, period_ms)

    s = %{
      role: role,
      perceives?: function_exported?(role, :perceive, 3),
      foreign?: function_exported?(role, :foreign, 2),
      door?: function_exported?(role, :arrive, 3),
      sheds?: function_exported?(role, :expendable?, 1),
      unseen: 0,
      config: config,
      board: board,
      state: state,
      ticker: ticker,
      dropped: {0, at_ms}
    }

    Trace.begin(config, role.name(), state, at_ms)
    # Not recorded: they follow from no input.
    Enum.reduce(effects, s, &carry_out_one(&1, &2, at_ms))
  end

  @impl GenServer
  def handle_call(message, from, s), do: {:noreply, arrived({:ask, from, message}, s)}

  @impl GenServer
  def handle_cast(message, s), do: {:noreply, arrived({:cast, message}, s)}

  @impl GenServer
  def handle_info(:tick, s) do
    begun_us = System.monotonic_time(:microsecond)
    at_ms = Robot.Config.now(s.config)
    late(s)
    checkpoint(s, at_ms)

    case tick(s, at_ms) do
      :unknown ->
        {:noreply, dropped(s)}

      s ->
        slow(s, System.monotonic_time(:microsecond) - begun_us)
        {:noreply, %{s | ticker: Ticker.next(s.ticker)}}
    end
  end

  def handle_info(message, s), do: {:noreply, arrived({:info, message}, s)}

  # Of its decisions only: the gate's steps are twice as many, and wait for nothing.
  defp late(%{role: Executive, ticker: %Ticker{due_ms: due_ms}, board: board}),
    do: Meters.late(board.meters, Hal.Clock.now_ms() - due_ms)

  defp late(_s), do: :ok

  defp slow(_s, took_us) when took_us <= @slow_us, do: :ok

  defp slow(s, took_us) do
    measured = %{at_ms: Robot.Config.now(s.config), duration_ms: div(took_us, 1_000)}
    Event.execute([:robot, s.role.name(), :slow], measured, %{robot: s.config.id})
  end

  defp checkpoint(s, at_ms),
    do: Trace.checkpoint(s.config, s.role.name(), fn -> s.state end, at_ms)

  @doc "Handles what has arrived for the role; what it does not know is counted, and changes nothing."
  @spec arrived(Role.input(), map()) :: map()
  def arrived(input, s) do
    at_ms = Robot.Config.now(s.config)
    if s.ticker == nil and match?({:cast, _message}, input), do: checkpoint(s, at_ms)

    with input when input != :unknown <- whole(input, s),
         %{} = s <- hand(input, s, at_ms) do
      relieved(s)
    else
      :unknown -> dropped(s)
    end
  end

  defp dropped(%{dropped: {count, due_ms}} = s) do
    at_ms = Robot.Config.now(s.config)

    if at_ms >= due_ms do
      about = %{robot: s.config.id, role: s.role.name()}
      Event.execute([:robot, :role, :dropped], %{at_ms: at_ms, count: count + 1}, about)
      %{s | dropped: {count + 1, at_ms + @dropped_every_ms}}
    else
      %{s | dropped: {count + 1, due_ms}}
    end
  end

  defp relieved(%{sheds?: false} = s), do: s
  defp relieved(%{unseen: unseen} = s) when unseen < @look_every, do: %{s | unseen: unseen + 1}

  defp relieved(s) do
    case LoadShedder.relieve(&s.role.expendable?/1) do
      0 -> %{s | unseen: 0}
      dropped -> arrived({:cast, {:rejected, :flooded, dropped}}, %{s | unseen: 0})
    end
  end

  defp whole(input, %{door?: false}), do: input

  defp whole(input, s),
    do: s.role.arrive(input, System.monotonic_time(:microsecond), s.board)

  defp tick(s, at_ms) do
    input = if s.perceives?, do: s.role.perceive(at_ms, s.state, s.board), else: :tick
    hand(input, s, at_ms)
  end

  # Behaviours and missions may be foreign code.
  defp hand(input, s, at_ms) do
    Crash.told(s.config, s.board, s.role.name(), fn ->
      case marked(input, s, at_ms, fn -> s.role.handle(input, at_ms, s.state, s.board) end) do
        :unknown -> :unknown
        handled -> handled(input, handled, s, at_ms)
      end
    end)
  end

  # Each call has another mark. That of one that fails is left to its successor.
  defp marked(input, s, at_ms, call) do
    module = if s.foreign?, do: s.role.foreign(input, s.state)

    if module == nil do
      call.()
    else
      act({:put, :asking, {module, System.unique_integer()}}, s, at_ms)
      handled = call.()
      act({:delete, :asking}, s, at_ms)
      handled
    end
  end

  # What was refused, by what the board said then, has changed nothing and is not recorded.
  defp handled(input, {state, effects}, s, at_ms) do
    if state !== s.state or Enum.any?(effects, &Role.recorded?/1),
      do: Trace.input(s.config, s.role.name(), Role.recorded(input), at_ms)

    carry_out(effects, %{s | state: state}, at_ms)
  end

  defp carry_out(effects, s, at_ms) do
    Enum.reduce(effects, s, fn effect, s ->
      if Role.recorded?(effect),
        do: Trace.effect(s.config, s.role.name(), Role.recorded(effect), at_ms)

      carry_out_one(effect, s, at_ms)
    end)
  end

  defp carry_out_one(:tick, s, at_ms), do: tick(s, at_ms)

  defp carry_out_one(effect, s, at_ms) do
    act(effect, s, at_ms)
    s
  end

  defp act({:drive, twist, limits}, s, at_ms) do
    Device.drive(Names.via(s.config.id, :drive), twist)
    act({:put, :driving, %{twist: twist, limits: limits}}, s, at_ms)
  end

  defp act({:look, pan}, s, _at_ms), do: Device.look(Names.via(s.config.id, :ptz), pan * 1.0, 0.0)

  defp act({:put, key, value}, s, at_ms),
    do: Board.put(s.board, s.role.name(), key, value, at_ms)

  defp act({:delete, key}, s, _at_ms), do: Board.delete(s.board, s.role.name(), key)
  defp act({:depart, frame}, s, _at_ms), do: Board.depart(s.board, frame)

  defp act({:latch, true}, s, _at_ms), do: Board.latch(s.board)
  defp act({:latch, false}, s, _at_ms), do: Board.unlatch(s.board)

  defp act({:cast, role, message}, s, _at_ms),
    do: GenServer.cast(Names.via(s.config.id, role), message)

  defp act({:answer, from, result}, _s, _at_ms), do: GenServer.reply(from, result)

  # The caller may wait for a disk; the role does not.
  defp act({:answer_saved, from}, s, _at_ms),
    do: Board.saved(s.board, {GenServer, :reply, [from]})

  defp act({:apply, then}, s, at_ms), do: act({:apply, then, []}, s, at_ms)
  defp act({:apply, nil, _more}, _s, _at_ms), do: :ok
  defp act({:apply, {:cast, _role, _message} = cast, []}, s, at_ms), do: act(cast, s, at_ms)

  defp act({:apply, {:cast, role, message}, [result]}, s, at_ms),
    do: act({:cast, role, {:result, message, result}}, s, at_ms)

  defp act({:apply, {m, f, a}, more}, _s, _at_ms), do: apply(m, f, a ++ more)
  defp act({:reply, nil, _answer}, _s, _at_ms), do: :ok

  # It may be an alias of a node that is gone, for which nothing waits.
  defp act({:reply, ref, answer}, _s, _at_ms),
    do: :erlang.send(ref, {ref, answer}, [:nosuspend, :noconnect])

  defp act({:after, ms, message}, _s, _at_ms),
    do: Process.send_after(self(), {:"$gen_cast", message}, ms)

  defp act({:disarm, then}, s, _at_ms),
    do: Device.disarm_later(Names.via(s.config.id, :drive), then)

  defp act({:send, to, message}, s, at_ms),
    do: act({:cast, :comms, {:say, to, message}}, s, at_ms)

  defp act({:transmit, to, message}, s, _at_ms),
    do: with({m, f, a} <- s.config.transport, do: apply(m, f, a ++ [s.config.id, to, message]))

  defp act({:stage, stage, about}, s, at_ms),
    do: act({:event, [:robot, :stage], Map.put(about, :stage, stage)}, s, at_ms)

  defp act({:phase, state}, s, at_ms),
    do: act({:event, [:robot, :pilot, :phase], %{state: state}}, s, at_ms)

  defp act({:claim, _claim}, _s, _at_ms), do: :ok

  defp act({:event, [:robot, :gate, :limits] = name, %{limits: limits} = about}, s, at_ms) do
    for limit <- limits, limit in Reflex.stops(), do: Meters.stopped(s.board.meters, limit)
    told(name, about, s, at_ms)
  end

  defp act({:event, name, about}, s, at_ms), do: told(name, about, s, at_ms)

  defp told(name, about, s, at_ms),
    do: Event.execute(name, %{at_ms: at_ms}, Map.put(about, :robot, s.config.id))
end
