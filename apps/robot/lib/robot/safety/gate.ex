defmodule Robot.Safety.Gate do
  @moduledoc """
  Drives the wheels; no other process does. It receives wishes, and 20 times a second sends the drive what
  `Robot.Safety.Reflex` allows of the newest one. If no wish comes for 200 ms, for whatever reason, it stops the robot.

  If `Robot.Safety.Reflex` answers `:now`, for example after a touched bumper, a sonar reading or a scan
  while the robot moves, the gate does not wait for the next step.

  The gate reads the e-stop latch at its start, so that a restart does not release it. Only
  `reset/1` clears it. When the latch is set or cleared directly, the gate tells the role `:estop`, which spreads the stop.

  Where the robot's file has a `presence:`, a wish to move while no person has been heard for so long latches the gate as a
  direct stop does (`present/2`).

  While the drive is not armed (`Hal.Device.Arming`), the gate commands it only to stand, so that
  a robot starts from standing when a person arms it, and reports why it stands. In a dry run
  (`Robot.Safety.DryRun`) it also commands it only to stand, and reports what it would have
  commanded.

  A role (`Robot.Role`): the functions above the callbacks are for those that reach its process.
  """
  @behaviour Robot.Role
  alias Hal.Twist
  alias Robot.{Board, Names, Role}
  alias Robot.Safety.{DryRun, Reflex}

  @enforce_keys [:robot, :reflex, :dry_run, :presses]
  defstruct @enforce_keys ++ [told: nil, limits: nil]

  @typedoc "`presses` counts direct stops; `told` is the last line of a dry run, `limits` the last ones told."
  @type t :: %__MODULE__{
          robot: atom(),
          reflex: Reflex.t(),
          dry_run: boolean(),
          presses: non_neg_integer(),
          told: String.t() | nil,
          limits: [Reflex.limit() | :dry_run] | nil
        }

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

  @doc "A sink for the drive and the lidar: passes on the readings that the reflexes need."
  @spec sense(robot :: atom(), tuple()) :: :ok
  def sense(robot, {kind, _value} = reading)
      when kind in [:odometry, :sonar, :scan, :bumpers, :arming],
      do: GenServer.cast(Names.via(robot, :gate), {:sense, reading})

  def sense(_robot, _reading), do: :ok

  @doc "A person who looks after the robot was heard so long ago (ms)."
  @spec present(robot :: atom(), age_ms :: non_neg_integer()) :: :ok
  def present(robot, age_ms), do: GenServer.cast(Names.via(robot, :gate), {:present, age_ms})

  @doc "When a person was last heard, by the robot's clock (ms); `nil` if never."
  @spec heard(Board.t() | Board.entries()) :: integer() | nil
  def heard(board) do
    with {:ok, heard_ms, _at_ms} <- Board.fetch(board, :present, :infinity, 0),
         do: heard_ms,
         else: (:error -> nil)
  end

  @doc """
  Stops the robot until `reset/1`. When this returns, the latch is set, the stop has been sent to
  the drive's device, and the latch is in its file, or the error says which file could not be written, and why
  (`Robot.Board.saved/2`). The e-stop role is told. It uses `latch/2`, which waits for nothing; `mix calibrate` uses this.
  """
  @spec estop(robot :: atom()) :: :ok | {:error, {Path.t(), File.posix()}}
  def estop(robot), do: GenServer.call(Names.via(robot, :gate), :estop)

  @doc "Clears the e-stop: wishes count again. The person who resets must have looked where the robot would go."
  @spec reset(robot :: atom()) :: :ok
  def reset(robot), do: GenServer.call(Names.via(robot, :gate), :reset)

  @doc """
  Stops the robot until `unlatch/3`, for the e-stop role, which is not told, and does not wait: a gate that hangs delays
  nothing else. Then applies `then`, if given.
  """
  @spec latch(robot :: atom(), then :: Robot.Config.call() | nil) :: :ok
  def latch(robot, then \\ nil), do: GenServer.cast(Names.via(robot, :gate), {:latch, then})

  @doc """
  Clears the e-stop for the e-stop role, unless the gate was stopped directly since it counted `presses`
  (`presses/1`). The role is told `{:unlatched, :ok | {:error, :pressed}, about}`.
  """
  @spec unlatch(robot :: atom(), presses :: non_neg_integer(), about :: term()) :: :ok
  def unlatch(robot, presses, about),
    do: GenServer.cast(Names.via(robot, :gate), {:unlatch, presses, about})

  @doc "How often the gate was stopped directly, by `estop/1`; 0 if never."
  @spec presses(Board.t() | Board.entries()) :: non_neg_integer()
  def presses(board) do
    with {:ok, presses, _at_ms} <- Board.fetch(board, :presses, :infinity, 0),
         do: presses,
         else: (:error -> 0)
  end

  @impl Role
  def name, do: :gate

  @impl Role
  def period_ms, do: 50

  @impl Role
  def priority, do: :high

  @impl Role
  def init(%Robot.Config{} = config, board, _at_ms) do
    latched? = Board.latched?(board)
    if config.dry_run, do: DryRun.attach()

    reflex =
      Reflex.new(config.profile,
        latched?: latched?,
        armed?: armed?(board, config),
        fence: config.fence,
        start: config.start,
        frame: frame(board),
        presence: config.presence,
        present_ms: heard(board)
      )

    state = %__MODULE__{
      robot: config.id,
      reflex: reflex,
      dry_run: config.dry_run,
      presses: presses(board)
    }

    # Its first tick, at once, has no wish: it stops the wheels.
    {state, [{:event, [:robot, :gate, :start], %{latched?: latched?}}, :tick]}
  end

  @impl Role
  def handle(:tick, at_ms, s, _board), do: step(s, at_ms)

  def handle({:cast, {:wish, twist}}, at_ms, s, _board),
    do: {%{s | reflex: Reflex.wish(s.reflex, twist, at_ms)}, []}

  def handle({:cast, {:forget, then}}, at_ms, s, _board) do
    {reflex, urgency} = Reflex.forget(s.reflex)
    {s, effects} = react(%{s | reflex: reflex}, urgency, at_ms)
    {s, effects ++ applied(then)}
  end

  def handle({:cast, {:sense, {:arming, _state}}}, _at_ms, %{dry_run: true} = s, _board),
    do: {s, []}

  def handle({:cast, {:sense, reading}}, at_ms, s, _board) do
    {reflex, urgency} = Reflex.sense(s.reflex, reading, at_ms)
    noted = framed(Reflex.frame(s.reflex), Reflex.frame(reflex))
    {s, effects} = react(%{s | reflex: reflex}, urgency, at_ms)
    {s, noted ++ effects}
  end

  def handle({:cast, {:present, age_ms}}, at_ms, s, _board) when is_integer(age_ms) do
    reflex = Reflex.present(s.reflex, at_ms - max(age_ms, 0))
    {%{s | reflex: reflex}, [{:put, :present, reflex.present_ms}]}
  end

  def handle({:cast, {:latch, then}}, at_ms, s, _board) do
    {s, effects} = if Reflex.latched?(s.reflex), do: {s, []}, else: latched(s, at_ms)
    {s, effects ++ applied(then)}
  end

  def handle({:cast, {:unlatch, presses, about}}, _at_ms, s, _board) do
    if s.presses > presses do
      {s, [{:cast, :estop, {:unlatched, {:error, :pressed}, about}}]}
    else
      {s, effects} = unlatched(s)
      {s, effects ++ [{:cast, :estop, {:unlatched, :ok, about}}]}
    end
  end

  def handle({:ask, from, :estop}, at_ms, s, _board) do
    presses = s.presses + 1
    {s, effects} = latched(%{s | presses: presses}, at_ms)
    {s, [{:put, :presses, presses} | effects] ++ [{:cast, :estop, :latch}, {:answer_saved, from}]}
  end

  def handle({:ask, from, :reset}, _at_ms, s, _board) do
    {s, effects} = unlatched(s)
    {s, effects ++ [{:cast, :estop, :latch}, {:answer, from, :ok}]}
  end

  def handle(_unknown, _at_ms, _s, _board), do: :unknown

  # The latch first: whatever becomes of this role, its successor is latched.
  defp latched(s, at_ms) do
    {s, effects} = step(%{s | reflex: Reflex.estop(s.reflex)}, at_ms)
    {s, [{:latch, true} | effects] ++ [{:event, [:robot, :gate, :estop], %{}}]}
  end

  defp unlatched(s) do
    {%{s | reflex: Reflex.reset(s.reflex)},
     [{:latch, false}, {:event, [:robot, :gate, :reset], %{}}]}
  end

  defp applied(nil), do: []
  defp applied(then), do: [{:apply, then}]

  # In a dry run the drive is never armed, but the report shows what an armed robot would do.
  defp armed?(_board, %{dry_run: true}), do: true

  # Before the drive has reported its state, the config decides.
  defp armed?(board, config) do
    case Board.fetch(board, :arming, :infinity, 0) do
      {:ok, %{state: state}, _at_ms} -> state == :armed
      :error -> config.arm == :auto
    end
  end

  # After a crash, the new gate must not take another frame for the frame of its fence.
  defp framed(frame, frame), do: []
  defp framed(_before, frame), do: [{:put, :frame, frame}]

  defp frame(board) do
    with :error <- Board.fetch(board, :frame, :infinity, 0) do
      departed = Board.departed(board)
      if departed, do: {:was, departed}
    else
      {:ok, frame, _at_ms} -> frame
    end
  end

  defp react(s, :now, at_ms), do: step(s, at_ms)
  defp react(s, :later, _at_ms), do: {s, []}

  defp step(s, at_ms) do
    case Reflex.step(s.reflex, at_ms) do
      {_stands, [:absent], _reflex} -> absent(s, at_ms)
      step -> driven(s, step)
    end
  end

  # As `estop/1`, but nothing waits.
  defp absent(%{presses: presses} = s, at_ms) do
    {s, effects} = latched(%{s | presses: presses + 1}, at_ms)
    seconds = s.reflex.presence_ms / 1_000
    told = [{:cast, :estop, :latch}, {:event, [:robot, :gate, :absent], %{seconds: seconds}}]
    {s, [{:put, :presses, s.presses} | effects] ++ told}
  end

  defp driven(s, {wanted, limits, reflex}) do
    {twist, limits, rehearsed, told} = rehearse(s, wanted, limits)
    drive = [{:drive, twist, limits} | rehearsed]

    changed =
      if limits == s.limits, do: [], else: [{:event, [:robot, :gate, :limits], %{limits: limits}}]

    {%{s | reflex: reflex, told: told, limits: limits}, drive ++ changed}
  end

  defp rehearse(%{dry_run: false} = s, twist, limits), do: {twist, limits, [], s.told}

  defp rehearse(s, twist, limits) do
    {effects, told} = DryRun.tell(s.robot, {:drive, twist, limits}, s.told)
    {Twist.zero(), [:dry_run | limits], effects, told}
  end
end
