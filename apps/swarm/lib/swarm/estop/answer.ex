defmodule Swarm.EStop.Answer do
  @moduledoc "What a gate that has carried out a stop says to the e-stop process, or to whoever asked for it."
  alias Robot.{Board, Names}
  alias Robot.Safety.Readiness
  alias Mesh.Nonblocking

  @doc """
  What the robot was at has ended, says its gate: it may be released by the reset that was given at `given_us`, if
  whoever gave it still waits for `ref`, and if nobody has stopped the robot since it was in the state that `pressed`
  stands for.
  """
  @spec release(atom(), pressed :: reference(), {reference(), given_us :: integer()}) :: :ok
  def release(robot, pressed, {ref, given_us}),
    do: GenServer.cast(Names.via(robot, :estop), {:release, pressed, ref, given_us})

  @doc "What the robot was at has ended, says its gate, which stands: answers whether its wheels do."
  @spec stood(atom(), reference()) :: :ok
  def stood(robot, ref), do: Nonblocking.answer(ref, stopped(robot, Board.find!(robot)))

  @doc "Whether a stop of the gate is one of the wheels."
  @spec stopped(atom(), Board.t()) :: :ok | {:error, line :: String.t()}
  def stopped(robot, board),
    do: with({:error, line} <- Readiness.stopped(board), do: {:error, "#{robot}: #{line}"})
end
