defmodule Swarm.EStop.Answer do
  @moduledoc false
  # Answers the caller of a stop for a gate that has carried it out.
  alias Hal.Device
  alias Robot.{Board, Names}
  alias Robot.Safety.Readiness
  alias Mesh.Nonblocking

  # Its base reports ten times a second; the caller waits for half a second (`Swarm.Commands.Client`).
  @report_ms 300

  @doc """
  Called by the gate when the robot's mission or order has ended and the gate has stopped: answers whether the wheels
  were told, which their next report shows. Does not wait.
  """
  @spec stood(atom(), reference()) :: :ok
  def stood(robot, ref), do: confirm(robot, {Nonblocking, :answer, [ref]})

  @doc "The same for an e-stop, when the gate is latched: `:ok` also says that the latch is in its file, if it has one."
  @spec latched(atom(), reference()) :: :ok
  def latched(robot, ref), do: confirm(robot, {__MODULE__, :save, [robot, ref]})

  @doc "Answers an e-stop, as soon as its file is written if the answer is `:ok`."
  @spec save(atom(), reference(), :ok | {:error, line :: String.t()}) :: :ok
  def save(robot, ref, :ok),
    do: Board.saved(Board.find!(robot), {__MODULE__, :saved, [robot, ref]})

  def save(_robot, ref, error), do: Nonblocking.answer(ref, error)

  @doc "Called by the board: answers an e-stop whose file has been written, or could not be."
  @spec saved(atom(), reference(), :ok | {:error, {Path.t(), File.posix()}}) :: :ok
  def saved(_robot, ref, :ok), do: Nonblocking.answer(ref, :ok)

  def saved(robot, ref, {:error, {file, reason}}) do
    why =
      "the stop is not in its file #{file} (#{:file.format_error(reason)}), and would not survive a restart of the " <>
        "machine; the file is tried again"

    Nonblocking.answer(ref, {:error, "#{robot} is held, but #{why}"})
  end

  @doc "Answers an e-stop that took too long; after another answer it has no effect."
  @spec unsaved(atom(), reference()) :: :ok
  def unsaved(robot, ref) do
    board = Board.find!(robot)

    cond do
      not Board.latched?(board) ->
        why = "its gate does not answer, and the drive stops by itself if nothing comes from it"
        Nonblocking.answer(ref, {:error, "#{robot} is told to stop, but #{why}"})

      Board.saved?(board) ->
        :ok

      true ->
        why =
          "its disk has not taken the e-stop yet, which would not survive a restart of the machine"

        Nonblocking.answer(ref, {:error, "#{robot} is held, but #{why}"})
    end
  end

  defp confirm(robot, {m, f, a} = then) do
    case {stopped(robot), Names.whereis(robot, :drive)} do
      {:ok, nil} -> apply(m, f, a ++ [{:error, line(robot, "its drive is starting again")}])
      {:ok, drive} -> Device.confirm(drive, @report_ms, {__MODULE__, :told, [robot, then]})
      {error, _drive} -> apply(m, f, a ++ [error])
    end
  end

  @doc "Called by the drive: hands on an answer to a stop, by what the drive has heard of its base since."
  @spec told(atom(), Robot.Config.call(), Device.Confirmation.outcome()) :: term()
  def told(robot, {m, f, a}, :silent) do
    why = "its base has not reported its wheels for #{@report_ms} ms since"
    apply(m, f, a ++ [{:error, line(robot, why)}])
  end

  def told(robot, {m, f, a}, _reported_or_closed), do: apply(m, f, a ++ [stopped(robot)])

  defp line(robot, why) do
    "#{robot}: its gate stands, but #{why}: nobody can say whether its wheels do; " <>
      "use the robot's own emergency stop"
  end

  # Whether a stop of the gate can reach the wheels.
  defp stopped(robot) do
    with {:error, line} <- Readiness.stopped(Board.find!(robot)),
         do: {:error, "#{robot}: #{line}"}
  end

  @doc "Tells the robot's comms that it obeys an order of this giver, for the log (`Hal.Event`)."
  @spec obeyed(robot :: atom(), request :: term(), giver :: String.t()) :: :ok
  def obeyed(robot, request, giver),
    do: GenServer.cast(Robot.Names.via(robot, :comms), {:ordered, request, giver})
end
