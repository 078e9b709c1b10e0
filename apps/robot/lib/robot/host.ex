defmodule Robot.Host do
  @moduledoc """
  Runs a role of a robot (`Robot.Role`) as a process: hands it what arrives, carries out its effects, and records both
  (`Robot.Trace`).
  """
  use Hal.HardenedServer
  alias Hal.{Device, Event, HardenedServer, Ticker}
  alias Robot.{Board, Names, Trace}
  alias Robot.Control.Crash

  @slow_us 50_000

  @doc "The process of a role as a child of the robot's supervisor."
  @spec child_spec({module(), Robot.Config.t()}) :: Supervisor.child_spec()
  def child_spec({role, %Robot.Config{}} = arg),
    do: %{id: role, start: {__MODULE__, :start_link, [arg]}}

  @doc "Starts the process of a role. The robot's board must be running."
  @spec start_link({module(), Robot.Config.t()}) :: GenServer.on_start()
  def start_link({role, %Robot.Config{id: id}} = arg) do
    options = [name: Names.via(id, role.name()), spawn_opt: [priority: role.priority()]]
    HardenedServer.start_link(__MODULE__, arg, options)
  end

  @impl GenServer
  def init({role, config}) do
    board = Board.find!(config.id)
    at_ms = Robot.Config.now(config)
    {state, effects} = role.init(config, board, at_ms)
    ticker = Robot.Config.ticker(config, :tick, role.period_ms())

    s = %{
      role: role,
      perceives?: function_exported?(role, :perceive, 3),
      config: config,
      board: board,
      state: state,
      ticker: ticker
    }

    Trace.begin(config, role.name(), state, at_ms)
    # Not recorded: they follow from no input.
    {:ok, Enum.reduce(effects, s, &carry_out_one(&1, &2, at_ms))}
  end

  @impl GenServer
  def handle_call(message, from, s), do: arrived({:ask, from, message}, s)

  @impl GenServer
  def handle_cast(message, s), do: arrived({:cast, message}, s)

  @impl GenServer
  def handle_info(:tick, s) do
    begun_us = System.monotonic_time(:microsecond)
    at_ms = Robot.Config.now(s.config)
    Trace.checkpoint(s.config, s.role.name(), fn -> s.state end, at_ms)
    s = tick(s, at_ms)
    took_us = System.monotonic_time(:microsecond) - begun_us

    if took_us > @slow_us do
      measured = %{at_ms: Robot.Config.now(s.config), duration_ms: div(took_us, 1_000)}
      Event.execute([:robot, s.role.name(), :slow], measured, %{robot: s.config.id})
    end

    {:noreply, %{s | ticker: Ticker.next(s.ticker)}}
  end

  defp arrived(input, s) do
    at_ms = Robot.Config.now(s.config)

    case s.role.handle(input, at_ms, s.state, s.board) do
      :unknown -> HardenedServer.drop(s)
      handled -> {:noreply, handled(input, handled, s, at_ms)}
    end
  end

  # Behaviours may be foreign code.
  defp tick(s, at_ms) do
    input = if s.perceives?, do: s.role.perceive(at_ms, s.state, s.board), else: :tick

    Crash.told(s.config, s.board, s.role.name(), fn ->
      handled(input, s.role.handle(input, at_ms, s.state, s.board), s, at_ms)
    end)
  end

  # What was refused, by what the board said then, has changed nothing and is not recorded.
  defp handled(input, {state, effects}, s, at_ms) do
    if state !== s.state or Enum.any?(effects, &Trace.effect?/1),
      do: Trace.input(s.config, s.role.name(), recorded(input), at_ms)

    carry_out(effects, %{s | state: state}, at_ms)
  end

  defp recorded({:ask, _from, message}), do: {:ask, nil, message}
  defp recorded(input), do: input

  defp carry_out(effects, s, at_ms) do
    Enum.reduce(effects, s, fn effect, s ->
      if Trace.effect?(effect), do: Trace.effect(s.config, s.role.name(), effect, at_ms)
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

  # Whoever asked may wait for a disk; the role does not.
  defp act({:answer_saved, from}, s, _at_ms),
    do: Board.saved(s.board, {GenServer, :reply, [from]})

  defp act({:apply, {m, f, a}}, _s, _at_ms), do: apply(m, f, a)

  defp act({:event, name, about}, s, at_ms),
    do: Event.execute(name, %{at_ms: at_ms}, Map.put(about, :robot, s.config.id))
end
