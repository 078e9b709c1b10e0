defmodule Swarm.EStop.Answer do
  @moduledoc """
  The answer of a gate that has carried out a stop, to the e-stop process or to the caller.
  """
  alias Robot.{Board, Names}
  alias Robot.Safety.Readiness
  alias Mesh.Nonblocking

  @doc """
  Called by the gate when the robot's mission or order has ended: it may be released by the reset
  that was given at `given_us`, if its sender still waits for `ref`, and if nobody has stopped the
  robot since the state that `pressed` identifies.
  """
  @spec release(atom(), pressed :: reference(), {reference(), given_us :: integer()}) :: :ok
  def release(robot, pressed, {ref, given_us}),
    do: GenServer.cast(Names.via(robot, :estop), {:release, pressed, ref, given_us})

  @doc """
  Called by the gate when the robot's mission or order has ended and the gate has stopped: answers
  whether the wheels have, too.
  """
  @spec stood(atom(), reference()) :: :ok
  def stood(robot, ref), do: Nonblocking.answer(ref, stopped(robot, Board.find!(robot)))

  @doc "Answers that a reset was not carried out, because the robot was stopped again after it was given."
  @spec stopped_again(atom(), reference()) :: :ok
  def stopped_again(robot, ref),
    do: Nonblocking.answer(ref, {:error, "#{robot} was stopped again meanwhile; reset it again"})

  @doc "Whether a stop of the gate also stops the wheels."
  @spec stopped(atom(), Board.t()) :: :ok | {:error, line :: String.t()}
  def stopped(robot, board),
    do: with({:error, line} <- Readiness.stopped(board), do: {:error, "#{robot}: #{line}"})
end
