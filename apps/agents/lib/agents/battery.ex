defmodule Agents.Battery do
  @moduledoc """
  Answers `:query`, `:volts` by the voltage of its robot's battery, as the base told it within the last minute; `nil` if it did not. A program
  that comes along (`Agents.Programs`), and an example of one.
  """
  alias Robot.Board
  @behaviour Agents.Responder

  @recent_ms 60_000

  @impl Agents.Responder
  def init(robot, _argument), do: robot

  @impl Agents.Responder
  def handle(%{performative: :query, content: :volts}, robot) do
    with {:ok, board} <- Board.find(robot),
         {:ok, volts, _at_ms} <- Board.fetch(board, :power, @recent_ms) do
      {{:inform, volts}, robot}
    else
      _none_or_old -> {{:inform, nil}, robot}
    end
  end

  def handle(_other, robot), do: {{:refuse, :unknown}, robot}
end
