defmodule Robot.Watch do
  @moduledoc """
  Sees that the executive ticks. A behaviour that hangs cannot say so, nor can a supervisor see it: the gate's
  dead man stops the wheels, and the robot would stand for ever, well by its status.

  The watch asks nobody. It looks at the board, where the executive counts its ticks. When the count is the
  same for eight looks of its own, 0.4 s, the executive hangs: the watch says so, on the board under `:hung` and by the event
  `[:robot, :executive, :hung]`, names the behaviour, and ends it. The executive that follows is idle.

  It counts looks and not time, so that a machine that was asleep, or is slow, is not taken for a robot that hangs.
  """
  use GenServer
  alias Hal.Event
  alias Robot.{Board, Config, Names}

  @look_ms 50
  @looks 8

  @typedoc "The count of ticks at the last look, and how many looks it has been the same."
  @type t :: {tick :: term(), same :: non_neg_integer()}

  @doc """
  One more look.

      iex> {:well, watch} = Robot.Watch.look({7, 5}, 8)
      iex> watch
      {8, 0}
      iex> {:well, watch} = Robot.Watch.look({8, 6}, 8)
      iex> Robot.Watch.look(watch, 8)
      {:hangs, {8, 0}}
  """
  @spec look(t(), tick :: term()) :: {:well | :hangs, t()}
  def look({tick, same}, tick) when same + 1 >= @looks, do: {:hangs, {tick, 0}}
  def look({tick, same}, tick), do: {:well, {tick, same + 1}}
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
    if judged == :hangs, do: restart(s)
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

  defp restart(%{config: %{id: id} = config, board: board}) do
    at_ms = Config.now(config)
    behaviour = behaviour(board)
    Board.put(board, :watch, :hung, behaviour, at_ms)
    about = %{robot: id, behaviour: behaviour}
    Event.execute([:robot, :executive, :hung], %{at_ms: at_ms}, about)

    with pid when is_pid(pid) <- Names.whereis(id, :executive),
         do: Process.exit(pid, {:hung, behaviour})
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
