defmodule Robot.Board do
  @moduledoc """
  The newest readings of one robot, for anyone on its node to read without asking a process.

  One ETS table of entries `{key, value, at_ms}`. Readers say how old is too old. Each key has one
  writer, and `put/5` refuses any other:

  | key | writer | value |
  |---|---|---|
  | `:odometry` `:sonar` `:ir` `:bumpers` `:power` `:brake` `:joystick` `:home` | `:drive` | as in `Hal.Drive` |
  | `:arming` | `:drive` | `%{state: state, why: line or nil}` (`Hal.Device.Arming`) |
  | `:ptz` | `:ptz` | as in `Hal.Ptz` |
  | `:detections` | `:blob_detector` | `Vision.Detections`, at the time of its picture |
  | `{:health, device}` | the device | `:online` or `{:offline, reason}`, since when |
  | `{:peer, id}` | `:comms` | as in `Robot.Percept` |
  | `:estop` | `:estop` | how the emergency stop stands, as its one owner publishes it: the last number known, the last one cleared here, the calls heard |
  | `:stopped` | `:estop` | when it was stopped last, by whatever stop: `System.monotonic_time/1`, microseconds |
  | `:radio` | `:comms` | how many messages were sent, heard, and refused as malformed |
  | `:driving` | `:gate` | `%{twist: twist, limits: [atom]}` |
  | `:presses` | `:gate` | how often its own button was pressed |
  | `:frame` | `:gate` | of odometry, that the fence is laid in: `Robot.Safety.Reflex.frame/1` |
  | `:doing` | `:executive` | `%{by: behaviour, weight: w, outcome: {tag, integer} or nil, fault: line or nil, tick: count}` |
  | `:goal` | `:executive` | the module of its goal's behaviour, or `nil` |
  | `{:hung, part}` | `:watch` | of `:gate`, `:executive` or `:pilot`: `{:silent, module}` of the behaviour or the mission in which it hangs (`nil` of the gate), `{:hung, module}` once it was ended for it |
  | `:pose` | `:executive` | the estimate in the `map` frame |
  | `:asking` | `:pilot` | `{module, integer}` while a callback of the mission runs, each with another number |
  | `:uncertainty` | `:executive` | how sure that pose is: `t:Robot.Percept.uncertainty/0` |
  | `:mission` | `:pilot` | `%{state: :idle or {mission, phase}, claim: map, since_ms: when it came to that state}` |

  This process owns the tables and does nothing else, so that they outlive whoever writes them.
  Nothing outlives the board, on purpose, with one exception.

  The **e-stop latch** is a table of its own, written by the gate only, so that a gate that
  restarts is still latched. With a file (real robots) it also outlives the board and the machine:
  the file is there while the latch is set.
  """
  use GenServer
  alias Robot.{Config, Names}
  alias Vision.Detections

  @enforce_keys [:robot, :table, :latch, :clock, :file, :since_ms]
  defstruct @enforce_keys

  @typedoc "What readers and writers hold: the tables and the clock; `since_ms`, when the robot was started."
  @type t :: %__MODULE__{
          robot: atom(),
          table: :ets.tid(),
          latch: :ets.tid(),
          clock: {module(), atom(), list()},
          file: Path.t() | nil,
          since_ms: integer()
        }

  @type writer ::
          :drive
          | :ptz
          | :camera
          | :blob_detector
          | :comms
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
    ptz: :ptz,
    detections: :blob_detector,
    driving: :gate,
    frame: :gate,
    presses: :gate,
    doing: :executive,
    goal: :executive,
    pose: :executive,
    uncertainty: :executive,
    mission: :pilot,
    asking: :pilot,
    estop: :estop,
    stopped: :estop,
    radio: :comms
  }

  @doc "Starts the board of a robot."
  @spec start_link(Config.t()) :: GenServer.on_start()
  def start_link(%Config{} = config), do: GenServer.start_link(__MODULE__, config)

  @doc "The board of a robot on this node."
  @spec find(robot :: atom()) :: {:ok, t()} | :error
  def find(robot) do
    case Registry.lookup(Names, {robot, :board}) do
      [{_pid, board}] -> {:ok, board}
      [] -> :error
    end
  end

  @doc "The same for a robot that must have one: its own parts start after it."
  @spec find!(robot :: atom()) :: t()
  def find!(robot) do
    {:ok, board} = find(robot)
    board
  end

  @doc "The time by this robot's clock, in milliseconds."
  @spec now(t()) :: integer()
  def now(%__MODULE__{clock: {m, f, a}}), do: apply(m, f, a)

  @doc "Writes an entry; `ArgumentError` for a key that is another's."
  @spec put(t(), writer(), key :: term(), value :: term(), at_ms :: integer()) :: :ok
  def put(%__MODULE__{table: table}, writer, key, value, at_ms) when is_integer(at_ms) do
    unless writer(key) == writer,
      do: raise(ArgumentError, "board key #{inspect(key)} is not written by #{inspect(writer)}")

    :ets.insert(table, {key, value, at_ms})
    :ok
  end

  @doc "A sink for `Hal.Device` and `Vision.BlobDetector`: writes a reading, now, or detections at the time of their picture; leaves alone what it does not know."
  @spec sense(t(), writer(), reading :: tuple()) :: :ok
  def sense(board, device, {:health, device, {condition, since_ms}}),
    do: put(board, device, {:health, device}, condition, since_ms)

  def sense(board, :blob_detector, {:detections, %Detections{at_ms: at_ms} = detections}),
    do: put(board, :blob_detector, :detections, detections, at_ms)

  def sense(_board, _device, {:detections, _malformed}), do: :ok

  # What only a driver of its own knows is nobody's here, and no reason for it to crash.
  def sense(board, device, {key, value}) do
    if writer(key), do: put(board, device, key, value, now(board)), else: :ok
  end

  @doc "Takes an entry off, for instance of a peer whose place was seen to be empty."
  @spec delete(t(), writer(), key :: term()) :: :ok
  def delete(%__MODULE__{table: table}, writer, key) do
    ^writer = writer(key)
    :ets.delete(table, key)
    :ok
  end

  @doc "The value of a key, with its time, unless it is older than `max_age_ms`."
  @spec fetch(
          t(),
          key :: term(),
          max_age_ms :: non_neg_integer() | :infinity,
          now_ms :: integer()
        ) ::
          {:ok, term(), at_ms :: integer()} | :error
  def fetch(%__MODULE__{table: table}, key, max_age_ms, now_ms) do
    # Numbers are smaller than atoms, so that nothing is older than `:infinity`.
    case :ets.lookup(table, key) do
      [{_key, value, at_ms}] when now_ms - at_ms <= max_age_ms -> {:ok, value, at_ms}
      _none_or_old -> :error
    end
  end

  @doc "The same with the time of now."
  @spec fetch(t(), key :: term(), max_age_ms :: non_neg_integer() | :infinity) ::
          {:ok, term(), at_ms :: integer()} | :error
  def fetch(board, key, max_age_ms), do: fetch(board, key, max_age_ms, now(board))

  @doc "How a device is, and since when, as its process said last; `nil` if none has said anything yet."
  @spec health(t(), device :: atom()) :: Hal.Device.status() | nil
  def health(board, device) do
    case fetch(board, {:health, device}, :infinity) do
      {:ok, condition, since_ms} -> {condition, since_ms}
      :error -> nil
    end
  end

  @doc "What other robots told, by their ids."
  @spec peers(t()) :: %{atom() => Robot.Percept.peer()}
  def peers(%__MODULE__{table: table}),
    do: Map.new(:ets.select(table, [{{{:peer, :"$1"}, :"$2", :_}, [], [{{:"$1", :"$2"}}]}]))

  @doc "All entries with their ages, for people."
  @spec entries(t()) :: %{(key :: term()) => {value :: term(), age_ms :: integer()}}
  def entries(%__MODULE__{table: table} = board) do
    now_ms = now(board)
    Map.new(:ets.tab2list(table), fn {key, value, at_ms} -> {key, {value, now_ms - at_ms}} end)
  end

  @doc "Whether the e-stop is latched."
  @spec latched?(t()) :: boolean()
  def latched?(%__MODULE__{latch: latch}), do: :ets.member(latch, :estop)

  @doc "Latches the e-stop in the table alone, which waits for no disk; `latch/1` is to follow."
  @spec hold(t()) :: :ok
  def hold(%__MODULE__{latch: latch}) do
    :ets.insert(latch, {:estop, true})
    :ok
  end

  @doc "Latches the e-stop. The table holds it even where the file cannot be written."
  @spec latch(t()) :: :ok
  def latch(%__MODULE__{} = board) do
    :ok = hold(board)
    if board.file, do: checked(board, File.write(board.file, "e-stop\n", [:sync]))
    :ok
  end

  @doc "Releases the latch. If the file cannot be removed, the next start is latched again."
  @spec unlatch(t()) :: :ok
  def unlatch(%__MODULE__{latch: latch} = board) do
    if board.file && File.exists?(board.file), do: checked(board, File.rm(board.file))
    :ets.delete(latch, :estop)
    :ok
  end

  @impl GenServer
  def init(%Config{} = config) do
    board = %__MODULE__{
      robot: config.id,
      table: :ets.new(__MODULE__, [:public, read_concurrency: true]),
      latch: :ets.new(__MODULE__, [:public]),
      clock: config.clock,
      file: config.estop_file,
      since_ms: Config.now(config)
    }

    if board.file && File.exists?(board.file), do: :ets.insert(board.latch, {:estop, true})

    case Registry.register(Names, {config.id, :board}, board) do
      {:ok, _} -> {:ok, board}
      {:error, {:already_registered, pid}} -> {:stop, {:already_started, pid}}
    end
  end

  defp writer({:peer, _id}), do: :comms
  defp writer({:health, device}), do: device
  defp writer({:hung, _part}), do: :watch
  defp writer(key), do: Map.get(@writers, key)

  defp checked(_board, :ok), do: :ok

  defp checked(board, {:error, reason}) do
    about = %{robot: board.robot, file: board.file, reason: reason}
    Hal.Event.execute([:robot, :estop_file, :error], %{}, about)
  end
end
