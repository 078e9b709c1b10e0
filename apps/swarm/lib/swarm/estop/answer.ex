defmodule Swarm.EStop.Answer do
  @moduledoc """
  The answer of a gate that has carried out a stop, to the e-stop process or to the caller.
  """
  alias Hal.Device
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

  # Its base reports ten times a second; the caller waits for half a second (`Swarm.Commands.Client`).
  @report_ms 300

  @doc """
  Called by the gate when the robot's mission or order has ended and the gate has stopped, or by the e-stop process when
  it has latched the gate: answers whether the wheels were told, which their next report shows. Waits for nobody.
  """
  @spec stood(atom(), reference()) :: :ok
  def stood(robot, ref) do
    case {stopped(robot), Names.whereis(robot, :drive)} do
      {:ok, nil} -> Nonblocking.answer(ref, {:error, line(robot, "its drive is starting again")})
      {:ok, drive} -> Device.confirm(drive, @report_ms, {__MODULE__, :told, [robot, ref]})
      {error, _drive} -> Nonblocking.answer(ref, error)
    end
  end

  @doc "Called by the drive: answers a stop by what the drive has heard of its base since."
  @spec told(atom(), reference(), Device.Confirmation.outcome()) :: :ok
  def told(robot, ref, :silent) do
    why = "its base has not reported its wheels for #{@report_ms} ms since"
    Nonblocking.answer(ref, {:error, line(robot, why)})
  end

  def told(robot, ref, _reported_or_closed), do: Nonblocking.answer(ref, stopped(robot))

  defp line(robot, why) do
    "#{robot}: its gate stands, but #{why}: nobody can say whether its wheels do; " <>
      "use the robot's own emergency stop"
  end

  @doc "Answers that a reset was not carried out, because the robot was stopped again after it was given."
  @spec stopped_again(atom(), reference()) :: :ok
  def stopped_again(robot, ref),
    do: Nonblocking.answer(ref, {:error, "#{robot} was stopped again meanwhile; reset it again"})

  # Whether a stop of the gate can reach the wheels.
  defp stopped(robot) do
    with {:error, line} <- Readiness.stopped(Board.find!(robot)),
         do: {:error, "#{robot}: #{line}"}
  end
end
