defmodule Robot.Control.Pilot.Journal do
  @moduledoc false
  # Describes what a pilot publishes about itself: on the board, in events and in the trace.
  #
  # The board's entry `:mission` contains the mission, its phase and its claim, the time of the
  # percept from which the mission made that claim, and the options with which it was started. The entry `:asking`
  # exists while a callback of the mission runs, so that `Robot.Safety.LivenessMonitor` detects one
  # that does not return.
  alias Hal.Event
  alias Robot.Board
  alias Robot.Control.Crash
  alias Robot.Trace

  @typedoc "The part of a pilot's data that is needed here; `since_ms` is when its state began."
  @type data :: %{
          required(:config) => Robot.Config.t(),
          required(:board) => Board.t(),
          required(:since_ms) => integer(),
          required(:runner) => Robot.Mission.Runner.t(),
          required(:options) => keyword(),
          optional(atom()) => term()
        }
  @type state :: :idle | {mission :: module(), phase :: atom()}

  @doc "Records an input in the trace."
  @spec heard(term(), data()) :: :ok
  def heard(input, %{config: config}) do
    _ = Trace.input(config, :pilot, input, Robot.Config.now(config))
    :ok
  end

  @doc "Records the start of a pilot in the trace."
  @spec begun(data()) :: :ok
  def begun(%{config: config, runner: runner} = data),
    do: Trace.begin(config, :pilot, {runner, %{state: nil}}, data.since_ms)

  @doc "Offers the pilot's state to the trace."
  @spec checkpoint(state(), data()) :: :ok
  def checkpoint(state, %{config: config, runner: runner}) do
    Trace.checkpoint(
      config,
      :pilot,
      fn -> {runner, %{state: state}} end,
      Robot.Config.now(config)
    )
  end

  @doc """
  Calls a callback of a mission, with an entry on the board while it runs; `nil` for no mission,
  with no entry. Each call has another entry. One that fails is told (`Robot.Control.Crash`).
  """
  @spec asking(module() | nil, data(), asked :: function()) :: term()
  def asking(nil, _data, function), do: function.()

  def asking(module, %{board: board, config: config}, function) do
    call = {module, System.unique_integer()}
    Board.put(board, :pilot, :asking, call, Robot.Config.now(config))
    result = Crash.told(config, board, :pilot, function)
    answered(board)
    result
  end

  @doc "Removes the board's entry of a running callback."
  @spec answered(Board.t()) :: :ok
  def answered(board) do
    _ = Board.delete(board, :pilot, :asking)
    :ok
  end

  @doc "Publishes the pilot's state after an event; returns its data, with when that state began."
  @spec changed(state(), state(), claim :: map(), data()) :: data()
  def changed(state, state, claim, data), do: written(state, claim, data)

  def changed(_before, state, claim, data),
    do: told(state, claim, %{data | since_ms: Robot.Config.now(data.config)})

  @doc "Publishes a state that is new, or the first one, also as an event and in the trace."
  @spec told(state(), claim :: map(), data()) :: data()
  def told(state, claim, data) do
    data = written(state, claim, data)
    at_ms = data.since_ms
    Trace.effect(data.config, :pilot, {:phase, state}, at_ms)
    about = %{robot: data.config.id, state: state}
    Event.execute([:robot, :pilot, :phase], %{at_ms: at_ms}, about)
    data
  end

  defp written(state, claim, data) do
    entry = %{
      state: state,
      claim: claim,
      since_ms: data.since_ms,
      ticked_ms: data.runner.ticked_ms,
      options: data.options
    }

    Board.put(data.board, :pilot, :mission, entry, Robot.Config.now(data.config))
    data
  end
end
