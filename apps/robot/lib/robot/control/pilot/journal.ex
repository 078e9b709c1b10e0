defmodule Robot.Control.Pilot.Journal do
  @moduledoc """
  What a pilot tells of itself: on the board, in events and in the trace.

  Under `:mission` the board has the mission, its phase and its claim; under `:asking` the
  callback of the mission that runs, so that `Robot.Safety.LivenessMonitor` sees one that never
  returns.
  """
  alias Hal.Event
  alias Robot.{Board, Config}
  alias Robot.Control.Trace

  @typedoc "Of a pilot's data: the config, the board, and since when it has been in its state."
  @type data :: %{
          required(:config) => Config.t(),
          required(:board) => Board.t(),
          required(:since_ms) => integer(),
          optional(atom()) => term()
        }
  @type state :: :idle | {mission :: module(), phase :: atom()}

  @doc "Leaves an input in the trace."
  @spec heard(term(), data()) :: :ok
  def heard(input, %{config: config}) do
    _ = Trace.input(config, :pilot, input, Config.now(config))
    :ok
  end

  @doc """
  Calls a callback of a mission, `nil` for none, with a note of it on the board. No two calls are
  noted alike.
  """
  @spec asking(module() | nil, data(), asked :: function()) :: term()
  def asking(nil, _data, function), do: function.()

  def asking(module, %{board: board, config: config}, function) do
    call = {module, System.unique_integer()}
    Board.put(board, :pilot, :asking, call, Config.now(config))
    result = function.()
    answered(board)
    result
  end

  @doc "No callback runs."
  @spec answered(Board.t()) :: :ok
  def answered(board) do
    _ = Board.delete(board, :pilot, :asking)
    :ok
  end

  @doc "The pilot's state is this now; gives its data back, with since when."
  @spec changed(state(), state(), claim :: map(), data()) :: data()
  def changed(state, state, claim, data), do: written(state, claim, data)

  def changed(_before, state, claim, data),
    do: told(state, claim, %{data | since_ms: Config.now(data.config)})

  @doc "Tells of a state that is new, or the first."
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
    entry = %{state: state, claim: claim, since_ms: data.since_ms}
    Board.put(data.board, :pilot, :mission, entry, Config.now(data.config))
    data
  end
end
