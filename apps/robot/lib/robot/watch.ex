defmodule Robot.Watch do
  @moduledoc """
  Sees that the executive ticks. A behaviour that hangs cannot say so, nor can a supervisor see it: the gate's
  dead man stops the wheels, and the robot would stand for ever, well by its status.

  The watch asks nobody. It looks at the board, where the executive counts its ticks. When the count is the
  same for 8 looks of its own, 0.4 s, it says so, on the board under `:hung` and by the event
  `[:robot, :executive, :silent]`, with the behaviour's name. On a busy machine a tick may take that long, for
  instance where code is loaded; after 40 looks, 2 s, it is taken for one that never ends: the watch ends the executive
  (`[:robot, :executive, :hung]`), and the one that follows is idle.

  It counts looks and not time, so that a machine that was asleep, or is slow, is not taken for a robot that hangs.
  """
  use GenServer
  alias Hal.Event
  alias Robot.{Board, Config, Names}

  @look_ms 50
  @silent 8
  @hung 40

  @typedoc "The count of ticks at the last look, and how many looks it has been the same."
  @type t :: {tick :: term(), same :: non_neg_integer()}

  @doc """
  One more look.

      iex> {:well, watch} = Robot.Watch.look({7, 5}, 8)
      iex> watch
      {8, 0}
      iex> {:well, watch} = Robot.Watch.look({8, 6}, 8)
      iex> Robot.Watch.look(watch, 8)
      {:silent, {8, 8}}
      iex> Robot.Watch.look({8, 8}, 9)
      {:again, {9, 0}}
      iex> Robot.Watch.look({8, 39}, 8)
      {:hangs, {8, 0}}
  """
  @spec look(t(), tick :: term()) :: {:well | :silent | :again | :hangs, t()}
  def look({tick, same}, tick) when same + 1 >= @hung, do: {:hangs, {tick, 0}}
  def look({tick, same}, tick) when same + 1 == @silent, do: {:silent, {tick, @silent}}
  def look({tick, same}, tick), do: {:well, {tick, same + 1}}
  def look({_before, same}, tick) when same >= @silent, do: {:again, {tick, 0}}
  def look({_before, _same}, tick), do: {:well, {tick, 0}}

  @doc "Starts the watch of a robot whose board is running."
  @spec start_link(Config.t()) :: GenServer.on_start()
  def start_link(%Config{} = config),
    do: GenServer.start_link(__MODULE__, config, name: Names.via(config.id, :watch))

  @impl GenServer
  def init(%Config{id: id} = config) do
    s = %{config: config, board: Board.find!(id), watch: {nil, 0}}
    {:ok, schedule(s)}
  end

  @impl GenServer
  def handle_info(:look, s) do
    {judged, watch} = look(s.watch, tick(s.board, s.config.id))
    act(judged, s)
    {:noreply, schedule(%{s | watch: watch})}
  end

  def handle_info(_other, s), do: {:noreply, s}

  # Of each executive on its own; one that is being started has done nothing wrong yet.
  defp tick(board, robot) do
    with pid when is_pid(pid) <- Names.whereis(robot, :executive),
         {:ok, %{tick: tick}, _at_ms} <- Board.fetch(board, :doing, :infinity),
         do: {pid, tick},
         else: (_none -> make_ref())
  end

  defp act(:well, _s), do: :ok
  defp act(:again, s), do: Board.delete(s.board, :watch, :hung)
  defp act(:silent, s), do: tell(s, :silent, behaviour(s.board))

  defp act(:hangs, %{config: %{id: id}} = s) do
    behaviour = behaviour(s.board)
    tell(s, :hung, behaviour)

    with pid when is_pid(pid) <- Names.whereis(id, :executive),
         do: Process.exit(pid, {:hung, behaviour})
  end

  defp tell(%{config: config} = s, what, behaviour) do
    at_ms = Config.now(config)
    Board.put(s.board, :watch, :hung, {what, behaviour}, at_ms)
    about = %{robot: config.id, behaviour: behaviour}
    Event.execute([:robot, :executive, what], %{at_ms: at_ms}, about)
  end

  defp behaviour(board) do
    case Board.fetch(board, :goal, :infinity) do
      {:ok, module, _at_ms} -> module
      :error -> nil
    end
  end

  # Where a test decides when the executive acts, nobody misses its ticks.
  defp schedule(%{config: %{pace: :manual}} = s), do: s

  defp schedule(s) do
    Process.send_after(self(), :look, @look_ms)
    s
  end
end
