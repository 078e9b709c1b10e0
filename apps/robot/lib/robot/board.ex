defmodule Robot.Board do
  @moduledoc """
  Holds the newest readings of one robot, which any process on its node can read without a message.

  One ETS table of entries `{key, value, at_ms}`. Readers give the greatest age that they accept.
  Each key has one writer, and `put/5` raises for any other:

  | key | writer | value |
  |---|---|---|
  | `:odometry` `:sonar` `:ir` `:bumpers` `:power` | `:drive` | as in `Hal.Drive` |
  | `:brake` `:joystick` `:home` | `:drive` | as in `Hal.Drive` |
  | `:arming` | `:drive` | `%{state: state, why: line or nil}` (`Hal.Device.Arming`) |
  | `:disarmed` | `:drive` | whether a person has disarmed it |
  | `:ptz` | `:ptz` | as in `Hal.Ptz` |
  | `:scan` | `:scan` | the newest turn of its lidar (`Hal.Scan`) |
  | `:detections` | `:blob_detector` | `Vision.Detections`, at the time of its picture |
  | `{:health, device}` | the device | `:online` or `{:offline, reason}`, at the time it began |
  | `{:peer, id}` | `:comms` | as in `Robot.Percept` |
  | `:estop` | `:estop` | the state of the emergency stop (1) |
  | `:stopped` | `:estop` | when it was last stopped (2) |
  | `:followed` | `:estop` | the last of the `:presses` that it has made a stop of |
  | `:radio` | `:comms` | counts of messages sent, received, and refused as malformed |
  | `:driving` | `:gate` | `%{twist: twist, limits: [atom]}` |
  | `:present` | `:gate` | when a person was last heard (`Robot.Safety.Gate.heard/1`) |
  | `:presses` | `:gate` | how often it was stopped directly (`Robot.Safety.Gate.presses/1`) |
  | `:frame` | `:gate` | the odometry frame of the fence: `Robot.Safety.Reflex.frame/1` |
  | `:doing` | `:executive` | the chosen wish and the outcome of the goal (3) |
  | `:goal` | `:executive` | the module of its goal's behaviour, or `nil` |
  | `{:hung, part}` | `:watch` | where `:gate`, `:executive` or `:pilot` hangs (4) |
  | `:departed` | `:executive` | the odometry frame in which it has left its start pose (`Robot.Departure`) |
  | `:pose` | `:executive` | the estimate in the `map` frame |
  | `{:crashed, part}` | `:pilot`, `:executive` | why its mission, or a behaviour, crashed last (`Robot.Control.Crash`) |
  | `:asking` | `:pilot` | while a callback of the mission runs (5) |
  | `:uncertainty` | `:executive` | that of the pose: `t:Robot.Percept.uncertainty/0` |
  | `:mission` | `:pilot` | the state of the mission and its claim (6) |
  | `:release` | `:comms` | `%{mission: mission of its config, replace: whether it may be replaced, profile: its body}` |
  | `:replaced` | `:replacement` | what has been put in the place of that (7) |

    1. As its one owner publishes it: the tags of the stops that hold the robot, those that were
       cleared here, and the calls heard.
    2. By any kind of stop: `System.monotonic_time/1`, microseconds.
    3. `%{by: behaviour, weights: [{behaviour, weight}], way: [{x, y}], limits: [atom], outcome:
       {tag, integer} or nil, fault: line or nil, tick: count}`; all that wished, the corners of the
       way to its goal, and what slows it down before the gate (`Robot.Control.Controller`)
    4. `{:silent, module}`, with the behaviour or the mission in which it hangs (`nil` for the
       gate); `{:hung, module}` once it was killed for that.
    5. `{module, integer}`, with another number for each call.
    6. `%{state: :idle or {mission, phase}, claim: map, layer: what it draws, since_ms: when it came to that state,
       ticked_ms: the time of the last percept that the mission handled, options: with which it
       was started}`
    7. `%{mission: {module, options} or nil, changing?: while it is being replaced, says: line for
       people}` (`Swarm.Replacement`)

  After its end nothing is found on it, and what is written to it has no effect.

  This process owns the tables, so that they survive a crash of their writers, and writes what must survive more: the
  **e-stop latch** and `:departed`. No other part touches a disk, so one that is slow, or hangs, delays neither the gate's
  steps nor the executive's ticks. All the rest is lost with the board, on purpose.

  The latch is a table of its own, written by the gate only, so that a gate that restarts is still latched. With a file
  (real robots) it also survives a restart of the board and of the machine: the file exists while the latch is set. A
  caller that must know asks by `saved/2`. A write that failed is tried again; until then `unsaved/1` says why.
  """
  use GenServer
  alias Robot.Board.{Files, Latch}
  alias Hal.{Odometry, Pose}
  alias Robot.{Departure, Meters, Names}
  alias Vision.Detections

  @again_ms 1_000
  @peers [{{{:peer, :"$1"}, :"$2", :_}, [], [{{:"$1", :"$2"}}]}]
  @own [
    {{:"$1", :_, :_}, [{:not, {:is_tuple, :"$1"}}], [:"$_"]},
    {{{:"$1", :_}, :_, :_}, [{:"=/=", :"$1", :peer}], [:"$_"]}
  ]

  @enforce_keys [:robot, :table, :latch, :meters, :clock, :since_ms]
  defstruct @enforce_keys

  @typedoc "The tables, the meters and the clock, for readers and writers; the board started at `since_ms`."
  @type t :: %__MODULE__{
          robot: atom(),
          table: :ets.tid(),
          latch: :ets.tid(),
          meters: Meters.t(),
          clock: {module(), atom(), list()},
          since_ms: integer()
        }

  @typedoc "The same in lockstep, as a map of what was put on it."
  @type entries :: %{(key :: term()) => {value :: term(), at_ms :: integer()}}

  @type writer ::
          :drive
          | :ptz
          | :scan
          | :camera
          | :blob_detector
          | :comms
          | :replacement
          | :estop
          | :gate
          | :watch
          | :executive
          | :pilot

  @writers %{
    odometry: :drive,
    sonar: :drive,
    ir: :drive,
    bumpers: :drive,
    power: :drive,
    brake: :drive,
    joystick: :drive,
    home: :drive,
    arming: :drive,
    disarmed: :drive,
    ptz: :ptz,
    scan: :scan,
    detections: :blob_detector,
    driving: :gate,
    frame: :gate,
    present: :gate,
    presses: :gate,
    doing: :executive,
    goal: :executive,
    departed: :executive,
    pose: :executive,
    uncertainty: :executive,
    mission: :pilot,
    asking: :pilot,
    estop: :estop,
    stopped: :estop,
    followed: :estop,
    radio: :comms,
    release: :comms,
    replaced: :replacement
  }

  @doc "Starts the board of a robot."
  @spec start_link(Robot.Config.t()) :: GenServer.on_start()
  def start_link(%Robot.Config{} = config), do: GenServer.start_link(__MODULE__, config)

  @doc "The board of a robot on this node."
  @spec find(robot :: atom()) :: {:ok, t()} | :error
  def find(robot) do
    case Names.lookup(robot, :board) do
      {_pid, board} -> {:ok, board}
      nil -> :error
    end
  end

  @doc "The board of a robot that must have one, for the parts that start after it."
  @spec find!(robot :: atom()) :: t()
  def find!(robot) do
    {:ok, board} = find(robot)
    board
  end

  @doc "The time by this robot's clock, in milliseconds."
  @spec now(t()) :: integer()
  def now(%__MODULE__{clock: {m, f, a}}), do: apply(m, f, a)

  @doc "Writes an entry; raises `ArgumentError` for a key that has another writer."
  @spec put(t(), writer(), key :: term(), value :: term(), at_ms :: integer()) :: :ok
  def put(%__MODULE__{table: table}, writer, key, value, at_ms) when is_integer(at_ms) do
    unless writer(key) == writer,
      do: raise(ArgumentError, "board key #{inspect(key)} is not written by #{inspect(writer)}")

    _inserted? = unless_ended(true, fn -> :ets.insert(table, {key, value, at_ms}) end)
    :ok
  end

  @doc """
  A sink for `Hal.Device` and `Vision.BlobDetector`: writes a reading with the present time, or
  detections with the time of their picture; ignores readings that it does not know.
  """
  @spec sense(t(), writer(), reading :: tuple()) :: :ok
  def sense(board, device, {:health, device, {condition, since_ms}}),
    do: put(board, device, {:health, device}, condition, since_ms)

  def sense(board, :blob_detector, {:detections, %Detections{at_ms: at_ms} = detections}),
    do: put(board, :blob_detector, :detections, detections, at_ms)

  def sense(_board, _device, {:detections, _malformed}), do: :ok

  def sense(board, :drive, {:odometry, %Odometry{} = now} = reading) do
    with {:ok, %{frame: frame, pose: pose}, _at_ms} when frame == now.frame <-
           fetch(board, :odometry, :infinity, 0),
         do: Meters.drove(board.meters, Pose.distance(pose, now.pose))

    put_reading(board, :drive, reading)
  end

  # A user's driver may send readings that have no key here; they must not crash its device.
  def sense(board, device, {_key, _value} = reading), do: put_reading(board, device, reading)

  defp put_reading(board, device, {key, value}) do
    if writer(key), do: put(board, device, key, value, now(board)), else: :ok
  end

  @doc "Deletes an entry, for example that of a peer whose place was seen to be empty."
  @spec delete(t(), writer(), key :: term()) :: :ok
  def delete(%__MODULE__{table: table}, writer, key) do
    ^writer = writer(key)
    _deleted? = unless_ended(true, fn -> :ets.delete(table, key) end)
    :ok
  end

  @doc "The value of a key, with its time, unless it is older than `max_age_ms`."
  @spec fetch(
          t() | entries(),
          key :: term(),
          max_age_ms :: non_neg_integer() | :infinity,
          now_ms :: integer()
        ) ::
          {:ok, term(), at_ms :: integer()} | :error
  def fetch(%__MODULE__{table: table}, key, max_age_ms, now_ms) do
    # Numbers are smaller than atoms, so that nothing is older than `:infinity`.
    case unless_ended([], fn -> :ets.lookup(table, key) end) do
      [{_key, value, at_ms}] when now_ms - at_ms <= max_age_ms -> {:ok, value, at_ms}
      _none_or_old -> :error
    end
  end

  def fetch(entries, key, max_age_ms, now_ms) do
    case entries do
      %{^key => {value, at_ms}} when now_ms - at_ms <= max_age_ms -> {:ok, value, at_ms}
      _none_or_old -> :error
    end
  end

  @doc "The same with the present time."
  @spec fetch(t(), key :: term(), max_age_ms :: non_neg_integer() | :infinity) ::
          {:ok, term(), at_ms :: integer()} | :error
  def fetch(board, key, max_age_ms), do: fetch(board, key, max_age_ms, now(board))

  @doc "The condition of a device and when it began, as its process last reported, or `nil`."
  @spec health(t(), device :: atom()) :: Hal.Device.status() | nil
  def health(board, device) do
    case fetch(board, {:health, device}, :infinity) do
      {:ok, condition, since_ms} -> {condition, since_ms}
      :error -> nil
    end
  end

  @doc "The peers on the board, by their ids."
  @spec peers(t()) :: %{atom() => Robot.Percept.peer()}
  def peers(%__MODULE__{table: table}),
    do: Map.new(unless_ended([], fn -> :ets.select(table, @peers) end))

  @doc "All entries of the robot itself with their ages, for people; `peers/1` has those of others, which are many."
  @spec entries(t()) :: %{(key :: term()) => {value :: term(), age_ms :: integer()}}
  def entries(%__MODULE__{table: table} = board) do
    now_ms = now(board)
    own = unless_ended([], fn -> :ets.select(table, @own) end)
    Map.new(own, fn {key, value, at_ms} -> {key, {value, now_ms - at_ms}} end)
  end

  @doc "Whether the e-stop is latched; a robot whose board has ended is held."
  @spec latched?(t() | entries()) :: boolean()
  def latched?(%__MODULE__{latch: latch}), do: Latch.set?(latch)
  def latched?(entries), do: match?(%{latch: {true, _at_ms}}, entries)

  @doc "Latches the e-stop. This process writes the file."
  @spec latch(t()) :: :ok
  def latch(%__MODULE__{latch: latch} = board) do
    Latch.set(latch)
    cast(board, :latch)
  end

  @doc "Releases the latch. Until the file can be removed, the next start is latched again."
  @spec unlatch(t()) :: :ok
  def unlatch(%__MODULE__{latch: latch} = board) do
    Latch.clear(latch)
    cast(board, :latch)
  end

  @doc "Applies `then` to `:ok`, if the file of the latch says what that does, or to `{:error, fault}` (`unsaved/1`)."
  @spec saved(t(), then :: Robot.Config.call()) :: :ok
  def saved(%__MODULE__{} = board, {_m, _f, _a} = then), do: cast(board, {:saved, then})

  @doc "Whether it does already: for a caller that has waited long enough for `saved/2`."
  @spec saved?(t()) :: boolean()
  def saved?(%__MODULE__{latch: latch}), do: Latch.saved?(latch)

  @doc "The file of the latch that could not be written or removed, and why; `nil` if the last attempt succeeded."
  @spec unsaved(t() | entries()) :: Files.fault() | nil
  def unsaved(%__MODULE__{latch: latch}), do: Latch.unsaved(latch)
  def unsaved(_without_a_file), do: nil

  @doc "Notes, for after a restart, that the robot has left its start pose; a failure is tried again each second."
  @spec depart(t(), Departure.frame()) :: :ok
  def depart(%__MODULE__{} = board, frame) do
    put(board, :executive, :departed, frame, now(board))
    cast(board, :depart)
  end

  @doc "The frame in which the robot has left its start pose; `nil` if it has not."
  @spec departed(t() | entries()) :: Departure.frame() | nil
  def departed(board) do
    with {:ok, frame, _at_ms} <- fetch(board, :departed, :infinity, 0),
         do: frame,
         else: (:error -> nil)
  end

  defp cast(%__MODULE__{robot: robot}, message),
    do: GenServer.cast(Names.via(robot, :board), message)

  @impl GenServer
  def init(%Robot.Config{} = config) do
    # So that it writes what it has been told to write before it ends.
    Process.flag(:trap_exit, true)

    {files, latched?, frame} = Files.read(config)

    board = %__MODULE__{
      robot: config.id,
      table: :ets.new(__MODULE__, [:public, read_concurrency: true]),
      latch: Latch.new(latched?),
      meters: Meters.new(),
      clock: config.clock,
      since_ms: Robot.Config.now(config)
    }

    if frame, do: put(board, :executive, :departed, frame, board.since_ms)

    case Names.register(config.id, :board, board) do
      :ok -> {:ok, %{board: board, files: files, again: nil}}
      {:error, {:already_registered, pid}} -> {:stop, {:already_started, pid}}
    end
  end

  @impl GenServer
  def handle_cast(:latch, s), do: {:noreply, save(s)}

  # The latch itself decides, not the order in which the messages of several processes arrive.
  def handle_cast({:saved, {m, f, a}}, s) do
    s = if saved?(s.board), do: s, else: save(s)
    fault = unsaved(s.board)
    apply(m, f, a ++ [if(fault, do: {:error, fault}, else: :ok)])
    {:noreply, s}
  end

  def handle_cast(:depart, s), do: {:noreply, noted(s)}

  @impl GenServer
  def handle_info(:depart, s), do: {:noreply, noted(s)}
  def handle_info({:latch, ref}, %{again: {ref, _wait_ms}} = s), do: {:noreply, save(s)}
  def handle_info({:latch, _old}, s), do: {:noreply, s}

  defp save(s) do
    {files, again} = Latch.save(s.board.latch, s.files, s.again)
    %{s | files: files, again: again}
  end

  defp noted(s) do
    with frame when frame != nil <- departed(s.board),
         {:error, files} <- Files.depart(s.files, frame) do
      Process.send_after(self(), :depart, @again_ms)
      %{s | files: files}
    else
      nil -> s
      {:ok, files} -> %{s | files: files}
    end
  end

  # The tables go with the board, and a process not below it in the robot's tree may have found it a moment before.
  defp unless_ended(otherwise, of_table) do
    of_table.()
  rescue
    ArgumentError -> otherwise
  end

  defp writer({:peer, _id}), do: :comms
  defp writer({:hung, _part}), do: :watch
  defp writer({kind, part}) when kind in [:health, :crashed], do: part
  defp writer(key), do: Map.get(@writers, key)
end
