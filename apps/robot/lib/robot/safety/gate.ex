defmodule Robot.Safety.Gate do
  @moduledoc """
  Drives the wheels; no other process does. It receives wishes, and 20 times a second sends the drive what
  `Robot.Safety.Reflex` allows of the newest one. If no wish comes for 200 ms, for whatever reason, it stops the robot.

  If `Robot.Safety.Reflex` answers `:now`, for example after a touched bumper or a sonar reading
  while the robot moves, the gate does not wait for the next step.

  The gate reads the e-stop latch at its start, so that a restart does not release it. Only
  `reset/1` clears it. When the latch is set or cleared, the gate applies the config's
  `:on_latch`, so that the process that spreads the stop is notified; with `tell: false`, which
  that process itself uses, it does not.

  While the drive is not armed (`Hal.Device.Arming`), the gate commands it only to stand, so that
  a robot starts from standing when a person arms it, and reports why it stands. In a dry run
  (`Robot.Safety.DryRun`) it also commands it only to stand, and reports what it would have
  commanded.
  """
  use Hal.HardenedServer
  alias Hal.{Device, Event, HardenedServer, Ticker, Twist}
  alias Robot.{Board, Names}
  alias Robot.Trace
  alias Robot.Safety.{DryRun, Reflex}

  @period_ms 50

  @doc "Starts the gate of a robot; it first commands the wheels to stop."
  @spec start_link(Robot.Config.t()) :: GenServer.on_start()
  def start_link(%Robot.Config{} = config),
    do: HardenedServer.start_link(__MODULE__, config, name: Names.via(config.id, :gate))

  @doc "Wishes a speed; the newest wish is valid for 200 ms."
  @spec wish(robot :: atom(), Twist.t()) :: :ok
  def wish(robot, twist), do: GenServer.cast(Names.via(robot, :gate), {:wish, twist})

  @doc """
  Drops the wish and stops the robot without waiting for the next step, because a stop was ordered
  or the executive was restarted. Then applies `then`, if given, to notify the process that waits
  for the stop.
  """
  @spec forget(robot :: atom(), then :: Robot.Config.call() | nil) :: :ok
  def forget(robot, then \\ nil),
    do: GenServer.cast(Names.via(robot, :gate), {:forget, then})

  @doc "A sink for the drive: passes on the readings that the reflexes need."
  @spec sense(robot :: atom(), tuple()) :: :ok
  def sense(robot, {kind, _value} = reading) when kind in [:odometry, :sonar, :bumpers, :arming],
    do: GenServer.cast(Names.via(robot, :gate), {:sense, reading})

  def sense(_robot, _reading), do: :ok

  @doc """
  Stops the robot until `reset/1`. When this returns, the latch is set, the stop has been sent to
  the drive's device, and the latch is in its file, or the error says which file could not be written, and why
  (`Robot.Board.saved/2`). The process that owns
  the state of the e-stop sets the latch with `tell: false`: then the config's `:on_latch` is not
  applied, and this does not wait for the file. Anybody else stops the gate directly, as `mix calibrate` does.
  """
  @spec estop(robot :: atom(), tell: boolean()) :: :ok | {:error, {Path.t(), File.posix()}}
  def estop(robot, options \\ []),
    do: GenServer.call(Names.via(robot, :gate), {:estop, Keyword.get(options, :tell, true)})

  @doc """
  Clears the e-stop: wishes count again. The person who resets must have looked where the robot
  would go. `:tell` is as in `estop/2`. With `presses:` the reset applies to direct stops up to
  that one (`presses/1`), and is refused if there was another one since.
  """
  @spec reset(robot :: atom(), tell: boolean(), presses: non_neg_integer()) ::
          :ok | {:error, :pressed}
  def reset(robot, options \\ []) do
    {tell?, presses} = {Keyword.get(options, :tell, true), options[:presses]}
    GenServer.call(Names.via(robot, :gate), {:reset, tell?, presses})
  end

  @doc "How often the gate was stopped directly, by `estop/1` without `tell: false`; 0 if never."
  @spec presses(Board.t()) :: non_neg_integer()
  def presses(board) do
    with {:ok, presses, _at_ms} <- Board.fetch(board, :presses, :infinity),
         do: presses,
         else: (:error -> 0)
  end

  @impl GenServer
  def init(%Robot.Config{id: id} = config) do
    # A stop must not wait for the processes that communicate; the gate's own work is short.
    Process.flag(:priority, :high)
    drive = Names.via(id, :drive)
    Device.drive(drive, Twist.zero())
    board = Board.find!(id)
    latched? = Board.latched?(board)
    at_ms = Robot.Config.now(config)
    if config.dry_run, do: DryRun.attach()
    Event.execute([:robot, :gate, :start], %{at_ms: at_ms}, %{robot: id, latched?: latched?})

    s = %{
      config: config,
      board: board,
      drive: drive,
      reflex:
        Reflex.new(config.profile,
          latched?: latched?,
          armed?: armed?(board, config),
          fence: config.fence,
          start: config.start,
          frame: frame(board)
        ),
      told: nil,
      limits: nil,
      ticker: Robot.Config.ticker(config, :step, @period_ms)
    }

    Trace.begin(config, :gate, state(s), at_ms)
    {:ok, step(s, at_ms)}
  end

  @impl GenServer
  def handle_cast({:wish, twist}, s) do
    at_ms = heard(s, {:wish, twist})
    {:noreply, %{s | reflex: Reflex.wish(s.reflex, twist, at_ms)}}
  end

  def handle_cast({:forget, then}, s) do
    if HardenedServer.then?(then),
      do: {:noreply, forgotten(s, then)},
      else: HardenedServer.drop(s)
  end

  def handle_cast({:sense, {:arming, _state}}, %{config: %{dry_run: true}} = s),
    do: {:noreply, s}

  def handle_cast({:sense, reading}, s) do
    at_ms = heard(s, {:sense, reading})
    {reflex, urgency} = Reflex.sense(s.reflex, reading, at_ms)
    {:noreply, s |> frame(reflex, at_ms) |> react(urgency, at_ms)}
  end

  @impl GenServer
  def handle_call({:estop, tell?}, from, s) when is_boolean(tell?) do
    at_ms = heard(s, :estop)
    Board.latch(s.board)
    if tell?, do: Board.put(s.board, :gate, :presses, presses(s.board) + 1, at_ms)
    s = step(%{s | reflex: Reflex.estop(s.reflex)}, at_ms)
    if tell?, do: tell_latch(s)
    Event.execute([:robot, :gate, :estop], %{at_ms: at_ms}, %{robot: s.config.id})
    # Whoever stops it directly may wait for a disk; these steps do not.
    if tell?,
      do: Board.saved(s.board, {GenServer, :reply, [from]}),
      else: GenServer.reply(from, :ok)

    {:noreply, s}
  end

  def handle_call({:reset, tell?, presses}, _from, s)
      when is_boolean(tell?) and (presses == nil or is_integer(presses)) do
    if presses != nil and presses(s.board) > presses,
      do: {:reply, {:error, :pressed}, s},
      else: {:reply, :ok, cleared(s, tell?)}
  end

  defp forgotten(s, then) do
    at_ms = heard(s, :forget)
    {reflex, urgency} = Reflex.forget(s.reflex)
    s = react(%{s | reflex: reflex}, urgency, at_ms)
    with {m, f, a} <- then, do: apply(m, f, a)
    s
  end

  defp cleared(s, tell?) do
    at_ms = heard(s, :reset)
    Board.unlatch(s.board)
    if tell?, do: tell_latch(s)
    Event.execute([:robot, :gate, :reset], %{at_ms: at_ms}, %{robot: s.config.id})
    %{s | reflex: Reflex.reset(s.reflex)}
  end

  @impl GenServer
  def handle_info(:step, s) do
    at_ms = Robot.Config.now(s.config)
    Trace.checkpoint(s.config, :gate, fn -> state(s) end, at_ms)
    {:noreply, s |> step(at_ms) |> schedule()}
  end

  defp state(s), do: {s.reflex, %{dry_run: s.config.dry_run}}

  # In a dry run the drive is never armed, but the report shows what an armed robot would do.
  defp armed?(_board, %{dry_run: true}), do: true

  # Before the drive has reported its state, the config decides.
  defp armed?(board, config) do
    case Board.fetch(board, :arming, :infinity) do
      {:ok, %{state: state}, _at_ms} -> state == :armed
      :error -> config.arm == :auto
    end
  end

  # After a crash, the new gate must not take another frame for the frame of its fence.
  defp frame(s, reflex, at_ms) do
    frame = Reflex.frame(reflex)
    if frame != Reflex.frame(s.reflex), do: Board.put(s.board, :gate, :frame, frame, at_ms)
    %{s | reflex: reflex}
  end

  defp frame(board) do
    with :error <- Board.fetch(board, :frame, :infinity) do
      departed = Board.departed(board)
      if departed, do: {:was, departed}
    else
      {:ok, frame, _at_ms} -> frame
    end
  end

  defp react(s, :now, at_ms), do: step(s, at_ms)
  defp react(s, :later, _at_ms), do: s

  defp step(s, at_ms) do
    Trace.input(s.config, :gate, :step, at_ms)
    {wanted, limits, reflex} = Reflex.step(s.reflex, at_ms)
    {twist, limits, s} = rehearse(wanted, limits, s, at_ms)
    Device.drive(s.drive, twist)
    Board.put(s.board, :gate, :driving, %{twist: twist, limits: limits}, at_ms)
    Trace.effect(s.config, :gate, {:drive, twist, limits}, at_ms)

    if limits != s.limits do
      about = %{robot: s.config.id, limits: limits}
      Event.execute([:robot, :gate, :limits], %{at_ms: at_ms}, about)
    end

    %{s | reflex: reflex, limits: limits}
  end

  defp rehearse(twist, limits, %{config: %{dry_run: false}} = s, _at_ms), do: {twist, limits, s}

  defp rehearse(twist, limits, s, at_ms) do
    told = DryRun.tell(s.config.id, {:drive, twist, limits}, s.told, at_ms)
    {Twist.zero(), [:dry_run | limits], %{s | told: told}}
  end

  defp schedule(s), do: %{s | ticker: Ticker.next(s.ticker)}

  defp tell_latch(s), do: with({m, f, a} <- s.config.on_latch, do: apply(m, f, a))

  defp heard(s, what) do
    at_ms = Robot.Config.now(s.config)
    Trace.input(s.config, :gate, what, at_ms)
    at_ms
  end
end
