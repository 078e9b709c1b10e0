defmodule Robot.Safety.LivenessMonitor do
  @moduledoc """
  Sees that gate and executive tick and that the pilot comes back from its mission. What hangs cannot say so, nor can a
  supervisor see it, and the robot would be well by its status for ever: with a gate that hangs it stands, by the
  watchdog of the drive's device; with an executive that hangs, by the gate's dead man; with a mission that hangs it goes on
  with its last goal and hears no order.

  The watch asks nobody. It looks at the board, where gate and executive write at each tick and the pilot notes each call of
  its mission. When that is the same for 8 looks of its own, 0.4 s, it says so, on the board under `{:hung, part}`
  and by the event `[:robot, part, :silent]`, with the name of the behaviour or the mission. On a busy machine a tick may
  take that long, for instance where code is loaded (then `[:robot, part, :again]` follows); after 40 looks, 2 s, it is
  taken for one that never ends: the watch ends that part (`[:robot, part, :hung]`), and the one that follows is idle.

  It counts looks and not time, so that a machine that was asleep, or is slow, is not taken for a robot that hangs.
  """
  use GenServer
  alias Hal.Event
  alias Robot.{Board, Config, Names}

  @look_ms 50
  @silent 8
  @hung 40
  @parts [:gate, :executive, :pilot]

  @typedoc "What a part was at by the last look, and how many looks it has been the same."
  @type t :: {mark :: term(), same :: non_neg_integer()}

  @type part :: :gate | :executive | :pilot

  @doc "The parts of a robot that are watched."
  @spec parts() :: [part()]
  def parts, do: @parts

  @doc """
  One more look.

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
  Where a part of a robot hangs, in words.

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

  @doc "Starts the watch of a robot whose board is running."
  @spec start_link(Config.t()) :: GenServer.on_start()
  def start_link(%Config{} = config),
    do: GenServer.start_link(__MODULE__, config, name: Names.via(config.id, :watch))

  @impl GenServer
  def init(%Config{id: id} = config) do
    board = Board.find!(id)
    for part <- @parts, do: forget(board, part)
    {:ok, schedule(%{config: config, board: board, parts: Map.new(@parts, &{&1, {nil, 0}})})}
  end

  # With the watch before this one fell the part that hung.
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

  def handle_info(_other, s), do: {:noreply, s}

  # Of each process on its own; one that is being started has done nothing wrong yet, nor has a pilot that waits.
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
    Board.put(s.board, :watch, {:hung, part}, {what, module}, Config.now(s.config))
    tell(s, part, what)
    module
  end

  defp tell(%{config: config} = s, part, what) do
    {:ok, {_what, module}, _at_ms} = Board.fetch(s.board, {:hung, part}, :infinity)
    about = Map.merge(where(part, module), %{robot: config.id, line: words(part, module)})
    Event.execute([:robot, part, what], %{at_ms: Config.now(config)}, about)
  end

  defp where(:gate, nil), do: %{}
  defp where(:executive, behaviour), do: %{behaviour: behaviour}
  defp where(:pilot, mission), do: %{mission: mission}

  defp module(:gate, _board), do: nil
  defp module(:executive, board), do: named(noted(board, :goal, & &1))
  defp module(:pilot, board), do: named(noted(board, :asking, &elem(&1, 0)))

  defp named({:ok, module}), do: module
  defp named(:error), do: nil

  # Where a test decides when the executive acts, nobody misses its ticks.
  defp schedule(%{config: %{pace: :manual}} = s), do: s

  defp schedule(s) do
    Process.send_after(self(), :look, @look_ms)
    s
  end
end
