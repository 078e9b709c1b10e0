defmodule Robot.Safety.LivenessMonitor do
  @moduledoc """
  Monitors that gate and executive tick and that the pilot's mission callbacks return. A process
  that hangs cannot report it, a supervisor does not detect it, and the robot's status would stay
  normal. If the gate hangs, the watchdog of the drive's device stops the robot; if the executive
  hangs, the gate's dead man's switch does; if a mission hangs, the robot continues with its last
  goal and takes no orders.

  The monitor sends no requests. It looks at the board, where gate and executive write at each
  tick and the pilot notes each call of its mission. If an entry stays the same for 8 looks
  (0.4 s), the monitor reports the part as silent, on the board under `{:hung, part}` and by the
  event `[:robot, part, :silent]`, with the name of the behaviour or the mission. On a busy
  machine a tick may take that long, for instance while code is loaded; then
  `[:robot, part, :again]` follows. After 40 looks (2 s), the part is taken to hang: the monitor
  kills it (`[:robot, part, :hung]`), and its successor starts idle.

  It counts looks instead of measuring time, so that a machine that was suspended, or whose
  processes all run slowly, is not taken for a robot that hangs.
  """
  use GenServer
  alias Hal.Event
  alias Robot.{Board, Names}

  @look_ms 50
  @silent 8
  @hung 40
  @parts [:gate, :executive, :pilot]

  @typedoc "The mark of a part at the last look, and for how many looks it has been the same."
  @type t :: {mark :: term(), same :: non_neg_integer()}

  @type part :: :gate | :executive | :pilot

  @doc "The parts of a robot that are monitored."
  @spec parts() :: [part()]
  def parts, do: @parts

  @doc """
  The verdict of one more look at a part's mark, and the next state.

      iex> {:well, watch} = Robot.Safety.LivenessMonitor.look({7, 5}, 8)
      iex> watch
      {8, 0}
      iex> {:well, watch} = Robot.Safety.LivenessMonitor.look({8, 6}, 8)
      iex> Robot.Safety.LivenessMonitor.look(watch, 8)
      {:silent, {8, 8}}
      iex> Robot.Safety.LivenessMonitor.look({8, 8}, 9)
      {:again, {9, 0}}
      iex> Robot.Safety.LivenessMonitor.look({8, 39}, 8)
      {:hangs, {8, 0}}
  """
  @spec look(t(), mark :: term()) :: {:well | :silent | :again | :hangs, t()}
  def look({mark, same}, mark) when same + 1 >= @hung, do: {:hangs, {mark, 0}}
  def look({mark, same}, mark) when same + 1 == @silent, do: {:silent, {mark, @silent}}
  def look({mark, same}, mark), do: {:well, {mark, same + 1}}
  def look({_before, same}, mark) when same >= @silent, do: {:again, {mark, 0}}
  def look({_before, _same}, mark), do: {:well, {mark, 0}}

  @doc """
  Names, in words, where a part of a robot hangs.

      iex> Robot.Safety.LivenessMonitor.words(:executive, Robot.Behaviour.Goto)
      "Robot.Behaviour.Goto"
      iex> Robot.Safety.LivenessMonitor.words(:executive, nil)
      "its thinking"
      iex> Robot.Safety.LivenessMonitor.words(:pilot, Missions.Landmark)
      "its mission Missions.Landmark"
  """
  @spec words(part(), module() | nil) :: String.t()
  def words(:gate, nil), do: "its gate"
  def words(:executive, nil), do: "its thinking"
  def words(:executive, behaviour), do: inspect(behaviour)
  def words(:pilot, mission), do: "its mission #{inspect(mission)}"

  @doc "Starts the monitor of a robot whose board is running."
  @spec start_link(Robot.Config.t()) :: GenServer.on_start()
  def start_link(%Robot.Config{} = config),
    do: GenServer.start_link(__MODULE__, config, name: Names.via(config.id, :watch))

  @impl GenServer
  def init(%Robot.Config{id: id} = config) do
    board = Board.find!(id)
    for part <- @parts, do: forget(board, part)

    {:ok, schedule(%{config: config, board: board, parts: Map.new(@parts, &{&1, {nil, 0}})})}
  end

  # A note that an earlier monitor left about a silent part no longer holds.
  defp forget(board, part) do
    with {:ok, {:silent, _module}} <- noted(board, {:hung, part}, & &1),
         do: Board.delete(board, :watch, {:hung, part})
  end

  @impl GenServer
  def handle_info(:look, s) do
    parts =
      for part <- @parts, into: %{} do
        {judged, watch} = look(s.parts[part], mark(s.board, s.config.id, part))
        act(judged, part, s)
        {part, watch}
      end

    {:noreply, schedule(%{s | parts: parts})}
  end

  # The mark contains the pid, so that a restarted process counts anew. A part that is being
  # started or has no entry on the board, as a pilot that waits, gets a new mark at each look.
  defp mark(board, robot, part) do
    with pid when is_pid(pid) <- Names.whereis(robot, part),
         {:ok, at} <- at(part, board),
         do: {pid, at},
         else: (_none -> make_ref())
  end

  defp at(:gate, board) do
    with {:ok, _driving, at_ms} <- Board.fetch(board, :driving, :infinity), do: {:ok, at_ms}
  end

  defp at(:executive, board), do: noted(board, :doing, & &1.tick)
  defp at(:pilot, board), do: noted(board, :asking, & &1)

  defp noted(board, key, what) do
    with {:ok, value, _at_ms} <- Board.fetch(board, key, :infinity), do: {:ok, what.(value)}
  end

  defp act(:well, _part, _s), do: :ok

  defp act(:again, part, s) do
    tell(s, part, :again)
    Board.delete(s.board, :watch, {:hung, part})
  end

  defp act(:silent, part, s), do: note(s, part, :silent)

  defp act(:hangs, part, %{config: %{id: id}} = s) do
    module = note(s, part, :hung)

    with pid when is_pid(pid) <- Names.whereis(id, part),
         do: Process.exit(pid, {:hung, module})
  end

  defp note(s, part, what) do
    module = module(part, s.board)
    Board.put(s.board, :watch, {:hung, part}, {what, module}, Robot.Config.now(s.config))
    tell(s, part, what)
    module
  end

  defp tell(%{config: config} = s, part, what) do
    {:ok, {_what, module}, _at_ms} = Board.fetch(s.board, {:hung, part}, :infinity)
    about = Map.merge(where(part, module), %{robot: config.id, line: words(part, module)})
    Event.execute([:robot, part, what], %{at_ms: Robot.Config.now(config)}, about)
  end

  defp where(:gate, nil), do: %{}
  defp where(:executive, behaviour), do: %{behaviour: behaviour}
  defp where(:pilot, mission), do: %{mission: mission}

  defp module(:gate, _board), do: nil
  defp module(:executive, board), do: named(noted(board, :goal, & &1))
  defp module(:pilot, board), do: named(noted(board, :asking, &elem(&1, 0)))

  defp named({:ok, module}), do: module
  defp named(:error), do: nil

  # If a test decides when the executive acts, its ticks are not monitored.
  defp schedule(%{config: %{pace: :manual}} = s), do: s

  defp schedule(s) do
    Process.send_after(self(), :look, @look_ms)
    s
  end
end
