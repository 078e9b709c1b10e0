defmodule Robot.Safety.Gate do
  @moduledoc """
  The only one who drives the wheels. Wishes come in, and 20 times a second what `Robot.Safety.Reflex`
  makes of the last one goes out; it waits for nobody. No wish for 200 ms, for whatever reason,
  and it stops the robot.

  Where `Robot.Safety.Reflex` says `:now`, as of a touched bumper or a sonar while the robot moves, the gate does
  not wait for the next step.

  The e-stop latch is read at the start, so that a gate that restarts is as latched as it was.
  Only `reset/1`, a person's doing, clears it. Whenever the latch was set or cleared, by whomever, the gate applies the
  config's `:on_latch`, so that whoever spreads the stop need not look for it; not where that one did it itself
  (`tell: false`).

  While the drive is not armed (`Hal.Device.Arming`) the gate asks it for nothing but to stand, so that a
  robot that a person arms begins from standing, and says why it stands. In a dry run
  (`Robot.Safety.DryRun`) it asks for nothing else either, and tells what it would have asked for.
  """
  use GenServer
  alias Hal.{Device, Event, Ticker, Twist}
  alias Robot.{Board, Config, Names}
  alias Robot.Control.Trace
  alias Robot.Safety.{DryRun, Reflex}

  @period_ms 50

  @doc "Starts the gate of a robot; the wheels are told to stop before anything else."
  @spec start_link(Config.t()) :: GenServer.on_start()
  def start_link(%Config{} = config),
    do: GenServer.start_link(__MODULE__, config, name: Names.via(config.id, :gate))

  @doc "Wishes a speed; the newest wish counts, for 200 ms."
  @spec wish(robot :: atom(), Twist.t()) :: :ok
  def wish(robot, twist), do: GenServer.cast(Names.via(robot, :gate), {:wish, twist})

  @doc """
  What was wished so far counts no more, and the robot stops at once: a stop was ordered, or the one who
  wished has fallen, and the one who takes its place says so. Then `then` is applied, if there is one: whoever
  waits for the stop hears of it from the gate.
  """
  @spec forget(robot :: atom(), then :: Config.call() | nil) :: :ok
  def forget(robot, then \\ nil),
    do: GenServer.cast(Names.via(robot, :gate), {:forget, then})

  @doc "A sink for the drive: what reflexes need goes to the gate at once."
  @spec sense(robot :: atom(), tuple()) :: :ok
  def sense(robot, {kind, _value} = reading) when kind in [:odometry, :sonar, :bumpers, :arming],
    do: GenServer.cast(Names.via(robot, :gate), {:sense, reading})

  def sense(_robot, _reading), do: :ok

  @doc """
  Stops the robot until `reset/1`. When this returns, the latch is set and the stop sent. Whoever owns the state of the
  e-stop, and sets the latch by it, does so with `tell: false`: the config's `:on_latch` is not applied then.
  """
  @spec estop(robot :: atom(), tell: boolean()) :: :ok
  def estop(robot, options \\ []),
    do: GenServer.call(Names.via(robot, :gate), {:estop, Keyword.get(options, :tell, true)})

  @doc """
  Clears the e-stop: wishes count again. Whoever resets has looked where the robot would go. `:tell` as above. With
  `presses:` the reset is meant for stops up to that press of the button (`:presses` on the board), and is refused if
  there was another one.
  """
  @spec reset(robot :: atom(), tell: boolean(), presses: non_neg_integer()) ::
          :ok | {:error, :pressed}
  def reset(robot, options \\ []) do
    {tell?, presses} = {Keyword.get(options, :tell, true), options[:presses]}
    GenServer.call(Names.via(robot, :gate), {:reset, tell?, presses})
  end

  @doc "How often the gate's own button was pressed, which is what `estop/1` tells; 0 before the first time."
  @spec presses(Board.t()) :: non_neg_integer()
  def presses(board) do
    with {:ok, presses, _at_ms} <- Board.fetch(board, :presses, :infinity),
         do: presses,
         else: (:error -> 0)
  end

  @impl GenServer
  def init(%Config{id: id} = config) do
    # A stop must not wait for those who talk; the gate itself never has much to do.
    Process.flag(:priority, :high)
    drive = Names.via(id, :drive)
    Device.drive(drive, Twist.zero())
    board = Board.find!(id)
    latched? = Board.latched?(board)
    at_ms = Config.now(config)
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
      ticker: Config.ticker(config, :step, @period_ms)
    }

    {:ok, step(s, at_ms)}
  end

  @impl GenServer
  def handle_cast({:wish, twist}, s) do
    at_ms = heard(s, {:wish, twist})
    {:noreply, %{s | reflex: Reflex.wish(s.reflex, twist, at_ms)}}
  end

  def handle_cast({:forget, then}, s) do
    at_ms = heard(s, :forget)
    {reflex, urgency} = Reflex.forget(s.reflex)
    s = react(%{s | reflex: reflex}, urgency, at_ms)
    with {m, f, a} <- then, do: apply(m, f, a)
    {:noreply, s}
  end

  def handle_cast({:sense, {:arming, _state}}, %{config: %{dry_run: true}} = s),
    do: {:noreply, s}

  def handle_cast({:sense, reading}, s) do
    at_ms = heard(s, {:sense, reading})
    {reflex, urgency} = Reflex.sense(s.reflex, reading, at_ms)
    {:noreply, s |> frame(reflex, at_ms) |> react(urgency, at_ms)}
  end

  @impl GenServer
  def handle_call({:estop, tell?}, _from, s) do
    at_ms = heard(s, :estop)
    # The wheels first: the latch has a file, too, and a disk may take its time.
    Board.hold(s.board)
    if tell?, do: Board.put(s.board, :gate, :presses, presses(s.board) + 1, at_ms)
    s = step(%{s | reflex: Reflex.estop(s.reflex)}, at_ms)
    if tell?, do: tell_latch(s)
    Board.latch(s.board)
    Event.execute([:robot, :gate, :estop], %{at_ms: at_ms}, %{robot: s.config.id})
    {:reply, :ok, s}
  end

  def handle_call({:reset, tell?, presses}, _from, s) do
    if presses != nil and presses(s.board) > presses,
      do: {:reply, {:error, :pressed}, s},
      else: {:reply, :ok, cleared(s, tell?)}
  end

  defp cleared(s, tell?) do
    at_ms = heard(s, :reset)
    Board.unlatch(s.board)
    if tell?, do: tell_latch(s)
    Event.execute([:robot, :gate, :reset], %{at_ms: at_ms}, %{robot: s.config.id})
    %{s | reflex: Reflex.reset(s.reflex)}
  end

  @impl GenServer
  def handle_info(:step, s), do: {:noreply, s |> step(Config.now(s.config)) |> schedule()}
  def handle_info(_other, s), do: {:noreply, s}

  # In a dry run no drive is armed, and what would be driven if it were is the question.
  defp armed?(_board, %{dry_run: true}), do: true

  # Before the drive has said anything: as it comes up.
  defp armed?(board, config) do
    case Board.fetch(board, :arming, :infinity) do
      {:ok, %{state: state}, _at_ms} -> state == :armed
      :error -> config.arm == :auto
    end
  end

  # A gate that falls must not take another frame for the one that its fence is laid in.
  defp frame(s, reflex, at_ms) do
    frame = Reflex.frame(reflex)
    if frame != Reflex.frame(s.reflex), do: Board.put(s.board, :gate, :frame, frame, at_ms)
    %{s | reflex: reflex}
  end

  defp frame(board) do
    case Board.fetch(board, :frame, :infinity) do
      {:ok, frame, _at_ms} -> frame
      :error -> nil
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
    at_ms = Config.now(s.config)
    Trace.input(s.config, :gate, what, at_ms)
    at_ms
  end
end
